"""Model files, limits, manifests, laboratory facts and results that are refused: file and field in one message."""

from __future__ import annotations

import copy
import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from conftest import run_gyrotc
from gyrotc.assess import load_limits
from gyrotc.common import InputError
from gyrotc.jobs import laboratory_facts
from gyrotc.results import HeldLimits, Verification, checked_result
from small_gyro import small_gyro, write_gyro


def refusal(act: Callable[[], object]) -> str:
    with pytest.raises(InputError) as caught:
        act()
    assert "\n" not in str(caught.value)
    return str(caught.value)


# ---- model.json: the field that is changed, its value; the field that is named ----

HYSTERESIS = {"width_c": 1.0, "amplitude_dph_per_c": 1e-4}
MANY: dict[str, Any] = {"w0": 0.0, "linear": [0.0, 0.0], "region": None, "weights": [0.0] * 513}
MANY |= {"centers": [[0.0, 0.0]] * 513, "widths": [[1.0, 1.0]] * 513}
MODELS: dict[str, tuple[str, Any]] = {
    "another schema": ("schema", "gyrotc.model/2"),
    "serial as a path": ("serial", "../../etc/passwd"),
    "serial too long": ("serial", "x" * 65),
    "serial as code": ("serial", "int main(void){}"),
    "axis": ("axis", "w"),
    "no block": ("block_s", 0.0),
    "text as a number": ("block_s", "10"),
    "too many blocks": ("slope_blocks", 21),
    "part of a block": ("slope_blocks", 2.5),
    "envelope the wrong way": ("envelope.temperature_c", [60.0, -40.0]),
    "envelope of one end": ("envelope.temperature_c", [-40.0]),
    "no network": ("networks", []),
    "more centers than a table holds": ("networks", [MANY]),
    "weight as text": ("networks.0.w0", "0.007"),
    "weight true": ("networks.0.w0", True),
    "weight missing": ("networks.0.weights", [0.001]),
    "center far away": ("networks.0.centers.0", [1e6, 0.0]),
    "no width": ("networks.0.widths.0", [0.0, 1.0]),
    "coverage of one row": ("coverage.rows", ["1111"]),
    "coverage of another digit": ("coverage.rows", ["1111", "10x1"]),
    "negative lag": ("terms", [{"id": "cavity_lag", "parameters": {"tau_s": -1.0}}]),
    "parameter of another term": ("terms", [{"id": "cavity_lag", "parameters": {"width_c": 1.0}}]),
    "unknown term": ("terms", [{"id": "made_up", "parameters": {}}]),
    "parameter missing": ("terms", [{"id": "hysteresis", "parameters": {"width_c": 1.0, "reference_c": 20.0}}]),
    "unknown parameter": ("terms", [{"id": "hysteresis", "parameters": HYSTERESIS | {"growth": 1e-6}}]),
    "hash too short": ("data.0.sha256", "abc"),
    "unknown field": ("unknown_field", 1),
    "checksum of another model": ("checksum", "0" * 64),
    "checksum no text": ("checksum", 7),
}
NO_MODELS = {
    "empty": ("", ("is empty",)),
    "text": ("not json", ("is not JSON",)),
    "list": ("[1, 2]", ("field schema",)),
    "cut": ("{", ("is not JSON",)),
    "NaN": ('{"schema": "gyrotc.model/1", "serial": NaN}', ("NaN",)),
    "infinite": ('{"schema": "gyrotc.model/1", "block_s": 1e999}', ("finite",)),
    "binary": ("\x00\x01", ("is not JSON",)),
    "deep": ("[" * 100_000, ("nested too deep",)),
    "large": (" " * (4 * 2**20 + 1), ("MiB; expected at most 4",)),
}


def with_value(content: dict[str, Any], path: str, value: Any) -> dict[str, Any]:
    changed = copy.deepcopy(content)
    *parents, last = path.split(".")
    node: Any = changed
    for part in parents:
        node = node[int(part)] if part.isdigit() else node[part]
    node[int(last) if isinstance(node, list) else last] = value
    return changed


@pytest.mark.parametrize("case", MODELS | NO_MODELS)
def test_a_wrong_model_is_refused_by_file_and_field(case: str, tmp_path: Path, model_dict: dict[str, Any]) -> None:
    file = tmp_path / "model.json"
    if case in MODELS:
        path, value = MODELS[case]
        file.write_text(json.dumps(with_value(model_dict, path, value)))
        parts: tuple[str, ...] = (f"field {path.split('.')[0]}",)
    else:
        text, parts = NO_MODELS[case]
        file.write_text(text)
    done = run_gyrotc("emit", file, "--out", tmp_path / "out")
    assert done.returncode == 2 and not (tmp_path / "out").exists()
    assert done.stderr.startswith(f"gyrotc: {file}") and done.stderr.count("\n") == 1, done.stderr
    assert all(part in done.stderr for part in parts), done.stderr


# ---- limits: text behind `schema = 1`, and what the message must hold ----

LIMITS = {
    "typing error": ("[at_most]\nrms_dhp = 1.0", "at_most.rms_dhp"),
    "text": ('[at_most]\nrms_dph = "low"', "at_most.rms_dph"),
    "not a number": ("[at_most]\nrms_dph = nan", "at_most.rms_dph"),
    "true": ("[at_most]\nrms_dph = true", "at_most.rms_dph"),
    "infinite": ("[at_most]\nrms_dph = inf", "at_most.rms_dph"),
    "one end": ("[covers]\ntemperature_c = [1]", "covers.temperature_c"),
    "the wrong way, out of range": ("[covers]\ntemperature_c = [300, -300]", "covers.temperature_c"),
    "the wrong way": ("[covers]\ntemperature_c = [30, -30]", "covers.temperature_c"),
    "end not a number": ("[covers]\nslope_c_per_min = [nan, 1.0]", "covers.slope_c_per_min.0"),
    "true as an end": ("[covers]\nslope_c_per_min = [false, true]", "covers.slope_c_per_min.0"),
    "unknown target": ('[needs]\ntargets = ["m4"]', "needs.targets"),
    "unknown finding": ('[needs]\nno_findings = ["outlier"]', "needs.no_findings"),
    "unknown arithmetic": ('[needs]\narithmetics = ["f64"]', "needs.arithmetics"),
    "unknown table": ("[at_mots]\nrms_dph = 1.0", "at_mots"),
    "hash given": ('sha256 = "x"', "sha256"),
    "schema missing": (None, "schema"),
}


@pytest.mark.parametrize("case", LIMITS)
def test_wrong_limits_are_refused_by_file_and_field(case: str, tmp_path: Path) -> None:
    text, field = LIMITS[case]
    file = tmp_path / "product.toml"
    file.write_text("[at_most]\nrms_dph = 1.0" if text is None else f"schema = 1\n{text}")
    assert f"product.toml, field {field}" in refusal(lambda: load_limits(file))


# ---- manifests of fleets ----

MANIFESTS = {
    "nothing": ("", "names no data set"),
    "schema missing": (None, "field schema"),
    "typing error": ('dataset = ["*"]', "field dataset"),
    "no match": ('datasets = ["x-*"]', "matches no folder"),
    "outside": ('datasets = ["../*"]', "below the manifest's folder"),
    "twice": ('datasets = ["d/*", "d/RLG-1"]', "both RLG-1"),
    "unknown axis": ('[[unit]]\ndataset = "d/RLG-1"\naxis = "w"', "field unit.0.axis"),
    "unknown option": ('datasets = ["d/*"]\n[options]\nblocks = 1', "field options.blocks"),
    "no limits file": ('datasets = ["d/*"]\nlimits = "no.toml"', "no.toml"),
    "NUL in a data set": ('[[unit]]\ndataset = "a\\u0000b"', "field unit.0.dataset"),
    "a pattern that is none": ('datasets = ["**a"]', "field datasets"),
    "an empty pattern": ('datasets = [""]', "field datasets"),
    "NUL in limits": ('limits = "\\u0000"', "field limits"),
    "broken": ("schema", "no TOML"),
}


@pytest.mark.parametrize("case", MANIFESTS)
def test_a_wrong_manifest_is_refused_by_file_and_field(case: str, tmp_path: Path) -> None:
    write_gyro(tmp_path / "d" / "RLG-1", small_gyro(1))
    text, reported = MANIFESTS[case]
    file = tmp_path / "fleet.toml"
    file.write_text('datasets = ["d/*"]' if text is None else f"schema = 1\n{text}")
    done = run_gyrotc("fleet", file, "--out", tmp_path / "out")
    assert done.returncode == 2 and not (tmp_path / "out").exists()
    assert reported in done.stderr and ".toml" in done.stderr and done.stderr.count("\n") == 1, done.stderr


# ---- facts of a laboratory ----

FACTS = {
    "typing error": ("labratory = 'x'", "labratory"),
    "country in full": ("country = 'Germany'", "country"),
    "schema missing": (None, "field schema"),
    "no date": ("calibrated_on = 'in March'", "calibrated_on"),
    "no day of the calendar": ("calibrated_on = '2026-13-45'", "calibrated_on"),
    "no year": ("issued = '0000-00-00'", "issued"),
    "a day of another form": ("calibrated_on = '01.03.2020'", "calibrated_on"),
    "a day to come": ("issued = 2999-01-01", "issued"),
    "issued before the calibration": ("calibrated_on = 2024-03-02\nissued = 2024-03-01", "issued"),
    "a table as a date": ("calibrated_on = { day = 2026-03-02 }", "calibrated_on"),
    "a list as a date": ("issued = [2026-03-02, 10:00:00]", "issued"),
    "an instrument": ("[[instrument]]\nname = 'Pt100'", "instrument"),
}


@pytest.mark.parametrize("case", FACTS)
def test_wrong_facts_are_refused_by_file_and_field(case: str, tmp_path: Path) -> None:
    text, field = FACTS[case]
    file = tmp_path / "facts.toml"
    file.write_text("laboratory = 'x'" if text is None else f"schema = 1\n{text}")
    message = refusal(lambda: laboratory_facts({}, file, None))
    assert "facts.toml" in message and field in message


# ---- results ----

VERIFIED = {
    "schema": "gyrotc.verify/1", "gyrotc_version": "0.1.0", "serial": "A", "axis": None, "passed": 1, "failed": 0,
    "missing": 0, "targets": [], "emitted": [], "errors": [], "model_hash": "00", "c_hash": "00",
    "error_bound_dph": 0.0, "worst_error_dph": {"value": 0.0, "inputs_visited": 0},
}  # fmt: skip
HELD = {
    "schema": "gyrotc.limits/1", "gyrotc_version": "0.1.0", "serial": "A", "axis": None, "product": "NAV",
    "sha256": "00", "met": True, "limits": [], "decision_rule": "guard_band",
}  # fmt: skip
RESULTS: dict[str, tuple[Any, Any, dict[str, Any], str]] = {
    "text as a count": (Verification, VERIFIED, {"passed": "1"}, "field passed"),
    "a number in a list of objects": (Verification, VERIFIED, {"targets": [3]}, "field targets.0"),
    "an object as a list": (Verification, VERIFIED, {"targets": {}}, "field targets"),
    "a negative count": (Verification, VERIFIED, {"failed": -1}, "field failed"),
    "no schema": (Verification, VERIFIED, {"schema": None}, "field schema"),
    "text as a truth": (HeldLimits, HELD, {"met": "yes"}, "field met"),
    "unknown axis": (HeldLimits, HELD, {"axis": "w"}, "field axis"),
    "a field that is missing": (HeldLimits, HELD, {"limits": [{}]}, "field limits.0.limit"),
    "another schema": (HeldLimits, HELD, {"schema": "gyrotc.limits/2"}, "field schema"),
}


@pytest.mark.parametrize("case", RESULTS)
def test_a_wrong_result_is_refused_by_file_and_field(case: str) -> None:
    kind, content, change, field = RESULTS[case]
    assert checked_result(content, kind, "r.json").content().items() >= content.items()
    assert f"r.json, {field}" in refusal(lambda: checked_result(content | change, kind, "r.json"))
