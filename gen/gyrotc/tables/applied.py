"""The model that was already subtracted while recording: its correction, to be added back."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ..common.errors import CheckFailed, InputError
from ..model import Model, load_model
from ..recordings.records import Applied, Rows
from ..target.front_end import samples_per_block
from ..target.history import replay
from ..target.table import Table
from ..train.samples import missed_before
from .quantise import NUMERICS, quantise

_PART = 2**18  # rows that are looked at together: bounds memory


def applied_of(path: Path) -> Applied:
    """The model of a `model.json` as `load` takes it.

    Raises:
        InputError: The file is no model.
        CheckFailed: It has no table.
    """
    model = load_model(path)
    table = _table(model)

    def correction_dph(rows: Rows, row_period_s: float) -> NDArray[np.float64]:
        replayed = replay(
            table,
            channels_of(rows, model, table),
            missed=missed_before(rows.time_s, row_period_s),
            samples_per_block=samples_per_block(model.block_s, row_period_s),
        )
        return table.decode_bias(replayed.bits)

    return Applied(model.hash, correction_dph)


def _table(model: Model) -> Table:
    """A table in the first arithmetic that is not refused: two differ by less than 1 % of the noise."""
    refused = []
    for numeric in NUMERICS:
        try:
            return quantise(model, numeric)
        except CheckFailed as error:
            refused.append(str(error))
    raise CheckFailed("; ".join(refused))


def channels_of(rows: Rows, model: Model, table: Table) -> NDArray[np.uint32]:
    """Bits of temperature and auxiliary channels of every row, as the table takes them, shape (n, n_channels).

    Raises:
        InputError: The recording lacks a channel that a term of the model needs.
    """
    names = sorted({t.channel for t in model.terms if t.channel})
    for name in names:
        if not rows.has_channel(name):
            raise InputError(f"channel {name}", "the recording has no such column", "the channel of a term")
    bits = np.empty((len(rows), 1 + len(names)), dtype=np.uint32)
    for k, column in enumerate([rows.temperature_c, *map(rows.channel, names)]):
        for at in range(0, len(rows), _PART):
            bits[at : at + _PART, k] = table.encode_inputs(column[at : at + _PART])
    return bits
