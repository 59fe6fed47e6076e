"""Figures of pages are those of docs/results/summary.json, and it holds what the project promises."""

from __future__ import annotations

import copy
import json
import sys
from pathlib import Path
from typing import Any

import pytest
from gyrotc.paper.page import keep
from results import recorded, write

ROOT = Path(__file__).resolve().parents[3]
DOCS = ROOT / "docs"
sys.path[:0] = [str(ROOT), str(ROOT / "tools" / "promises")]

import ages  # noqa: E402
import figures  # noqa: E402
from sections import SECTIONS, page  # noqa: E402

from bench import page as bench_page  # noqa: E402
from bench import runtime  # noqa: E402
from bench.page import AIMS  # noqa: E402
from bench.runtime import CORES, GRIDS, LEVELS, grid_model  # noqa: E402
from bench.splits import Judged, Split, counts  # noqa: E402
from tests.blind import both  # noqa: E402
from tests.blind.grade import shipped_worse  # noqa: E402
from tests.blind.table import _gains, ended  # noqa: E402
from tests.kills.driver import ACTIONS  # noqa: E402

WRITING = {
    "build", "check", "compare", "diagnose", "emit", "evaluate", "fit", "fleet", "import", "plan", "report",
    "simulate", "verify",
}  # fmt: skip


def test_states_that_harm_a_split_and_faults_of_its_diagnosis_are_counted() -> None:
    trivial = {"constant": 2.0, "cubic": 1.0, "cubic_slope": 1.5}
    answers = (
        ("explained", (1.0, 0.5)), ("not_testable", (1.0, 1.06)), ("consistent", None), ("fault: ValueError", None)
    )  # fmt: skip
    rows = [Judged(Split("set", "run", ROOT), "x", "cubic", 1.0, 1.0, trivial, *answer) for answer in answers]
    found = counts(rows)
    assert [found[name] for name in ("faults", "with_states", "states_at_not_testable", "states_harm")] == [1, 2, 1, 1]
    assert found["states_worst"] == pytest.approx(1.06)


def test_the_figures_of_pages_are_those_of_the_summary() -> None:
    assert list(figures.stale_figures(ROOT)) == []
    assert sum(len(figures._MARK.findall(p.read_text("utf-8"))) for p in figures.documents(ROOT)) >= 50


def test_a_stale_figure_and_a_name_that_leads_nowhere_are_seen(tmp_path: Path) -> None:
    keep(tmp_path / "docs", "one", {"rows": [{"name": "a b", "x": 1.25}, {"name": "c", "x": 2.0}]})
    (tmp_path / "README.md").write_text("no figure\n")
    lines = [
        "1.2<!--= one/rows/name=a b/x; .1f -->",
        "7<!--= one/rows/*/x; .0f; max -->",
        "1<!--= one/no; d -->",
    ]
    (tmp_path / "docs" / "a.md").write_text("\n".join(lines))
    wrong = [text.partition(": ")[0] for text in figures.stale_figures(tmp_path)]
    assert wrong == ["docs/a.md:2", "docs/a.md:3"]
    (tmp_path / "docs" / "a.md").write_text("\n".join(lines[:2]))
    figures.write(tmp_path)
    assert list(figures.stale_figures(tmp_path)) == []


def test_the_page_names_campaigns_that_are_older_than_their_code(tmp_path: Path) -> None:
    """A change of code makes a record old; one of comments, or of documentation, does not."""
    (tmp_path / "docs" / "results").mkdir(parents=True)
    code = tmp_path / "gen" / "gyrotc" / "store" / "a.py"
    code.parent.mkdir(parents=True)
    code.write_text('"""One."""\nX = 1\n')
    (tmp_path / "docs" / "results.md").write_text("<!-- older -->\n<!-- /older -->\n")
    keep(tmp_path / "docs", "kills", {"ended": 1})
    keep(tmp_path / "docs", "code", {"kills": ages.code_of(tmp_path, "kills")})
    figures.write(tmp_path)
    code.write_text('"""Two."""\nX = 1  # why\n')
    assert list(ages.unnamed(tmp_path)) == [] == ages.older(tmp_path)
    code.write_text("X = 2\n")
    assert ages.older(tmp_path) == ["kills"] and len(list(ages.unnamed(tmp_path))) == 1
    figures.write(tmp_path)
    assert list(ages.unnamed(tmp_path)) == []


def test_every_record_has_a_section_and_the_page_of_the_site_holds_all() -> None:
    pages = {"code", "packages", "paper", "signals"}  # not of this page
    names = set(json.loads((DOCS / "results" / "summary.json").read_text("utf-8")))
    assert names <= set(SECTIONS) | pages and names - pages <= set(ages.CODE)
    text = page()
    assert all(SECTIONS[n](recorded(DOCS, n)) in text for n in SECTIONS if recorded(DOCS, n) is not None)


def test_other_figures_give_another_section() -> None:
    """The comparison can fail."""
    for name, (*path, last) in {
        "bench": ("accuracy", "default", 0, "ratio", "worst"),
        "targets": ("models", 0, "mismatches"),
        "prove": ("every_input", 0, "mismatches"),
        "fleet": ("elapsed_s",),
        "kills": ("ended",),
    }.items():
        changed = copy.deepcopy(recorded(DOCS, name))
        place: Any = changed
        for step in path:
            place = place[step]
        place[last] += 1.0
        assert SECTIONS[name](changed) != SECTIONS[name](recorded(DOCS, name)), name


def test_a_campaign_leaves_everything_in_build_and_what_is_quoted_in_the_summary(tmp_path: Path) -> None:
    docs = tmp_path / "docs"
    keep(docs, "other", [1.5])
    write(docs, "one", {"kept": 1, "left": 2}, str, lambda found: {"kept": found["kept"]})
    assert (recorded(docs, "one"), recorded(docs, "other")) == ({"kept": 1}, [1.5])
    assert '"left": 2' in (tmp_path / "build" / "results" / "one.json").read_text("utf-8")
    assert (tmp_path / "build" / "results" / "one.md").read_text("utf-8") == "{'kept': 1}"


def test_the_default_method_is_as_accurate_and_small_as_promised() -> None:
    """Accuracy and bytes; times depend on the machine and are not held to anything here."""
    accuracy = recorded(DOCS, "bench")["accuracy"]
    smooth, *ripple = accuracy["default"]
    assert smooth["ratio"]["median"] <= 1.006
    assert smooth["ratio"]["worst"] <= 1.015
    assert smooth["bytes"]["worst"] <= 144
    for scenario in ripple:
        assert scenario["ratio"]["worst"] <= 1.02
        assert scenario["bytes"]["worst"] <= 264
    for scenario in accuracy["default"]:
        assert scenario["withheld"] > 0 or abs(scenario["found_minus_predicted"]) <= 0.002
    for scenario in accuracy["more_centers"]:
        assert max(abs(change) for change in scenario["largest"].values()) <= 0.005
    for scenario in accuracy["left_out"]:
        assert scenario["median"] <= 1.03


def test_the_selection_depends_neither_on_units_nor_on_order_nor_on_duplicates() -> None:
    """Ours; scikit-learn's, with its absolute threshold, shows that the measure can fail."""
    invariance = recorded(DOCS, "bench")["invariance"]
    *ours, peer = invariance["rows"]
    for row in ours:
        assert [change["same"] for change in row["changes"].values()] == [invariance["gyros"]] * 3, row["name"]
    assert peer["changes"]["rad/s"]["same"] < invariance["gyros"]


def test_every_aim_has_its_figure() -> None:
    for what, _, _, figure in AIMS:
        assert figure(recorded(DOCS, "bench")) > 0.0, what


@pytest.mark.parametrize(("worst", "reported"), [(1.2, "**1.2000** (missed)"), (1.01, "1.0100")])
def test_a_missed_aim_of_training_is_reported(worst: float, reported: str) -> None:
    changed = recorded(DOCS, "bench")
    changed["accuracy"]["default"][0]["ratio"]["worst"] = worst
    assert f"| RMS ÷ floor, smooth maps: worst | 1.015 | {reported} |" in bench_page.section(changed)


def test_a_missed_aim_of_the_runtime_is_reported() -> None:
    changed = recorded(DOCS, "runtime")
    for cost in changed["costs"]:
        cost["map"]["mean"] += 1000.0
    aim = runtime.AIMS[0]
    assert f"| {aim.what} | {aim.limit:g} | **" in runtime.section(changed)


def test_errors_of_the_runtime_keep_their_bounds() -> None:
    for error in recorded(DOCS, "runtime")["errors"]:
        assert error["worst_dph"] <= error["bound_dph"]
        if error["numeric"] == "q31":
            assert error["arithmetic_dph"] <= error["naive_float32_dph"]
            assert error["inputs"] > 2**25


def test_the_runtime_has_no_writable_data_anywhere() -> None:
    costs = recorded(DOCS, "runtime")["costs"]
    assert {cost["ram_bytes"] for cost in costs} == {0}
    assert len(costs) == 3 * len(CORES) * len(LEVELS) * 2


@pytest.mark.parametrize("n", GRIDS)
def test_the_counted_models_have_individual_widths_in_both_inputs(n: int) -> None:
    (network,) = grid_model(n).networks
    widths = [w for pair in network.widths for w in pair]
    assert len(network.centers) == n and len(set(widths)) == 2 * n


def test_a_thousand_serials_without_a_failure() -> None:
    figures = recorded(DOCS, "fleet")
    assert (figures["serials"], figures["failed"]) == (1000, 0)
    assert figures["rms_over_floor"]["median"] < 1.01


def test_a_long_file_takes_less_than_a_gibibyte() -> None:
    figures = recorded(DOCS, "import")
    assert figures["readers"]["gyrotc import"]["peak_mib"] < 1024.0
    assert figures["bytes"] > 1.9e9


def test_every_command_that_writes_was_ended_in_every_way() -> None:
    result = recorded(DOCS, "kills")
    assert result["wrong"] == 0 and result["ended"] >= 300
    assert set(result["counts"]["commands"]) >= WRITING
    for counted in result["counts"].values():
        assert set(ACTIONS) <= set(counted)


def test_no_build_whose_results_differ_passes_the_self_test() -> None:
    result = recorded(DOCS, "self-test")
    differing = [b for b in result["builds"] if b["differ"]]
    assert result["tables"] == 40 and len(differing) >= 30, "the flags break something"
    assert all(b["refused"] == b["differ"] for b in differing)


def test_every_target_agreed_in_every_bit() -> None:
    result = recorded(DOCS, "targets")
    for model in result["models"]:
        assert (model["failed"], model["mismatches"], model["rows_that_differ"]) == (0, 0, 0)
        assert model["names"] >= 12 and model["passed"] == model["targets"] and model["smallest_vectors"] >= 20000
    assert [n["differing_lines"] for n in result["nav_loop"]] == [0, 0]


@pytest.mark.parametrize(
    "control",
    [
        "contracted_build", "fast_math", "natural_expressions_on_x87", "wrong_rounding_shift", "flipped_bit",
        "m68k_software_float", "another_layout", "fault_in_a_term",
    ],
)  # fmt: skip
def test_every_negative_control_was_caught(control: str) -> None:
    caught = [c for c in recorded(DOCS, "targets")["controls"] if control in c["control"]]
    assert caught and all(c["mismatches"] > 0 for c in caught)


def test_every_input_agreed_and_kept_the_bound() -> None:
    result = recorded(DOCS, "prove")
    visits = result["every_input"]
    assert max(v["inputs"] for v in visits) == 2**32
    for visit in visits:
        assert visit["mismatches"] == 0
        assert visit["worst_dph"] <= visit["bound_dph"]
    assert all(p["differ"] == 0 for p in result["primitives"])
    fixed = {p["name"]: p["worst_error"] for p in result["primitives"] if p["name"].startswith("fixed")}
    gauss = {name: worst for name, worst in fixed.items() if name.endswith(("gauss", "curve"))}
    assert len(gauss) == 4 and max(gauss.values()) <= 3.5e-8


def test_no_run_time_error_was_left_but_those_with_an_argument() -> None:
    """docs/proof.md, section 2."""
    left = {(e["part"], e["numeric"]) for e in recorded(DOCS, "prove")["run_time_errors"] if e["alarms"]}
    assert left == {("map of a bank", "q31"), ("map of any bank", "q31"), ("memory", "q31")}


def test_the_diagram_of_reliability_is_of_the_fresh_seeds() -> None:
    assert (DOCS / both.RELIABILITY).read_text("utf-8") == both.reliability_diagram(DOCS)


def test_the_table_of_both_worlds_is_that_of_the_recordings_that_are_kept() -> None:
    kept = recorded(DOCS, "blind")
    rows = [json.loads(line) for line in (DOCS / both.ROWS).read_text("utf-8").splitlines()]
    assert {row["seed"] for row in rows} == set(kept["seeds"])
    assert both.section({**kept, "worlds": both.tables(rows)}) == both.section(kept)


def _answered(stratum: str, truth: list[str], k: float, named: list[str], p: float, **other: Any) -> dict[str, Any]:
    said = [{"id": name, "p": p, "true": name in truth} for name in named]
    verdict = "explained" if named else "consistent"
    row = {"number": 1, "stratum": stratum, "truth": truth, "k": k, "verdict": verdict, "named": named, "said": said}
    return {**row, "shipped": 0.0, "worse": 0.0, "surely_worse": 0.0, **other}


def test_what_is_asked_on_fresh_seeds_counts_each_recording_where_it_belongs() -> None:
    rows = [
        _answered("clean", [], 0.0, [], 0.0),
        _answered("clean", [], 0.0, [], 0.0, verdict="unexplained", alpha=1.4),
        _answered("foreign", ["foreign"], 3.0, ["hysteresis"], 0.99),
        _answered("one", ["hysteresis"], 2.0, ["warm_up"], 0.7),
        _answered("one", ["hysteresis"], 3.0, ["hysteresis"], 0.99, shipped=1.0, worse=1.0),
    ]
    entries = both.table([both.kept("other", 1, row) for row in rows])
    found = {entry["name"]: (entry["hits"], entry["of"], entry["met"]) for entry in entries}
    assert found["a cause or structure claimed, clean"] == (1, 2, False)
    assert found["... of these, in noise steeper than flicker"] == (1, 1, False)
    assert found["a cause named, clean"] == (0, 2, True)
    assert found["foreign given a name"] == (1, 1, False)
    assert found["family right, k ≥ 2.5"] == (1, 1, True)
    assert found["a wrong family named"] == (1, 2, False)
    assert found["stated with 95 % or more and true"] == (1, 2, False)
    assert found["shipped although worse on the exam"] == (1, 1, False)


def test_a_blind_run_fails_by_its_published_requirements(capsys: pytest.CaptureFixture[str]) -> None:
    met, missed, free = (
        {"name": n, "goal": g, "met": m} for n, g, m in (("a", "0", True), ("b", "0", False), ("c", "-", False))
    )
    assert ended([met, free]) == 0
    assert ended([met, missed, free]) == 1 and capsys.readouterr().out == "missed: b\n"


def _row(named: list[str], before2: float, after2: float) -> dict[str, object]:
    gain = {"before2": before2, "after2": after2, "noise2": 1.0, "shipped": 0.0}
    return {"stratum": "one", "truth": ["hysteresis"], "k": [3.0], "named": named, "gain": gain}


def test_what_is_gained_is_counted_over_all_that_was_hidden() -> None:
    """Over what was named rightly alone a cause that is never named gains nothing, and costs nothing."""
    reported = {t["name"]: t for t in _gains([_row(["hysteresis"], 3.0, 1.0), _row([], 3.0, 3.0)])}
    assert reported["held-out gain as share of the oracle's, k ≥ 1.7 (pooled)"]["value"] == pytest.approx(1.0)
    of_all = reported["... of all that hide hysteresis, named or not"]
    assert of_all["value"] == pytest.approx(0.5) and of_all["of"] == 2 and not of_all["met"]


@pytest.mark.parametrize(("after", "high", "worse", "surely"), [(0.9, 0.2, 0, 0), (1.1, 0.1, 1, 0), (1.1, -0.05, 1, 1)])
def test_what_is_worse_than_before_is_reported_apart_from_what_is_worse_by_more_than_noise(
    after: float, high: float, worse: int, surely: int
) -> None:
    gain = {"exam_rms_before_dph": 1.0, "exam_rms_after_dph": after, "rms_removed_dph": {"high": high}}
    reported = shipped_worse({"extended": {"gain": gain}})
    assert reported == {"shipped": 1.0, "worse": worse, "surely_worse": surely}
    assert shipped_worse({"extended": None})["shipped"] == 0.0
