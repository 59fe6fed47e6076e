"""Faults planted in the generator (`make mutants`): a few of them here, and that all of them can be planted."""

from __future__ import annotations

import sys
from collections import Counter
from pathlib import Path

import pytest
from results import recorded

ROOT = Path(__file__).resolve().parents[3]
sys.path.insert(0, str(ROOT))

from tests.mutants.run import MODELS, Fault, House, faults, tried  # noqa: E402

pytestmark = pytest.mark.slow

FAULTS = faults()


def test_there_are_enough_and_no_name_twice() -> None:
    assert len(FAULTS) >= 20
    assert max(Counter(fault.name for fault in FAULTS).values()) == 1
    assert len({fault.file for fault in FAULTS}) >= 10
    assert all((ROOT / path).is_file() for path in MODELS.values())


@pytest.mark.parametrize("fault", FAULTS, ids=[fault.name for fault in FAULTS])
def test_what_it_changes_stands_there_once(fault: Fault) -> None:
    assert (fault.model in MODELS) != bool(fault.tests)
    assert all((ROOT / "tests" / "py" / test.partition("::")[0]).is_file() for test in fault.tests)
    assert fault.old != fault.new
    assert (ROOT / "gen" / "gyrotc" / fault.file).read_text("utf-8").count(fault.old) == 1


def test_each_way_of_seeing_one_sees_one() -> None:
    """A fault of the tables, one of the answers; the generator as it is passes both before."""
    found = {
        r["name"]: r["seen_by"] for r in tried(["width multiplied", "result rounded instead of cut off"])
    }
    assert found == {"width multiplied": "check_table", "result rounded instead of cut off": "verify"}


def test_a_fault_that_changes_nothing_is_seen_by_nobody(tmp_path: Path) -> None:
    """The campaign can fail: what is no fault must not count as seen."""
    none = Fault("none", "tables/f32.py", "_GAIN / width", "_GAIN / (width * 1.0)", "plain")
    assert House(tmp_path).objection("plain", none)["seen_by"] is None


def test_the_last_campaign_tried_all_of_them() -> None:
    result = recorded(ROOT / "docs", "mutants")
    assert [m["name"] for m in result["mutants"]] == [fault.name for fault in FAULTS]
    assert all(m["seen_by"] or m.get("survives") for m in result["mutants"])
    seen = Counter(m["seen_by"] is not None for m in result["mutants"])
    assert seen[True] >= 0.95 * seen.total()
