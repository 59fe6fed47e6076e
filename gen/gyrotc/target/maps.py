"""The static map of a table: clamp, coverage, status, and the network in the table's arithmetic."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from . import f32, q31
from .table import CLAMPED, E_ARG, MISSING_Q31, UNCOVERED, Table, Words

__all__ = ["evaluate_map", "governed", "stand_in"]


def evaluate_map(table: Table, inputs: Words, fused: f32.Fused = frozenset()) -> tuple[NDArray[np.int32], Words]:
    """`gtc_<n>_map` for many inputs.

    Args:
        table: The table.
        inputs: Bits of (temperature, slope per block), shape (n, 2).
        fused: Sums of the float32 map (of `FUSIBLE`) that a wrong build fuses; none in a right answer.

    Returns:
        Statuses, shape (n,), and the bits of the biases (0 where the status is negative).
    """
    numbers = table.numbers(inputs)
    missing = ~np.isfinite(numbers) if table.numeric == "f32" else numbers == MISSING_Q31
    usable = ~(missing[:, 0] | missing[:, 1])
    x = np.where(usable[:, None], numbers, table.numbers(table.envelope)[[0, 2]])
    low, high = table.numbers(table.envelope).reshape(2, 2).T
    beyond = (x < low) | (x > high)
    status = np.where(beyond[:, 0] | beyond[:, 1], CLAMPED, 0)
    x = np.minimum(np.maximum(x, low), high)
    if table.numeric == "f32":
        points = f32.normalise(table, x, fused)
        cells = f32.cells(table, points, table.coverage_cells)
        bias: NDArray[Any] = f32.biases(table, points, fused)
    else:
        positions = q31.normalise(table, x)
        cells, bias = q31.cells(positions, table.coverage_cells), q31.biases(table, positions)
    within, clamped = governed(table.numbers(table.authority), bias)
    bits = table.bits(np.where(clamped, within, bias))
    status = status | np.where(clamped, CLAMPED, 0)
    status = status | np.where(_is_covered(table, cells), 0, UNCOVERED)
    status = np.where(usable, status, E_ARG).astype(np.int32)
    return status, np.where(usable, bits, np.uint32(0)).astype(np.uint32)


def stand_in(table: Table, number: int, temperature: NDArray[Any], slope: NDArray[Any]) -> NDArray[Any]:
    """What stands for a term whose channel is not known.

    Args:
        table: The table.
        number: Of the fallback model among its networks, from 1 on.
        temperature, slope: Inputs of the map, numbers of the arithmetic, shape (n,) each.
    """
    low, high = table.numbers(table.envelope).reshape(2, 2).T
    x = np.minimum(np.maximum(np.stack([temperature, slope], axis=1), low), high)
    if table.numeric == "f32":
        return f32.stand_in(table, number, f32.normalise(table, x))
    return q31.stand_in(table, number, q31.normalise(table, x))


def governed(bounds: NDArray[Any], x: NDArray[Any]) -> tuple[NDArray[Any], NDArray[np.bool_]]:
    """Numbers within bounds, and which of them were not."""
    low, high = bounds
    return np.clip(x, low, high), (x < low) | (x > high)


def _is_covered(table: Table, cell: NDArray[np.int64]) -> NDArray[np.bool_]:
    if table.coverage.size == 0:
        return np.ones(len(cell), dtype=np.bool_)
    index = cell[:, 1] * table.coverage_cells[0] + cell[:, 0]
    return np.asarray((table.coverage[index >> 5] >> (index & 31).astype(np.uint32)) & 1).astype(np.bool_)
