"""The runner of campaigns: what it lists and refuses, records, figures of pages, aims that are missed."""

from __future__ import annotations

import json
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from bench.campaigns import CAMPAIGNS
from bench.mutation import PARTS
from bench.oracle.compare import differences
from bench.oracle.normalise import content_of
from bench.page import Figure, figures_table, write
from bench.records import fill, read_record, rounded, write_record
from bench.splits import Judged, Split, counts

ROOT = Path(__file__).resolve().parents[3]


def bench(*words: str) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-m", "bench", *words]
    return subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)


def test_without_a_name_the_campaigns_are_listed() -> None:
    done = bench()
    assert done.returncode == 0
    assert [line.split()[0] for line in done.stdout.splitlines() if line.startswith("  ")] == list(CAMPAIGNS)


@pytest.mark.parametrize(
    ("words", "why"),
    [
        (("accuracy", "nothing"), "no campaign is called nothing; there are accuracy, runtime"),
        (("oracle",), "oracle compares two commits: make bench ONLY=oracle BASE=COMMIT"),
        (("oracle", "--base", "nothing"), "nothing"),
    ],
)
def test_what_cannot_be_run_is_refused(words: tuple[str, ...], why: str) -> None:
    done = bench(*words)
    assert done.returncode not in (0, None) and why in done.stderr


def test_a_missed_aim_is_marked_and_reported() -> None:
    found = figures_table(
        "Text.", [("error", Figure(1.2, ".2f", at_most=1.01)), ("gain", Figure(0.96, ".0%", at_least=0.95))]
    )
    assert found.markdown().splitlines()[-2:] == ["| error | **1.20** (missed) | ≤ 1.01 |", "| gain | 96% | ≥ 95% |"]
    assert [row.split(" | ")[0] for row in found.missed()] == ["error"]


def test_a_record_is_read_as_it_was_written_and_pages_get_its_figures(tmp_path: Path) -> None:
    docs = tmp_path / "docs"
    docs.mkdir()
    (docs / "a.md").write_text("0<!--= one/rows/name=a; b/x; .1f --> of 7<!--= one/rows/name=a b&at=2/x; .0f -->\n")
    record = {
        "rows": [{"name": "a; b", "x": 1.25}, {"name": "a b", "at": 2, "x": 2.0}, {"name": "a b", "at": 3}],
        "list": list(range(200)),
    }
    write_record(docs, "one", record)
    assert read_record(docs, "one") == record and read_record(docs, "other") is None
    assert (docs / "a.md").read_text().startswith("1.2<!--=") and " of 2<!--=" in (docs / "a.md").read_text()
    for place in ("one/rows/9/x", "one/rows/1/x", "one/rows/name=a b/x", "one/rows/name=c/x"):
        (docs / "a.md").write_text(f"0<!--= {place}; d -->\n")
        with pytest.raises(KeyError, match=f"{place} is no value"):
            fill(docs)


def test_the_page_of_results_and_every_quoted_figure_are_those_of_the_records(tmp_path: Path) -> None:
    docs = ROOT / "docs"
    shutil.copytree(docs / "results", tmp_path / "docs" / "results")
    for page in [ROOT / "README.md", *docs.glob("*.md")]:
        shutil.copy(page, tmp_path / page.relative_to(ROOT))
    write(tmp_path / "docs")
    fill(tmp_path / "docs")
    for page in [ROOT / "README.md", *docs.glob("*.md")]:
        assert (tmp_path / page.relative_to(ROOT)).read_text("utf-8") == page.read_text("utf-8"), page.name


def test_numbers_of_a_record_have_as_many_digits_as_pages_print() -> None:
    assert rounded({"x": [1.23456789, 5], "y": ("z", 1e-9)}) == {"x": [1.23457, 5], "y": ["z", 1e-9]}


def test_states_that_harm_a_split_and_faults_of_its_diagnosis_are_counted() -> None:
    trivial = {"constant": 2.0, "cubic": 1.0, "cubic_slope": 1.5}
    answers = (
        ("explained", (1.0, 0.5)), ("not_testable", (1.0, 1.06)), ("consistent", None), ("fault: ValueError", None)
    )  # fmt: skip
    rows = [Judged(Split("set", "run", ROOT), "x", "cubic", 1.0, trivial, *answer) for answer in answers]
    found = counts(rows)
    assert [found[name] for name in ("faults", "with_states", "states_at_not_testable", "states_harm")] == [1, 2, 1, 1]
    assert found["states_worst"] == pytest.approx(1.06)


def test_every_figure_that_moves_is_listed_with_both_values(tmp_path: Path) -> None:
    was = {"rms_dph": 7.1e-4, "runs": [{"rows": 10}, {"rows": 11}], "versions": {"gcc": "12"}, "old": 1}
    now = {"rms_dph": 1.42e-3, "runs": [{"rows": 10}, {"rows": 12}], "versions": {"gcc": "13"}, "new": 1}
    contents = []
    for result in (was, now):
        (tmp_path / "x.json").write_text(json.dumps(result), "utf-8")
        contents.append(content_of(tmp_path / "x.json")["document"])
    assert list(differences(*contents)) == [
        ("rms_dph", "0.00071 → 0.00142 (+1)"),
        ("runs/1/rows", "11 → 12 (+0.091)"),
        ("old", "only in the earlier commit"),
        ("new", "only in this tree"),
    ]


@pytest.mark.parametrize(
    "pattern",
    sorted(
        {f"gen/gyrotc/{pattern}" for part in PARTS.values() for pattern in part.modules}
        | {f"tests/{pattern}" for part in PARTS.values() for pattern in part.tests}
    ),
)
def test_every_pattern_of_the_mutation_campaign_fits_a_file(pattern: str) -> None:
    assert list(ROOT.glob(pattern))
