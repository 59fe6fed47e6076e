"""Copies of runs and faults of timing, holding and pairing are named; of clean sets nothing is said."""

from __future__ import annotations

import pytest

from tests.evidence.run import ABOUT, KINDS, found

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


@pytest.mark.parametrize("way", KINDS["fleets"][:2])
def test_a_run_of_another_gyro_of_the_fleet_is_named(way: str) -> None:
    assert found("fleets", way, 2, 0) == {"copy_of_other"}
