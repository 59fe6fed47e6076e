"""A recording that two serials have is named by its noise, however it was written; gyros of one programme are not."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from gyrotc.fleet.outliers import copies
from gyrotc.recordings.copies import noise_of, noise_signs
from gyrotc.results.fleet import FleetEntry
from numpy.typing import NDArray

Floats = NDArray[np.float64]
_ROWS = 4000
_TIME = 10.0 * np.arange(_ROWS)
WAYS: dict[str, Callable[[Floats, Floats], tuple[Floats, Floats]]] = {
    "as it is": lambda t, r: (t, r),
    "fewer decimals, clock + 5 s": lambda t, r: (t + 5.0, np.round(r, 1)),
    "a third of the noise again": lambda t, r: (t, r + 0.17 * np.random.default_rng(9).normal(size=len(r))),
    "other unit, offset": lambda t, r: (t, 7.5 + r / 3600.0),
    "turned over": lambda t, r: (t, -r),
    "means of four rows": lambda t, r: (t.reshape(-1, 4).mean(axis=1), r.reshape(-1, 4).mean(axis=1)),
    "interpolated": lambda t, r: (np.arange(3.0, t[-1], 7.3), np.interp(np.arange(3.0, t[-1], 7.3), t, r)),
    "its second half": lambda t, r: (t[len(t) // 2 :] - t[len(t) // 2], r[len(t) // 2 :]),
}


def _rates(rng: np.random.Generator) -> Floats:
    """Of one programme: ramps with corners, and a chamber that swings every four minutes."""
    corners = np.interp(_TIME, [0.0, 5e3, 1.5e4, 2e4, 3e4, 4e4], [0.0, 20.0, 20.0, -30.0, -30.0, 0.0])
    swings = 0.5 * np.sin(2.0 * np.pi * _TIME / 240.0)
    return np.asarray(rng.normal(1.0, 0.2) * (corners + swings) + rng.normal(0.0, 0.5, _ROWS))


def _entry(serial: str, *runs: tuple[Floats, Floats]) -> FleetEntry:
    noise = tuple(s for k, (t, r) in enumerate(runs) for s in noise_signs(f"run-{k}.csv", noise_of(t, r)))
    return FleetEntry(name=serial, axis=None, status="done", serial=serial, noise=noise)


@pytest.mark.parametrize("way", WAYS)
def test_one_run_of_another_gyro_is_named(way: str) -> None:
    """Before: only a copy that kept its rows was."""
    rng = np.random.default_rng(3)
    fleet = {f"S-{k}": [(_TIME, _rates(rng)) for _ in range(3)] for k in range(8)}
    fleet["S-6"][1] = WAYS[way](*fleet["S-2"][2])
    [found] = copies([_entry(serial, *runs) for serial, runs in fleet.items()])
    assert (found.name, found.other) == ("S-2", "S-6")
    assert found.likeness is not None and found.likeness > 0.6
    assert 0.1 < found.share < 0.5
    assert "the noise (correlation" in found.words


def test_gyros_of_one_programme_and_axes_of_one_gyro_are_no_copies() -> None:
    rng = np.random.default_rng(4)
    print("seed 4")
    assert copies([_entry(f"S-{k}", *((_TIME, _rates(rng)) for _ in range(3))) for k in range(40)]) == []
    own = (_TIME, _rates(rng))
    assert copies([_entry("S-1", own), _entry("S-1", own)]) == []


def test_recordings_without_noise_are_compared_by_rows_alone() -> None:
    flat = _entry("S-1", (_TIME, np.zeros(_ROWS))), _entry("S-2", (_TIME, np.zeros(_ROWS)))
    assert flat[0].noise == () and copies(flat) == []
    short = _entry("S-1", (_TIME[:100], _rates(np.random.default_rng(1))[:100]))
    assert copies([short, short.model_copy(update={"serial": "S-2"})]) == []
