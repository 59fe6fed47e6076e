"""500 hostile strings through every field that a user or a file can set: nothing that comes out obeys them."""

from __future__ import annotations

import io
import json
import re
import subprocess
import sys
from collections.abc import Callable, Iterator
from html.parser import HTMLParser
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import jinja2
import pytest
from conftest import Command
from emitted import recorded
from gyrotc.assess import evaluate
from gyrotc.cli import output, progress
from gyrotc.cli.results import evaluation_table, verify_table
from gyrotc.common import (
    C_COMMENT,
    c_code,
    c_comment,
    c_environment,
    c_literal,
    checked,
    checked_svg,
    csv_cell,
    file_stem,
    picture_text,
    terminal_text,
    toml_comment,
    toml_key,
    toml_value,
)
from gyrotc.fleet import write_summary
from gyrotc.jobs import extended_scenario
from gyrotc.model import Model, table_id
from gyrotc.pages import Panel, drawing, report
from gyrotc.pages import write_diagnosis_page as write_page
from gyrotc.recordings import Problems, dataset_toml, load, parse_description
from gyrotc.results import (
    Diagnosed,
    Estimate,
    FleetEntry,
    Marker,
    VerifiedTarget,
    checked_result,
    read_marker,
    write_marker,
)
from gyrotc.tables import NUMERICS, emit_texts, quantise_all
from gyrotc.verify import checked_sources, table_files, verify
from hostile import hostile_strings

if sys.version_info >= (3, 11):
    import tomllib
else:
    import tomli as tomllib

HOSTILE = hostile_strings()
AT_ONCE = 50
GCC = (
    "gcc",
    "-std=c99",
    "-trigraphs",
    "-pedantic",
    "-Wall",
    "-Wextra",
    "-Wcomment",
    "-Wtrigraphs",
    "-Werror",
    "-fsyntax-only",
)


def _groups() -> Iterator[list[str]]:
    yield from (HOSTILE[k : k + AT_ONCE] for k in range(0, len(HOSTILE), AT_ONCE))


def test_there_are_five_hundred_of_them() -> None:
    assert len(set(HOSTILE)) == 500


# ---- C ----


def test_comments_and_literals_hold_the_allowed_alone_and_benign_text_as_it_is() -> None:
    for text in HOSTILE:
        comment, literal = c_comment(text), c_literal(text)
        assert C_COMMENT.fullmatch(comment) and len(comment) <= 1000
        assert re.fullmatch(r"[ -!#-$&->@-\[\]-~]*", literal) and len(literal) <= 64
    for text in ("RLG-0042", "ramp 1 C/min, 2 x -40 ... 60 C", "http://x.org/a?b=1&c", "K. Meyer (lab 3); 50 % load"):
        assert c_comment(text) == text
    assert c_comment("Grün*/\n??/") == "Gr<U+00FC>n*<U+002F><U+000A>?<U+003F>/"
    assert c_comment("x" * 2000).endswith("x...")


def test_no_field_of_a_model_reaches_the_compiler(model_dict: dict[str, Any], tmp_path: Path) -> None:
    """Keys and values of [meta], warnings, environments, names of files, descriptions; every string in each."""
    emission = quantise_all(Model.from_dict(model_dict), None)
    for group in _groups():
        meta: dict[str, Any] = dict(zip(group, reversed(group), strict=True))
        meta |= {"warnings": group, "environments": group, "description": "".join(group)}
        data = [model_dict["data"][0] | {"file": text} for text in group]
        model = Model.from_dict(model_dict | {"meta": meta, "data": data})
        texts = emit_texts(model, emission, zero_at=20.0)
        c = tmp_path / "c"
        c.mkdir(exist_ok=True)
        for name, content in texts.items():
            (c / name).write_bytes(content)
            assert name.endswith((".bin", ".h", ".c")) or content.isascii()
        work = tmp_path / "work"
        work.mkdir(exist_ok=True)
        checked_sources(c, work, table_files(c, model, NUMERICS))  # the grammar of what is compiled accepts it
        sources = [str(c / n) for n in texts if n.endswith(".c") and n not in ("gtc_f32.c", "gtc_q31.c")]
        done = subprocess.run([*GCC, *sources], cwd=c, capture_output=True, text=True, check=False)
        assert done.returncode == 0, done.stderr[:2000]
        code = re.sub(r"/\*.*?\*/", "", texts["gtc_rlg_0042.h"].decode("ascii"), flags=re.DOTALL)
        assert all(_HEADER_WORDS.fullmatch(word) for word in re.findall(r"\w+", code))


_HEADER_WORDS = re.compile(
    r"ifndef|define|endif|ifdef|include|extern|const|C|__cplusplus|gtc|h|GTC_RLG_0042_[A-Z0-9_]{1,40}"
    r"|gtc_(f32|q31)_table_t|gtc_rlg_0042_(f32|q31)|0x[0-9a-f]{8}UL|[0-9]{1,12}(F|UL|)|period_us|temperature_c"
)


def test_a_serial_is_harmless_or_refused(model_dict: dict[str, Any]) -> None:
    taken = 0
    for text in HOSTILE:
        try:
            model = Model.from_dict(model_dict | {"serial": text})
        except ValueError:
            continue
        taken += 1
        assert re.fullmatch("[A-Za-z0-9._-]{1,64}", text)
        assert re.fullmatch("[a-z0-9_]{1,27}", model.id) and c_literal(text) == text == c_comment(text)
    assert 0 < taken < 20
    assert table_id("..", None) != table_id("__", None)


def test_a_comment_holds_a_whole_line() -> None:
    """And not only the title of a picture: exports say there how far a table lies from the map."""
    line = "said " * 29 + "once"
    assert toml_comment(line) == c_comment(line) == line


def test_templates_of_c_refuse_text_that_nothing_made_safe() -> None:
    template = c_environment().from_string("static int x = {{ value }};")
    for value in (7, "RLG_1", c_comment("a */ b"), c_literal('"'), c_code("V(0.5F)")):
        template.render(value=value)
    for unsafe in ("a b", "1;", 'system("x")', "a-b", 0.5, None, True, ["a"], b"a", "\n"):
        with pytest.raises(ValueError, match="nothing made safe"):
            template.render(value=unsafe)
    with pytest.raises(jinja2.UndefinedError):
        template.render()
    for text in [*(set(HOSTILE) - {"-1"}), "V(x)", "0x1UL; int x", "f()", "&gtc_f32_term_x, "]:
        with pytest.raises(ValueError, match="not an initialiser"):
            c_code(text)


# ---- pages and pictures ----


class _Page(HTMLParser):
    """Elements with the names of their attributes, in order."""

    def __init__(self, page: str) -> None:
        super().__init__()
        self.elements: list[tuple[str, ...]] = []
        self.feed(page)
        self.close()

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.elements.append((tag, *(name for name, _ in attrs)))

    def handle_endtag(self, tag: str) -> None:
        self.elements.append(("/" + tag,))

    def handle_decl(self, decl: str) -> None:
        self.elements.append(("!", decl))

    def handle_comment(self, data: str) -> None:
        self.elements.append(("!--", data))


# Words that decide what a page shows.
_KEPT = frozenset(
    {"schema", "verdict", "family", "status", "role", "numeric", "measured_on", "judged_on", "decision_rule"}
)


def _with(value: Any, text: Callable[[], str], key: str = "") -> Any:
    """The same object with another text in every field that holds one, and in every key that is no field's name."""
    if isinstance(value, dict):
        return {text() if k.startswith("?") else k: _with(v, text, k) for k, v in value.items()}
    if isinstance(value, list):
        return [_with(v, text, key) for v in value]
    return text() if isinstance(value, str) and key not in _KEPT else value


def _same_page(draw: Callable[[Callable[[], str]], str]) -> None:
    """Whatever the texts are, a page has the same elements and attributes as with plain ones."""
    plain = _Page(draw(lambda: "plain text"))
    assert len(plain.elements) > 20
    for start in range(0, len(HOSTILE), 10):
        place = iter(range(start, 10**9, 10))

        def text(place: Iterator[int] = place) -> str:
            k = next(place) % len(HOSTILE)
            return "x" + " ".join(HOSTILE[k : k + 10])

        page = draw(text)
        assert _Page(page).elements == plain.elements
        assert not re.search(r"[\x00-\x08\x0b-\x1f\x7f-\x9f\u200b\u202e\ud800-\udfff]", page)


@pytest.fixture(scope="module")
def result(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Any]:
    """A data set, what evaluate and verify say of a model on it (nothing compiled), and the folder."""
    folder = tmp_path_factory.mktemp("hostile")
    dataset = recorded(folder / "data")
    from emitted import emitted

    made = emitted(folder / "result")
    return {
        "folder": made,
        "evaluation": evaluate(made, dataset, compiled=False),
        "verification": verify(made, compiled=False),
    }


_RAN = {
    "name": "host",
    "numeric": "f32",
    "status": "fail",
    "compiler": "gcc",
    "error": "text",
    "package": "gcc",
    "mismatches": 1,
    "vectors": 2,
    "first_mismatches": ["vector 0"],
    "replayed": {"runs": 1, "rows": 1, "mismatches": 1, "first_mismatches": ["row 0"], "error": "text"},
}
_HEAD = {"gyrotc_version": "1", "serial": "s", "axis": None}
_RANGE = {"before": [0.0, 1.0], "after": [0.0, 1.0]}
_CHANGES = _HEAD | {
    "schema": "gyrotc.changes/1",
    "model_hash": {"before": "1", "after": "2"},
    "envelope": {"temperature_c": _RANGE, "slope_c_per_min": _RANGE},
    "same_model": False,
    "map": None,
    "figures": {"?name": {"before": 1.0, "after": 2.0}},
    "versions": {"?numpy": {"before": "1", "after": "2"}},
    "recordings": {"new": [], "gone": ["a.csv"], "other_bytes": []},
    "findings": {"new": ["text"], "gone": []},
    "files": {"new": [], "gone": [], "other_bytes": ["text"]},
}
_LIMITS = _HEAD | {
    "schema": "gyrotc.limits/1",
    "product": "text",
    "sha256": "00",
    "met": False,
    "decision_rule": "guard_band",
    "verdict": "FAIL",
    "capped": ["text"],
    "limits": [{"limit": "text", "bound": "text", "measured": ["text"], "met": False, "verdict": "FAIL"}],
}
_MANIFEST = _HEAD | {
    "schema": "gyrotc.manifest/1",
    "model_hash": "00",
    "versions": {"?numpy": "1"},
    "refused": {"?q31": "text"},
    "meta": {},
    "units": {"declared": {}, "trusted": []},
    "sources": [],
    "files": {},
}


def _owned(folder: Path, marker: Marker) -> None:
    """Makes a folder one of gyrotc's, so that a page may be written into it, once and again."""
    if read_marker(folder) is None:
        write_marker(folder, marker)


def _write_unit(folder: Path, result: dict[str, Any], model_dict: dict[str, Any], text: Callable[[], str]) -> None:
    """Everything that `build --extend --limits --previous` leaves, with these texts in it."""
    finding = {"id": "text", "text": "text", "evidence": {}}
    evaluation = result["evaluation"].content() | {"findings": [finding]}
    evaluation["runs"] = [run | {"environment": "text"} for run in evaluation["runs"]]
    file = {"file": "f", "verdict": "differs", "status": "fail", "mismatches": 1}
    verification = result["verification"].content() | {"targets": [_RAN], "emitted": [file]}
    term = {"id": "auxiliary", "parameters": {"slope_dph_per_unit": 1.0, "reference": 0.0}, "channel": text()}
    meta = {text(): text(), "warnings": [text()], "calibrated_on": text(), "description": text()}
    data = [model_dict["data"][0] | {"file": text()}]
    (folder / "diagnosis").mkdir(parents=True, exist_ok=True)
    Model.from_dict(model_dict | {"meta": meta, "data": data, "terms": [term]}).save(folder / "model.json")
    for name, content in {
        "evaluate": evaluation,
        "verify": verification,
        "training": _TRAINING,
        "manifest": _MANIFEST,
        "limits": _LIMITS,
        "changes": _CHANGES,
        "diagnosis/diagnose": _DIAGNOSIS,
    }.items():
        (folder / f"{name}.json").write_text(json.dumps(_with(content, text)))
    _owned(folder, Marker("result", "build"))


def test_the_report_of_a_build_and_of_axes(
    result: dict[str, Any], model_dict: dict[str, Any], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    names = ("thermal", "residuals", "bias", "map", "curve", "allan")
    monkeypatch.setattr(report, "_pictures", lambda *_: dict.fromkeys(names))

    def one(text: Callable[[], str]) -> str:
        _write_unit(tmp_path, result, model_dict, text)
        return report.write_report(tmp_path).read_text("utf-8")

    def axes(text: Callable[[], str]) -> str:
        _write_unit(tmp_path / "x", result, model_dict, text)
        return report.axes_page(tmp_path, ("x",))

    _same_page(one)
    _same_page(axes)


_TRAINING: dict[str, Any] = {
    "schema": "gyrotc.fit/1",
    "gyrotc_version": "1",
    "serial": "s",
    "axis": None,
    "units": {"declared": {}, "trusted": []},
    "method": "mrbf",
    "seed": 0,
    "samples": 10,
    "block_s": 10.0,
    "average_s": 100.0,
    "centers": 1,
    "parameter_bytes": 20,
    "sum_abs_weights_dph": 1.0,
    "predicted_rms_ratio": None,
    "prediction_withheld": "text",
    "noise_floor_dph": None,
    "spans": [],
    "left_out": None,
    "left_out_spans": [],
    "noise": {
        "quantisation_arcsec": None,
        "arw_deg_per_sqrt_h": None,
        "bias_instability_dph": None,
        "rate_random_walk_dph_per_sqrt_h": None,
        "allan": [],
    },
    "sensitivity": {"bias_dph_per_c": None, "bias_dph_per_c_per_min": None, "residual_rms_dph": None},
    "candidates": [],
    "reason": "text",
    "generalises": None,
    "findings": [],
    "curves": {},
    "channels": [
        {"name": "text", "verdict": "refused", "reason": "text"},
        {
            "name": "text",
            "verdict": "taken",
            "reason": "text",
            "slope_dph_per_unit": 1e-3,
            "left_out_rms_before_dph": 2e-3,
            "left_out_rms_after_dph": 1e-3,
            "share_of_variance": 0.5,
        },
    ],
}
_INTERVAL = {"value": 1.0, "low": 0.5, "high": 2.0}
_DIAGNOSIS: dict[str, Any] = {
    "schema": "gyrotc.diagnose/1",
    "gyrotc_version": "1",
    "serial": "s",
    "axis": None,
    "verdict": "explained",
    "text": "t",
    "meaning": "m",
    "next": ["text"],
    "missing": ["text"],
    "block_s": 10.0,
    "average_s": 100.0,
    "noise_floor_dph": 1e-3,
    "single_cycle": None,
    "shipping": None,
    "pictures": [],
    "extended": None,
    "baseline": {"exam_rms_dph": 1e-3, "centers": 3},
    "measured_on": "exam",
    "estimated_noise": {"arw_deg_per_sqrt_h": 1e-4},
    "scenario": "s.toml",
    "discrepancies": [
        {
            "statistic": "s",
            "measured": 1.0,
            "simulated_mean": 0.5,
            "simulated_low": 0.0,
            "simulated_high": 1.0,
            "p_value": 0.001,
            "extended": None,
        }
    ],
    "unexplained": {"best_partial_match": ["text"], "share_explained": 0.5, "p_value": 0.1, "looks_like": "text"},
    "causes": [
        {
            "id": "auxiliary",
            "family": family,
            "name": "name",
            "p_value": 0.001,
            "channel": "c",
            "signature": "s",
            "remedy": "r",
            "gain": None,
            "parameters": {"?slope": _INTERVAL},
            "equivalent": ["text"],
            "equivalent_channels": ["text"],
            "separate_by": "text",
        }
        for family in ("auxiliary", "noise")
    ],
    "considered": [
        {
            "id": "i",
            "family": "f",
            "channel": "c",
            "p_value": None,
            "not_testable": "text",
            "detection_limit": {"value": 1.0, "unit": "u", "parameter": "p", "over": [[1.0, 2.0]]},
        }
    ],
}


def test_the_page_of_a_diagnosis(tmp_path: Path) -> None:
    def draw(text: Callable[[], str]) -> str:
        (tmp_path / "diagnose.json").write_text(json.dumps(_with(_DIAGNOSIS, text)))
        _owned(tmp_path, Marker("diagnosis", "diagnose"))
        return write_page(tmp_path).read_text("utf-8")

    _same_page(draw)


def test_the_page_and_the_table_of_a_fleet(tmp_path: Path) -> None:
    entries = [
        {"name": "n", "serial": "s", "axis": None, "status": "failed", "reason": "text", "dataset": "d"},
        {
            "name": "n",
            "serial": "s",
            "axis": None,
            "status": "done",
            "judged_on": "exam",
            "constant_rms_dph": 1.0,
            "after_rms_dph": None,
            "rms_over_floor": None,
            "noise_floor_dph": None,
            "bias_dph": 0.0,
            "centers": 1,
            "table_bytes": 2,
            "sum_abs_weights_dph": 0.0,
            "error_bound_dph": 0.0,
            "findings": ["text"],
            "model_hash": "h",
            "after_mean_dph": None,
        },
    ]

    def fleet(text: Callable[[], str]) -> str:
        write_summary(tmp_path, [checked(FleetEntry, e, "entry") for e in _with(entries, text)])
        return (tmp_path / "fleet.html").read_text("utf-8")

    _same_page(fleet)
    for text in HOSTILE:
        cell = csv_cell(text)
        assert cell[:1] not in tuple("=+-@\t\r\n") and "\x1b" not in cell


def test_pictures_show_every_text_as_it_is() -> None:
    shown = [text for text in HOSTILE if text.strip()]
    panels = [Panel(title=f"{text} (train)") for text in shown]
    root = ElementTree.fromstring(str(drawing(panels)))
    drawn = [str(e.text) for e in root.iter("{http://www.w3.org/2000/svg}text")]
    for text in shown:
        assert picture_text(f"{text} (train)") in drawn


SVG = '<svg xmlns="http://www.w3.org/2000/svg" xmlns:xlink="http://www.w3.org/1999/xlink">{}</svg>'


def test_a_picture_does_nothing_but_draw() -> None:
    assert checked_svg(SVG.format('<path d="M 0 0"/><title>a</title>')).__html__()
    for inside in (
        "<script>alert(1)</script>",
        '<path onload="alert(1)"/>',
        '<a href="javascript:alert(1)"/>',
        '<use xlink:href="http://x/y.svg#z"/>',
        "<foreignObject><body/></foreignObject>",
        '<image href="https://x/y.png"/>',
        '<rect style="fill:url(http://x)"/>',
        "<style>@import 'x'</style>",
        "<!-- x -->",
        "<![CDATA[x]]>",
        "<g>",
        "<animate/>",
        '<image href="data:text/html,x"/>',
        '<h:script xmlns:h="http://www.w3.org/1999/xhtml"/>',
    ):
        with pytest.raises(ValueError, match=r"is no|holds|refers"):
            checked_svg(SVG.format(inside))
    for text in HOSTILE:
        with pytest.raises(ValueError, match="is no"):
            checked_svg(text)


# ---- TOML ----


def test_toml_reads_back_what_was_written() -> None:
    head = dict(zip(HOSTILE, reversed(HOSTILE), strict=True))
    runs = [{"file": text, "exclude": [{"reason": text, "from_s": 1e-05}]} for text in HOSTILE]
    assert tomllib.loads(dataset_toml(head, {}, runs)) == head | {"run": runs}
    for text in HOSTILE:
        tables = {text: {text: [text, 1, 1.5, True]}} if text != "run" else {}
        assert tomllib.loads(dataset_toml({"a": 1}, tables, [])) == {"a": 1, **tables}
        assert tomllib.loads(f"# {toml_comment(text)}\n{toml_key(text)} = {toml_value(text)}") == {text: text}
    assert tomllib.loads("a = " + toml_value("\ud800")) == {"a": "<U+D800>"}


def test_the_scenario_of_a_diagnosis_reads_back() -> None:
    found = checked_result(_DIAGNOSIS, Diagnosed, "diagnose.json")
    slope = Estimate(**_INTERVAL)
    for text in HOSTILE:
        cause = found.physical[0].model_copy(update={"channel": text, "parameters": {text: slope}})
        written = extended_scenario(found.model_copy(update={"serial": text, "causes": (cause,)}))
        assert written is not None
        content = tomllib.loads(written)
        assert content["channel"][0]["name"] == content["cause"][0]["channel"] == text
        assert content["title"].endswith(text) and set(content) == {"extends", "title", "noise", "channel", "cause"}


_FREE = """
schema = 1
serial = "s"
description = {0}
{1} = 1
[meta]
{1} = {0}
[[run]]
file = "a.csv"
environment = {0}
exclude = [{{reason = {0}, from_s = 1.0, to_s = 2.0}}]
{1} = 1
"""
_BOUND = """
schema = 1
serial = {0}
earth_rate = {0}
applied_table = {0}
columns = {{time = {0}, temperature = {0}, rate = {0}}}
[noise]
{1} = 1.0
[[run]]
file = "a.csv"
role = {0}
started = {0}
power_on_s = {0}
[[run]]
file = {0}
"""


def test_a_description_is_read_or_refused_in_words(tmp_path: Path) -> None:
    """Every field of dataset.toml that holds a text, and keys that it does not have."""
    path = tmp_path / "dataset.toml"
    for text in HOSTILE:
        for form in (_FREE, _BOUND):
            path.write_text(form.format(toml_value(text), toml_key(text)), "utf-8")
            problems = Problems(collect=True)
            parse_description(path, problems)
            for problem in problems.found:
                assert not re.search(r"[\x00-\x08\x0b-\x1f\x7f]", terminal_text(str(problem)))


def test_columns_of_a_recording_are_reported_as_they_are(tmp_path: Path, model_dict: dict[str, Any]) -> None:
    """Names of columns that one run of several has."""
    names = [text for text in map(str.strip, HOSTILE) if text.isprintable() and '"' not in text]
    names = [name for name in dict.fromkeys(names) if 1 <= len(name) <= 64]
    header = ",".join(["time_s", "temperature_c", "rate_dph", *(f'"{n}"' for n in names)])
    rows = [f"{10 * k},{20 + k / 10},0.001" for k in range(60)]
    (tmp_path / "a.csv").write_text("\n".join([header, *(r + ",1.0" * len(names) for r in rows)]) + "\n", "utf-8")
    (tmp_path / "b.csv").write_text("\n".join(["time_s,temperature_c,rate_dph", *rows]) + "\n", "utf-8")
    description = 'schema = 1\nserial = "s"\n[[run]]\nfile = "a.csv"\n[[run]]\nfile = "b.csv"\n'
    (tmp_path / "dataset.toml").write_text(description)
    dataset = load(tmp_path)
    assert len(dataset.warnings) == len(names) > 100
    model = Model.from_dict(model_dict | {"meta": {"warnings": list(dataset.warnings)}})
    texts = emit_texts(model, quantise_all(model, ["f32"]))
    for name, content in texts.items():
        (tmp_path / name).write_bytes(content)
    assert checked_sources(tmp_path, tmp_path, table_files(tmp_path, model, ["f32"])) == tmp_path


# ---- file names and terminals ----


def test_names_of_files_stay_in_their_folder_and_differ(tmp_path: Path) -> None:
    stems = [file_stem(text) for text in HOSTILE]
    assert len(set(stems)) == len(HOSTILE)
    for stem in stems:
        assert "/" not in stem and not stem.startswith((".", "-")) and len(stem.encode()) <= 200
        (tmp_path / (stem + "@123.5.csv")).write_text("")
    assert file_stem("run-01") == "run-01" and file_stem("Lauf ä (1)") != "Lauf ä (1)"
    assert file_stem("\udcff").isprintable()


def test_terminals_show_every_text_and_obey_none(result: dict[str, Any], monkeypatch: pytest.MonkeyPatch) -> None:
    stream = io.StringIO()
    console = type(output.OUT)(file=stream, force_terminal=True, color_system=None, width=10**4)
    monkeypatch.setattr(output, "OUT", console)
    for text in HOSTILE:
        output.tell(text)
    assert stream.getvalue().count("\n") == len(HOSTILE), "each is reported in one line"
    evaluation = result["evaluation"]
    runs = tuple(evaluation.runs[0].model_copy(update={"environment": t, "file": t}) for t in HOSTILE[:400])
    console.print(evaluation_table(evaluation.model_copy(update={"runs": runs, "serial": "[/x] " + "".join(HOSTILE)})))
    ran = VerifiedTarget(name="host", numeric="f32", status="fail", error="text", mismatches=1, vectors=2)
    named = [ran.model_copy(update={"name": text}) for text in HOSTILE]
    console.print(verify_table(result["verification"].model_copy(update={"targets": named})))
    said = re.sub(r"\x1b\[\d*(;\d+)*m", "", stream.getvalue())  # rich's own, bold and plain
    assert not re.search(r"[\x00-\x08\x0b-\x1f\x7f-\x9f\u200b\u202e]", said)
    for text in ("[/bold]", "[red]", ":smile:", "<U+001B>[2J", "<U+202E>", "[link=http://x]"):
        assert said.count(text) > 3


def test_a_refusal_is_one_line_whatever_the_name(tmp_path: Path, gyrotc: Command) -> None:
    """Before: a line break in a name began a second message, in which the name could say what it liked."""
    folder = tmp_path / "d\ngyrotc: all is well"
    folder.mkdir()
    (folder / "a\nb.csv").write_text("time_s,temperature_c\n1,2\n")
    for command in (
        ("check", folder),
        ("build", folder, "--out", tmp_path / "o\n1"),
        ("report", folder),
        ("fleet", folder / "a\nb.csv", "--out", tmp_path / "o"),
    ):
        done = gyrotc(*command)
        assert done.returncode == 2 and done.stderr.count("\n") == (0 if command[0] == "check" else 1)
        assert "<U+000A>" in done.stdout + done.stderr
        assert "\ngyrotc: all" not in done.stdout + done.stderr


@pytest.mark.parametrize("text", ["[red]a[/bold].csv", ":smile:", "a\x1b[2J.csv", "a\u202eb.csv", "[/]" * 20])
def test_a_line_of_progress_shows_a_name_and_obeys_none(text: str, monkeypatch: pytest.MonkeyPatch) -> None:
    stream = io.StringIO()
    monkeypatch.setenv("TERM", "xterm")  # one that is dumb is shown no progress
    console = type(output.ERR)(file=stream, force_terminal=True, color_system=None, width=10**4)
    monkeypatch.setattr(progress, "ERR", console)
    with progress.progress() as say:
        say(f"replaying {text}")
    assert f"replaying {terminal_text(text)}" in stream.getvalue()


# ---- one place ----

PACKAGE = Path(report.__file__).parents[1]
_ELSEWHERE = re.compile(r"jinja2\.Environment\(|\bMarkup\(|shell=True|os\.system|os\.popen|from_markup|autoescape")


def test_nothing_else_builds_such_text() -> None:
    """Templates come from the two environments of texts; none lets text through unescaped; no shell is given text."""
    for path in PACKAGE.rglob("*.py"):
        if path.name != "texts.py":
            assert not _ELSEWHERE.search(path.read_text("utf-8")), path
    assert _ELSEWHERE.search((PACKAGE / "common" / "texts.py").read_text("utf-8"))
    for path in PACKAGE.rglob("*.j2"):
        assert not re.search(r"\|\s*safe|autoescape|\|\s*attr", path.read_text("utf-8")), path
