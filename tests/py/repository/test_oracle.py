"""The comparison of results with a reference (`make oracle`): a change is named by its path, and nothing else is."""

from __future__ import annotations

import copy
import json
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

sys.path.insert(0, str(Path(__file__).resolve().parents[3]))

from tests.oracle.__main__ import REFERENCE
from tests.oracle.compare import Reference, differences
from tests.oracle.normalise import content_of
from tests.oracle.sets import SETS

RESULT: dict[str, Any] = {
    "schema": "gyrotc.x/1",
    "versions": {"gcc": "12"},
    "rms_dph": 7.1e-4,
    "runs": [{"file": "a.csv", "rows": 10}, {"file": "b.csv", "rows": 11, "span": None}],
    "cells": [[1, 2], [3, 4]],
}
CHANGES: dict[str, Callable[[dict[str, Any]], object]] = {
    "document.rms_dph": lambda r: r.update(rms_dph=7.1000000000000013e-4),
    "document.runs[].rows": lambda r: r["runs"][1].update(rows=12),
    "document.runs[].span": lambda r: r["runs"][1].pop("span"),
    "document.cells": lambda r: r["cells"][1].reverse(),
    "document.new": lambda r: r.update(new=1),
}


def content(path: Path, result: dict[str, Any]) -> Any:
    path.write_text(json.dumps(result), "utf-8")
    return content_of(path)


@pytest.mark.parametrize("path", CHANGES)
def test_the_path_of_a_change_is_named(path: str, tmp_path: Path) -> None:
    before = content(tmp_path / "x.json", RESULT)
    changed = copy.deepcopy(RESULT)
    CHANGES[path](changed)
    after = content(tmp_path / "x.json", changed)
    reference = Reference(tmp_path / "reference.json")
    reference.enter("set", {"step": {"x.json": before}})
    reference.write({})
    reference = Reference(tmp_path / "reference.json")
    part = reference.steps("set")["step"]["x.json"]
    assert not [*reference.differences(part, before)] and not [*differences(before, before)]
    told = [line.split(": ")[0] for line in reference.differences(part, after)]
    assert set(told) == {"sha256", path}
    assert len([*differences(before, after)]) >= 2


def test_what_depends_on_the_machine_is_left_out_and_the_order_of_keys_is_not(tmp_path: Path) -> None:
    before = content(tmp_path / "x.json", RESULT)
    assert content(tmp_path / "x.json", RESULT | {"versions": {"gcc": "13"}}) == before
    assert content(tmp_path / "x.json", dict(reversed(RESULT.items()))) != before


def test_the_tracked_reference_is_small_and_has_every_set() -> None:
    assert REFERENCE.stat().st_size < 300_000
    reference = Reference(REFERENCE)
    assert all(reference.steps(name) for name in SETS)
