"""Recordings of both worlds that never change: twelve with a cause hidden at k of at least 2.5, eighty of any kind.

Each of the twelve must be named right by `make test`; of the eighty one in each class may be wrong in `make check`, and
two foreign effects of the own world. `make blind` measures with fresh draws how often names are right.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from . import campaign as own
from .draw import campaign_of, orders, recording_of
from .noise import Noise
from .other import record as other
from .other import run as other_run

SEED, HOURS, K = 20261125, 4.0, 3.5
_LEVEL = Noise(7e-4, 3e-5)
_OWN = (
    "cavity_lag",
    "hysteresis",
    "warm_up",
    "auxiliary",
    "path_length_periodicity",
    "thermal_gradient",
    "turn_on_offset",
)
_OTHER = {2: "auxiliary", 3: "warm_up", 4: "map_too_coarse", 5: "hysteresis", 7: "thermal_gradient"}


def recordings(folder: Path) -> Iterator[tuple[Path, str]]:
    """Folders of recordings, one after the other, and what is hidden."""
    campaign = own.draw_campaign(np.random.default_rng(SEED), "separating", hours=HOURS, exam=1)
    yardstick = own.Yardstick(campaign)
    for name in _OWN:
        rng = np.random.default_rng([SEED, *name.encode()])
        hidden = own.draw_recording(campaign, yardstick, [(name, K)], _LEVEL, rng)
        own.write(campaign, hidden, folder / name, declare=True, serial="U-0001")
        yield folder / name, name
    for number, name in _OTHER.items():  # those of few that have a k of at least 2.5
        drawn = other.draw_recording(SEED, number, "one", name, hours=HOURS)
        assert drawn.truth.k >= 2.5, (name, drawn.truth.k)
        other.write(drawn, folder / str(number), "V-0001")
        yield folder / str(number), name


OF_ANY_KIND = 3190762681  # seed of the eighty: the first that was drawn for them
_OWN_ORDERS, _PER_CAMPAIGN, _WEAKEST = 48, 24, 1.0
OWN_NUMBERS, OTHER_NUMBERS = range(47), range(48)


@dataclass(frozen=True)
class Drawn:
    """A recording of any kind.

    Attributes:
        folder: Its files.
        stratum: "clean", "stress" and "sensor lag" (nothing of the catalogue is hidden), "foreign", "one", "two".
        hidden: Causes that are hidden.
        k: How large the least of them is.
    """

    folder: Path
    stratum: str
    hidden: tuple[str, ...]
    k: float


def of_any_kind(seed: int, folder: Path, own_numbers: Sequence[int], other_numbers: Sequence[int]) -> Iterator[Drawn]:
    """Recordings of both worlds, one after the other; of the other world every third of the clean ones."""
    wanted = orders(_OWN_ORDERS, np.random.default_rng([seed, 0]), _WEAKEST)
    for number in own_numbers:
        campaign, yardstick = campaign_of(seed, number // _PER_CAMPAIGN)
        hidden, declared = recording_of(seed, number, wanted[number], campaign, yardstick)
        target = folder / f"own-{number}"
        own.write(campaign, hidden, target, declare=declared, serial="U-0001")
        yield Drawn(target, wanted[number].stratum, tuple(hidden.names), min(hidden.k, default=0.0))
    listed = other_run.orders(max(other_numbers, default=0) + 1)
    for number in other_numbers:
        stratum, name = listed[number]
        if stratum == "clean" and number % 3:
            continue
        truth = (drawn := other.draw_recording(seed, number, stratum, name)).truth
        target = folder / f"other-{number}"
        other.write(drawn, target, "V-0001")
        yield Drawn(target, stratum, (name,) if name else (), truth.k)
