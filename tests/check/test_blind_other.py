"""The second blind world: its heat, its seeds, and a slice that is diagnosed."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from tests.blind.other import heat
from tests.blind.other.grade import table
from tests.blind.other.record import IMITATED, draw_recording
from tests.blind.other.run import orders, run

SEED, RECORDS = 20261122, 3  # always the same: what is drawn anew is for `make blind`


def test_heat_comes_to_rest_at_the_air_and_keeps_its_balance() -> None:
    """Without a discharge all volumes end at the air; with it, the case is above by power / to_air."""
    rng = np.random.default_rng(3)
    body = heat.draw_body(rng)
    still = heat.Body(**{**vars(body), "ripple_c": 1e-6})
    command = np.full(12_000, 20.0)
    command[2000:] = 40.0
    dark = heat.run_heat(still, command, 0.0, np.random.default_rng(1), lit=False)
    lit = heat.run_heat(still, command, 0.0, np.random.default_rng(1))
    for values in (dark.sensor, dark.deep, dark.case):
        assert values[-1] == pytest.approx(dark.air[-500:].mean(), abs=0.1)
    above = lit.case[-1000:].mean() - lit.air[-1000:].mean()
    assert above == pytest.approx(body.discharge / body.to_air, rel=0.02)
    assert lit.deep[-1] > lit.sensor[-1] > lit.case[-1]
    half = [int(np.argmax(x[2000:] > 30.0)) for x in (dark.case, dark.sensor, dark.mirror)]
    assert half == sorted(half), "the mirror comes last"


def test_a_seed_gives_the_same_recording_and_foreign_ones_are_foreign() -> None:
    one, again = (draw_recording(11, 4, "foreign", "", hours=2.0) for _ in range(2))
    for a, b in zip(one.tables, again.tables, strict=True):
        np.testing.assert_array_equal(a, b)
    assert one.truth.kind == again.truth.kind and one.truth.imitated <= IMITATED
    wanted = orders(100)
    assert [sum(s == name for s, _ in wanted) for name in ("clean", "foreign", "one")] == [45, 30, 25]


def test_a_slice_of_the_world_is_diagnosed(tmp_path: Path) -> None:
    rows = run(SEED, RECORDS, tmp_path, hours=2.0)
    assert len(rows) == RECORDS and table(rows)
    assert not [row["error"] for row in rows if row["verdict"] == "error"]
