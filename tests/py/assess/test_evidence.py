"""Copies of runs and faults of timing, holding and pairing are named; of clean sets nothing is said."""

from __future__ import annotations

import pytest

from tests.evidence.run import ABOUT, KINDS, found, tasks

NAMED = ABOUT | {"refused"}


@pytest.mark.parametrize("number", range(2))
def test_nothing_is_said_of_a_clean_set(number: int) -> None:
    assert not found("clean", "clean", 2, number) & NAMED


@pytest.mark.parametrize("number", range(2))  # a training run, and the exam
@pytest.mark.parametrize("way", KINDS["copies"])
def test_a_run_exported_again_is_named(way: str, number: int) -> None:
    assert found("copies", way, 2, number) & NAMED


@pytest.mark.parametrize("way", KINDS["faults"])
def test_a_fault_of_one_run_is_named(way: str) -> None:
    """Before: held rates, a late temperature and a run turned over built at up to 2.78 times the floor in silence."""
    assert found("faults", way, 2, 0) & NAMED


@pytest.mark.parametrize("way", ["decimals", "shifted"])  # of those sampled anew one in four is missed
def test_a_run_of_another_gyro_of_the_fleet_is_named(way: str) -> None:
    assert found("fleets", way, 2, 0) == {"copy_of_other"}


@pytest.mark.slow
def test_a_tenth_of_the_campaign_keeps_to_its_shares() -> None:
    """`make evidence` draws 500 clean sets, and 200 of each kind that is none."""
    print("seed 3")
    counts = {"clean": 50, "copies": 20, "faults": 20, "fleets": 20}
    named = dict.fromkeys(counts, 0)
    for kind, way, seed, number in tasks(counts, 3):
        named[kind] += bool(found(kind, way, seed, number) & NAMED)
    assert named["clean"] <= 1 and all(named[kind] >= 19 for kind in counts if kind != "clean"), named
