"""Twelve recordings that never change, of both worlds, with a cause hidden at k of at least 2.5.

Each must be named right by `make test`; `make blind` and `make blind-other` measure with fresh draws how often names
are right.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np

from . import campaign as own
from .noise import Noise
from .other import record as other

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
