"""Streams of readings that hypothesis draws, as a bus, a sensor and a host make them, and tables to feed them to."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from gyrotc.common import CheckFailed
from gyrotc.mirror import Table, Words
from gyrotc.results import Numeric
from gyrotc.tables import quantise
from hypothesis import strategies as st
from libc_device import variant
from models import random_uncertainty

_MODELS = 24
_CHANNELS = 3
_GAPS = (0, 0, 0, 0, 0, 1, 2, 5, 23, 60, 400, 100_000)
_KINDS = ("hold", "hold", "ramp", "noise", "stuck", "jump", "spike", "missing", "impossible")
_IMPOSSIBLE = (np.inf, -np.inf, 250.0, -91.0, 1e30, 0.0)


@dataclass(frozen=True, slots=True)
class Part:
    """Readings of one kind in one channel; the other channels hold their level.

    Attributes:
        kind: One of `_KINDS`.
        channel: Number of the channel; 0 is the temperature.
        count: Number of readings.
        size: Size of a change, in the allowed step of the temperature.
        lost: Readings lost before the first of the part.
        lossy: Whether as many are lost before each.
    """

    kind: str
    channel: int
    count: int
    size: float
    lost: int
    lossy: bool


@dataclass(frozen=True, slots=True)
class Stream:
    """A table and what its device reads.

    Attributes:
        table: The table.
        readings: Bits of every channel, shape (n, n_channels).
        lost: Readings lost before each, shape (n,).
        samples_per_block: Number of readings in a block.
    """

    table: Table
    readings: Words
    lost: np.ndarray
    samples_per_block: int

    def __len__(self) -> int:
        return len(self.lost)


_parts = st.builds(
    Part,
    kind=st.sampled_from(_KINDS),
    channel=st.integers(0, _CHANNELS - 1),
    count=st.integers(1, 40),
    size=st.sampled_from([0.3, 1.0, -1.0, 1.5, -4.0, 40.0]),
    lost=st.sampled_from(_GAPS),
    lossy=st.booleans(),
)


@lru_cache(maxsize=2 * _MODELS)
def drawn_table(numeric: Numeric, number: int) -> Table | None:
    """Return a table: plain, with terms or of several networks, every other one with uncertainties.

    None: this arithmetic cannot hold the model.
    """
    model = variant(number)
    if number % 2:
        model = model.model_copy(update={"uncertainty_dph": random_uncertainty(number, len(model.terms))})
    try:
        return quantise(model, numeric)
    except CheckFailed:
        return None


@st.composite
def streams(draw: st.DrawFn, numeric: Numeric, *, uncertain: bool = False) -> Stream:
    """Draw a table and a stream: holds, ramps, noise, stuck readings, jumps, spikes, NaN, impossible values, losses.

    With `uncertain` the table has uncertainties.
    """
    numbers = [k for k in range(_MODELS) if drawn_table(numeric, k) is not None and (k % 2 or not uncertain)]
    number = draw(st.sampled_from(numbers))
    table, model = drawn_table(numeric, number), variant(number)
    assert table is not None
    rng = np.random.default_rng(draw(st.integers(0, 2**16)))
    low, high = model.envelope.temperature_c
    level = np.array([low + draw(st.floats(-0.1, 1.1)) * (high - low), 12.0, 12.0])
    readings, lost = [], []
    for part in draw(st.lists(_parts, min_size=1, max_size=25)):
        values, level = _readings(part, level, model.max_step_c, rng)
        readings.append(values)
        lost.append(np.where(np.arange(part.count) * (not part.lossy) == 0, part.lost, 0))
    channels = np.concatenate(readings)[:, : table.n_channels]
    return Stream(
        table,
        table.encode_inputs(channels),
        np.concatenate(lost).astype(np.int64),
        draw(st.sampled_from([1, 2, 3, 7, 10, 50, 1000])),
    )


def _readings(part: Part, level: np.ndarray, step_c: float, rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    """Return the readings of a part, and the levels behind it."""
    n, c, size = part.count, part.channel, part.size * step_c
    noise = rng.normal(0.0, 0.02 * step_c, (n, _CHANNELS))
    values = level + noise
    level = level.copy()
    if part.kind == "ramp":
        values[:, c] += size * np.arange(1, n + 1)
        level[c] += size * n
    elif part.kind == "noise":
        values[:, c] += rng.normal(0.0, abs(size), n)
    elif part.kind == "stuck":
        values[:, c] = level[c]
    elif part.kind == "jump":
        values[:, c] += size
        level[c] += size
    elif part.kind == "spike":
        values[0, c] += size
    elif part.kind == "missing":
        values[:, c] = np.nan
    elif part.kind == "impossible":
        values[:, c] = rng.choice(_IMPOSSIBLE)
    return values, level
