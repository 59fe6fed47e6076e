"""Results are typed: what is printed about their forms is made from the classes, and each is read back as written."""

from __future__ import annotations

import importlib
import json
import pkgutil
import re
from collections.abc import Iterator

import pytest
from conftest import Command
from gyrotc import results
from gyrotc.cli.schemas import KINDS
from gyrotc.common.errors import InputError
from gyrotc.results.base import Numbered, checked_result
from gyrotc.results.describe import tables
from gyrotc.results.evaluation import Apart, At
from gyrotc.results.fleet import FleetEntry
from gyrotc.results.folder import Marker
from gyrotc.results.release import HeldLimits, Limit
from gyrotc.store.marker import marker_of, marker_text
from pydantic import ValidationError
from pydantic_core import PydanticUndefined

LIMITS = HeldLimits(
    gyrotc_version="0.1.0", serial="A", axis=None, product="NAV", sha256="00", met=False,
    limits=(
        Limit(limit="at_most.rom_bytes", measured=6292, bound=10.0, met=False),
        Limit(limit="covers.temperature_c", measured=(-40.0, 60.0), bound=(-10.0, 30.0), met=True),
        Limit(limit="at_most.rms_dph", measured=None, bound=1.0, met=False),
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
    assert len(named) > 20 and named <= set(KINDS.values())


@pytest.mark.parametrize("name", sorted(set(KINDS) - {"model"}))
def test_every_field_says_what_it_means(name: str) -> None:
    rows = [line for line in tables(KINDS[name]).splitlines() if line.startswith("| `")]
    assert rows and all(not row.endswith("|  |") for row in rows if "`schema`" not in row)


def test_a_result_is_read_back_as_it_was_written() -> None:
    content = json.loads(json.dumps(LIMITS.content()))
    assert list(content) == [
        "schema", "gyrotc_version", "serial", "axis", "product", "sha256", "met", "limits",
    ]  # fmt: skip
    again = checked_result(content, HeldLimits, "limits.json")
    assert again == LIMITS and json.dumps(again.content()) == json.dumps(content)
    assert [repr(limit.measured) for limit in again.limits] == ["6292", "(-40.0, 60.0)", "None"]


def test_unknown_fields_are_let_through_and_wrong_ones_refused_by_name() -> None:
    content = json.loads(json.dumps(LIMITS.content()))
    assert checked_result(content | {"later": 1}, HeldLimits, "limits.json") == LIMITS
    for change, told in (
        ({"met": "yes"}, "limits.json, field met: 'yes'"),
        ({"axis": "w"}, "limits.json, field axis: 'w'"),
        ({"limits": [{}]}, "limits.json, field limits.0.limit: is missing"),
        ({"schema": "gyrotc.limits/2"}, "limits.json, field schema: 'gyrotc.limits/2'"),
    ):
        with pytest.raises(InputError) as caught:
            checked_result(content | change, HeldLimits, "limits.json")
        assert told in str(caught.value)


def test_an_entry_of_a_fleet_tells_the_summary_what_it_may_know() -> None:
    entry = FleetEntry(
        name="A", dataset="d", axis=None, status="done", serial="1", bias_dph=None, findings=("large_weights",),
        key="0" * 64, sketch="0" * 16,
    )  # fmt: skip
    assert entry.told().content() == {
        "name": "A", "dataset": "d", "axis": None, "status": "done", "serial": "1", "bias_dph": None,
        "findings": ["large_weights"],
    }  # fmt: skip
    assert entry.as_kept().kept and entry.as_kept() != entry and entry.as_kept().content() == entry.content()


def test_a_marker_is_written_by_name_and_says_no_more_than_it_has_to() -> None:
    marker = marker_of("result", "build").but(files={"b": "1", "a": "2"}, parts=("z", "y"))
    assert list(json.loads(marker_text(marker))["files"]) == ["a", "b"]
    assert json.loads(marker_text(marker))["parts"] == ["y", "z"]
    assert not {"pending", "unfinished"} & set(
        json.loads(marker_text(marker.but(pending={}, unfinished=False)))
    )
    again = checked_result(json.loads(marker_text(marker.but(unfinished=True))), Marker, "marker")
    assert again.unfinished and again.known("a") == {"2"} and again.entries() == {"a", "b", "y", "z"}


def test_a_result_that_is_no_number_cannot_be_made() -> None:
    with pytest.raises(ValidationError, match="rms_dph"):
        Apart(
            rms_dph=float("nan"), mean_dph=0.0, max_abs_dph=0.0,
            at=At(temperature_c=0.0, slope_c_per_min=0.0), rms_over_floor=None,
        )  # fmt: skip


def test_the_command_prints_a_schema_or_all(gyrotc: Command) -> None:
    done = gyrotc("schema", "limits")
    assert done.returncode == 0 and json.loads(done.stdout) == HeldLimits.model_json_schema()
    assert json.loads(gyrotc("schema").stdout) == {
        name: json.loads(gyrotc("schema", name).stdout) for name in KINDS
    }
    done = gyrotc("schema", "limit")
    assert done.returncode == 2 and "changes, check" in done.stderr


def test_the_command_prints_tables_of_one_or_all(gyrotc: Command) -> None:
    done = gyrotc("schema", "limits", "--table")
    assert done.returncode == 0 and done.stdout == tables(HeldLimits)
    assert "| `met` | true or false | whether all are met;" in done.stdout and "\n`Limit`: " in done.stdout
    whole = gyrotc("schema", "--table").stdout
    assert re.findall(r"^## (.+)$", whole, re.MULTILINE) == list(KINDS) and done.stdout in whole
