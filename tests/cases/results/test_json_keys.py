"""Results are typed: every key that the interface names stands in the real ones, and each is read back as written."""

from __future__ import annotations

import importlib
import json
import pkgutil
import re
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import pytest
from conftest import Command
from gyrotc import results
from gyrotc.cli.main import application
from gyrotc.cli.schema import kinds, tables
from gyrotc.model import load_model
from gyrotc.results import (
    At,
    FleetEntry,
    HeldLimits,
    Limit,
    MapDifference,
    Numbered,
    checked_result,
)
from pydantic import ValidationError
from pydantic_core import PydanticUndefined
from recordings import columns, described, write_csv

HEAD = {"schema": "", "gyrotc_version": "", "serial": "", "axis": None}
STATISTICS = {"mean_dph": 0.0, "std_dph": 0.0, "rms_dph": 0.0, "max_abs_dph": 0.0}
AFTER = STATISTICS | {"rms_30min_dph": 0.0, "angle_1h_arcsec": 0.0, "first_10min_rms_dph": 0.0}
POOLED = {
    "before": STATISTICS,
    "constant": STATISTICS,
    "after": STATISTICS,
    "improvement": 0.0,
    "improvement_about_zero": 0.0,
}
FINDING = {"id": "", "text": "", "evidence": {}}

MODEL = {
    "schema": "", "serial": "", "axis": None, "method": "", "block_s": 0.0, "slope_blocks": 0,
    "scale": {"temperature_c": [0.0], "slope_c_per_min": 0.0}, "envelope": {}, "coverage": {},
    "networks": [{"w0": 0.0, "linear": [0.0], "centers": [[0.0]], "widths": [[0.0]], "weights": [0.0], "region": None}],
    "terms": [], "noise_floor_dph": 0.0, "noise_floor_source": "", "uncertainty_dph": {}, "max_rate_c_per_min": 0.0,
    "data": [{"file": "", "sha256": "", "span": None, "role": ""}], "seed": 0, "meta": {},
}  # fmt: skip
EVALUATE = HEAD | {
    "numeric": "", "block_s": 0.0, "average_s": 0.0, "noise_floor_dph": 0.0, "noise_floor_source": "", "mismatches": 0,
    "constant_dph": 0.0, "requirements": [{"id": "", "verdict": "", "text": ""}],
    "runs": [{"file": "", "role": "", "samples": 0, "before": STATISTICS, "constant": AFTER, "after": AFTER}],
    "train": POOLED, "exam": POOLED, "findings": [],
    "model": {
        "method": "", "centers": 0, "table_bytes": 0, "rom_bytes": 0, "ram_bytes": 0, "sum_abs_weights_dph": 0.0,
    },
}  # fmt: skip
VERIFY = HEAD | {
    "passed": 0, "failed": 0, "missing": 0,
    "targets": [{"name": "", "status": "", "numeric": ""}],
    "error_bound_dph": 0.0, "worst_error_dph": {"value": 0.0, "inputs_visited": 0},
}  # fmt: skip
PASSED = {
    "compiler": "", "flags": "", "vectors": 0, "mismatches": 0, "code_bytes": 0, "ram_bytes": 0,
}  # fmt: skip
COMPARE = HEAD | {
    "methods": [{
        "id": "", "exam_rms_dph": 0.0, "centers": 0, "parameter_bytes": 0, "train_s": 0.0,
        "groups": [{
            "environment": "", "before_rms_dph": 0.0, "before_std_dph": 0.0, "after_rms_dph": 0.0,
            "after_std_dph": 0.0, "improvement": 0.0, "improvement_about_zero": 0.0,
        }],
    }],
}  # fmt: skip
DIAGNOSE = HEAD | {
    "verdict": "", "block_s": 0.0, "average_s": 0.0, "noise_floor_dph": 0.0,
    "discrepancies": [{
        "statistic": "", "measured": 0.0, "simulated_mean": 0.0, "simulated_low": 0.0, "simulated_high": 0.0,
        "p_value": 0.0,
    }],
    "causes": [], "baseline": {"exam_rms_dph": 0.0, "centers": 0}, "extended": None,
    "considered": [{"id": "", "family": ""}],
}  # fmt: skip


def absent(promised: Any, real: Any, where: str = "") -> list[str]:
    """Promised keys that are not there, and values of another kind (null is of any kind)."""
    if isinstance(promised, Mapping):
        if not isinstance(real, Mapping):
            return [] if real is None and where else [where]
        return [
            text
            for key, value in promised.items()
            for text in (absent(value, real[key], f"{where}.{key}") if key in real else [f"{where}.{key}"])
        ]
    if isinstance(promised, list):
        if not isinstance(real, list):
            return [where]
        return [text for item in real for text in absent(promised[0], item, f"{where}[]")] if promised else []
    numbers = (int, float)
    same = isinstance(real, numbers) if isinstance(promised, numbers) else isinstance(real, type(promised))
    return [] if real is None or promised is None or same else [where]


def read(path: Path) -> Any:
    return json.loads(path.read_text())


def test_the_search_finds_what_is_absent() -> None:
    assert absent({"a": [{"b": 1}], "c": ""}, {"a": [{"b": 2}, {}], "c": 3}) == [".a[].b", ".c"]
    assert absent({"a": {"b": 1}}, {"a": None}) == []


@pytest.mark.parametrize(
    ("file", "promised"), [("model", MODEL), ("training", HEAD), ("evaluate", EVALUATE), ("verify", VERIFY)]
)
def test_what_build_leaves(file: str, promised: Any, demo: Path) -> None:
    result = read(demo / "result" / f"{file}.json")
    assert absent(promised, result) == []
    assert result["schema"] == {"training": "gyrotc.fit/1"}.get(file, f"gyrotc.{file}/1")


def test_no_figure_of_an_evaluation_is_left_open(demo: Path) -> None:
    result = read(demo / "result" / "evaluate.json")
    assert all(result["model"][name] for name in EVALUATE["model"])  # type: ignore[attr-defined]
    assert all(run["after"][name] is not None for run in result["runs"] for name in AFTER)


def test_rom_and_ram_are_those_of_the_linked_program(demo: Path) -> None:
    """Code and constants are more than the table alone; the state holds the slope's window."""
    sizes = read(demo / "result" / "evaluate.json")["model"]
    model = load_model(demo / "result" / "model.json")
    image = min(p.stat().st_size for p in (demo / "result" / "c").glob("*.bin"))
    assert image < sizes["rom_bytes"]
    assert 4 * model.slope_blocks < sizes["ram_bytes"] < 1024


def test_what_verify_says_of_a_target(demo: Path) -> None:
    targets = read(demo / "result" / "verify.json")["targets"]
    passed = [entry for entry in targets if entry["status"] == "pass"]
    assert passed and all(absent(PASSED, entry) == [] for entry in passed)
    metered = [entry for entry in passed if entry["name"] == "cortex-m4f"]
    costs = {"instructions": {"min": 0, "mean": 0.0, "max": 0}, "stack_bytes": 0}
    assert all(absent(costs, entry) == [] for entry in metered)


def test_check_fit_and_compare(tmp_path: Path, gyrotc: Command) -> None:
    described(tmp_path / "RLG-1")
    for k in (1, 2, 3):
        rows = columns(360, seed=k)
        write_csv(tmp_path / "RLG-1" / f"run-0{k}.csv", rows | {"rate_dph": rows["rate_dph"] - 20.0})
    (tmp_path / "RLG-1" / "dataset.toml").unlink()
    results = {}
    for command, option, place, file in (
        ("check", "--json", "check.json", "check.json"),
        ("fit", "--out", "fit", "fit/training.json"),
        ("compare", "--out", "compare", "compare/compare.json"),
    ):
        done = gyrotc(command, tmp_path / "RLG-1", option, tmp_path / place)
        assert done.returncode == 0, done.stderr
        results[command] = read(tmp_path / file)
    assert absent(HEAD | {"problems": [], "warnings": [], "runs": []}, results["check"]) == []
    assert absent(HEAD, results["fit"]) == []
    assert absent(COMPARE, results["compare"]) == []
    assert absent({"findings": [FINDING]}, results["fit"]) == []


def test_diagnose(tmp_path: Path, gyrotc: Command) -> None:
    """One run: what cannot be decided is said in the same form."""
    described(tmp_path / "RLG-1")
    rows = columns(360)
    write_csv(tmp_path / "RLG-1" / "run-01.csv", rows | {"rate_dph": rows["rate_dph"] - 20.0})
    done = gyrotc("diagnose", tmp_path / "RLG-1", "--out", tmp_path / "out")
    assert done.returncode == 0, done.stderr
    assert absent(DIAGNOSE, read(tmp_path / "out" / "diagnose.json")) == []


def test_every_command_has_an_example_in_its_help() -> None:
    for command in application().registered_commands:
        assert command.callback is not None
        name = command.name or command.callback.__name__
        assert f"Example: gyrotc {name}" in (command.callback.__doc__ or ""), name


LIMITS = HeldLimits(
    gyrotc_version="0.1.0", serial="A", axis=None, product="NAV", sha256="00", met=False, decision_rule="guard_band",
    limits=(
        Limit(limit="at_most.rom_bytes", measured=6292, bound=10.0, met=False, verdict="FAIL"),
        Limit(limit="covers.temperature_c", measured=(-40.0, 60.0), bound=(-10.0, 30.0), met=True, verdict="PASS"),
        Limit(limit="at_most.rms_dph", measured=None, bound=1.0, met=False, verdict="FAIL"),
    ),
)  # fmt: skip


def _all(kind: type[Numbered]) -> Iterator[type[Numbered]]:
    for one in kind.__subclasses__():
        yield one
        yield from _all(one)


def test_every_class_with_a_schema_has_a_name() -> None:
    """A class that names its schema is written to a file or printed: users ask for its form."""
    for module in pkgutil.iter_modules(results.__path__):
        importlib.import_module(f"gyrotc.results.{module.name}")
    named = {
        one
        for one in _all(Numbered)
        if one.__module__.startswith("gyrotc.") and not one.__name__.startswith("_")
        and one.model_fields["schema_"].default is not PydanticUndefined
    }  # fmt: skip
    assert len(named) > 15 and named <= set(kinds().values())


@pytest.mark.parametrize("name", sorted(set(kinds()) - {"model"}))
def test_every_field_says_what_it_means(name: str) -> None:
    rows = [line for line in tables(kinds()[name]).splitlines() if line.startswith("| `")]
    assert rows and all(not row.endswith("|  |") for row in rows if "`schema`" not in row)


def test_a_result_is_read_back_as_it_was_written() -> None:
    content = json.loads(json.dumps(LIMITS.content()))
    assert list(content) == [
        "schema", "gyrotc_version", "serial", "axis", "product", "sha256", "met", "limits", "decision_rule",
    ]  # fmt: skip
    again = checked_result(content, HeldLimits, "limits.json")
    assert again == LIMITS and json.dumps(again.content()) == json.dumps(content)
    assert [repr(limit.measured) for limit in again.limits] == ["6292", "(-40.0, 60.0)", "None"]


def test_unknown_fields_are_let_through() -> None:
    content = json.loads(json.dumps(LIMITS.content()))
    assert checked_result(content | {"later": 1}, HeldLimits, "limits.json") == LIMITS


def test_an_entry_of_a_fleet_tells_the_summary_what_it_may_know() -> None:
    entry = FleetEntry(
        name="A", dataset="d", axis=None, status="done", serial="1", bias_dph=None, findings=("large_weights",),
        key="0" * 64, sketch="0" * 16,
    )  # fmt: skip
    assert entry.unit().content() == {
        "name": "A", "dataset": "d", "axis": None, "status": "done", "serial": "1", "bias_dph": None,
        "findings": ["large_weights"],
    }  # fmt: skip
    assert entry.as_kept().kept and entry.as_kept() != entry and entry.as_kept().content() == entry.content()


def test_a_result_that_is_no_number_cannot_be_made() -> None:
    with pytest.raises(ValidationError, match="rms_dph"):
        MapDifference(
            rms_dph=float("nan"), mean_dph=0.0, max_abs_dph=0.0,
            at=At(temperature_c=0.0, slope_c_per_min=0.0), rms_over_floor=None,
        )  # fmt: skip


def test_the_command_prints_a_schema_or_all(gyrotc: Command) -> None:
    done = gyrotc("schema", "limits")
    assert done.returncode == 0 and json.loads(done.stdout) == HeldLimits.model_json_schema()
    assert json.loads(gyrotc("schema").stdout) == {name: json.loads(gyrotc("schema", name).stdout) for name in kinds()}
    done = gyrotc("schema", "limit")
    assert done.returncode == 2 and "changes, check" in done.stderr


def test_the_command_prints_tables_of_one_or_all(gyrotc: Command) -> None:
    done = gyrotc("schema", "limits", "--table")
    assert done.returncode == 0 and done.stdout == tables(HeldLimits)
    assert "| `met` | true or false | true if all limits are met and" in done.stdout and "\n`Limit`: " in done.stdout
    whole = gyrotc("schema", "--table").stdout
    assert re.findall(r"^## (.+)$", whole, re.MULTILINE) == list(kinds()) and done.stdout in whole
