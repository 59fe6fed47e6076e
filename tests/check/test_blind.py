"""Hidden effects: fresh recordings of an independent generator, diagnosed by a process that is not reported.

The seed of the draws is new in every run and printed; `python -m tests.blind --world own --seed N --records 40
--per-campaign 21 --weakest 1.7` makes the same recordings again. `make blind` measures the figures; here only what is
far from them fails: with the rates below, which are above the measured ones, a test fails by chance with a probability
below 1e-4.
"""

from __future__ import annotations

import secrets
from pathlib import Path

import pytest
from scipy.stats import binom

ROOT = Path(__file__).resolve().parents[2]

from tests.blind.grade import alarmed, family_right, wrong_family  # noqa: E402
from tests.blind.run import Plan, run  # noqa: E402
from tests.blind.table import text  # noqa: E402

RECORDS = 40
CHANCE = 2e-5  # of one of five checks


def most(total: int, rate: float) -> int:
    """How many of `total` may fail when each fails with `rate`."""
    return next(c for c in range(total + 1) if binom.sf(c, total, rate) < CHANCE)


@pytest.fixture(scope="module")
def rows(tmp_path_factory: pytest.TempPathFactory) -> list[dict]:
    seed = secrets.randbits(32)
    print(f"seed {seed}")
    found = run(Plan(seed, RECORDS, 21, 1.7), tmp_path_factory.mktemp("blind"))
    print(text(found))
    return found


def judged(rows: list[dict], bad: list[dict], rate: float) -> None:
    """`bad` of `rows` are no more than the rate allows."""
    reported = [(r["number"], r["truth"], r["k"], r["stress"], r["verdict"], r["named"]) for r in bad]
    assert len(bad) <= most(len(rows), rate), reported


def test_no_diagnosis_breaks_down(rows: list[dict]) -> None:
    assert not [r["error"] for r in rows if r["verdict"] == "error"]


def test_clean_recordings_and_noise_get_no_cause(rows: list[dict]) -> None:
    clean = [r for r in rows if not r["truth"]]
    judged(clean, [r for r in clean if (alarmed if r["stratum"] == "clean" else wrong_family)(r)], 0.03)


def test_hidden_causes_are_found_with_the_right_family(rows: list[dict]) -> None:
    alone = [r for r in rows if r["stratum"] == "one"]
    judged(alone, [r for r in alone if not family_right(r)], 0.10)


def test_a_hidden_cause_is_not_named_after_another_family(rows: list[dict]) -> None:
    alone = [r for r in rows if r["stratum"] == "one"]
    judged(alone, [r for r in alone if wrong_family(r)], 0.04)


def test_two_hidden_causes_do_not_become_three(rows: list[dict]) -> None:
    two = [r for r in rows if r["stratum"] == "two"]
    judged(two, [r for r in two if len(r["named"]) > 2], 0.02)


def test_names_that_are_not_hidden_are_rare_in_all_recordings(rows: list[dict]) -> None:
    judged(rows, [r for r in rows if wrong_family(r)], 0.06)
