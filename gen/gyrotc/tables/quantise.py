"""Round a model to a table, and say what the rounding costs.

After it only 32-bit words exist. The bound
that a table carries covers arithmetic, rounded parameters and rounded inputs against the model in
float64; extension terms are not part of it, curves and products of channels have a bound of their own. A
format that would cost more than 1 % of the noise floor is refused, with the reason; where the recordings show no
noise at all, there is nothing to hold it against.
"""

from __future__ import annotations

import functools
from dataclasses import dataclass, field

import numpy as np

from ..common.errors import CheckFailed, InputError
from ..model import Model
from ..target.table import Numeric, Table
from . import f32, q31
from .authority import with_authority
from .channel_error import channel_error_dph
from .legal import outside
from .probes import with_probes

__all__ = ["NUMERICS", "Table", "quantise"]

#: Arithmetics that the runtime has, the default first.
NUMERICS: tuple[Numeric, ...] = ("f32", "q31")

_SHARE_OF_FLOOR = 0.01  # adds 5e-5 to an RMS at the floor: rounding is then nobody's concern
_MAKERS = {"f32": f32.table_of, "q31": q31.table_of}


def quantise(model: Model, numeric: str) -> Table:
    """Table of a model in one arithmetic, with its known answers.

    Raises:
        InputError: An unknown arithmetic.
        CheckFailed: The format would cost more than 1 % of the model's noise floor, or cannot hold it.
    """
    if numeric not in _MAKERS:
        raise InputError("--numeric", repr(numeric), " or ".join(NUMERICS))
    return _quantised(_Known(model.hash, model), numeric)


@dataclass(frozen=True, slots=True)
class _Known:
    """A model by its hash."""

    hash: str
    model: Model = field(compare=False)


@functools.lru_cache(maxsize=4)
def _quantised(known: _Known, numeric: str) -> Table:
    """Kept for the next stages of the same job, which ask again."""
    model = known.model
    try:
        with np.errstate(over="raise", invalid="raise", divide="raise"):
            rounded = with_authority(model, _MAKERS[numeric](model))
    except (FloatingPointError, ZeroDivisionError, OverflowError) as error:
        raise CheckFailed(
            f"{numeric}: a number of the model leaves the range of this arithmetic ({error})"
        ) from error
    refused = outside(rounded)
    if refused is not None:
        raise CheckFailed(f"{numeric}: the runtime would refuse the table: {refused}")
    table = with_probes(model, rounded)
    floor = model.noise_floor_dph
    if floor and table.error_bound_dph > _SHARE_OF_FLOOR * floor:
        worst = max(table.bound_parts_dph, key=lambda part: table.bound_parts_dph[part])
        raise CheckFailed(
            f"{numeric}: rounding could cost {table.error_bound_dph:.2e} deg/h, more than 1 % of the noise "
            f"floor of {floor:.2e} deg/h (most of it: {worst}, {table.bound_parts_dph[worst]:.2e}; sum of "
            f"|weights| {model.sum_abs_weights_dph:.3g} deg/h)"
        )
    of_channels = channel_error_dph(model, table.numeric, table.bias_frac_bits)
    if floor and of_channels > _SHARE_OF_FLOOR * floor:
        raise CheckFailed(
            f"{numeric}: rounding in the terms of channels could cost {of_channels:.2e} deg/h, more than 1 % of "
            f"the noise floor of {floor:.2e} deg/h"
        )
    return table
