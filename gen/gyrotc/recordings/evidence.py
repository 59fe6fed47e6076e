"""What is kept of a recording to judge its units by: means of cells, however long the recording is."""

from __future__ import annotations

import numpy as np

from ..common.arrays import FloatArray

__all__ = ["Evidence"]


_PART = 2**16  # rows that are looked at together
_MOST_CELLS = 2**12  # even, so that cells can be merged in pairs


class Evidence:
    """Means of time (s), temperature (C) and rates (deg/h) over cells of equally many rows; ranges; number of rows.

    Rows are added a block at a time. Where cells become too many, two become one: memory does not grow.

    Args:
        rates: Number of rates.
    """

    def __init__(self, rates: int) -> None:
        self.rows = 0
        self.temperature_c = (np.inf, -np.inf)
        self.same = 0
        self._rows_per_cell = 1
        self._cells = np.empty((_MOST_CELLS, 2 + rates))
        self._count = 0
        self._rest = np.empty((0, 2 + rates))

    def add(self, time_s: FloatArray, temperature_c: FloatArray, rates_dph: list[FloatArray]) -> None:
        """Adds rows; those without a finite value in every column are left out."""
        for start in range(0, len(time_s), _PART):
            part = slice(start, start + _PART)
            self._add(
                np.column_stack([time_s[part], temperature_c[part], *(rate[part] for rate in rates_dph)])
            )

    def _add(self, block: FloatArray) -> None:
        whole = np.isfinite(block).all(axis=1)
        block = block if whole.all() else block[whole]
        if len(block) == 0:
            return
        low, high = self.temperature_c
        self.temperature_c = min(low, float(block[:, 1].min())), max(high, float(block[:, 1].max()))
        self.same += int(np.count_nonzero(block[1:, 2:] == block[:-1, 2:]))
        self.rows += len(block)
        block = np.concatenate([self._rest, block])
        while len(block) >= self._rows_per_cell:
            block = self._filled(block)
        self._rest = block

    @property
    def cells(self) -> FloatArray:
        """Means of the cells, shape (n, 2 + rates): time, temperature, rates."""
        return self._cells[: self._count]

    @property
    def stuck(self) -> bool:
        """Whether most rates repeat the one before: their scatter is that of the resolution."""
        return 2 * self.same > self.rows * (self._cells.shape[1] - 2)

    def _filled(self, block: FloatArray) -> FloatArray:
        """Takes as many rows as there is room for; the rows that are left."""
        per = self._rows_per_cell
        n = min(len(block) // per, _MOST_CELLS - self._count)
        means = block[: n * per].reshape(n, per, -1).mean(axis=1)
        self._cells[self._count : self._count + n] = means
        self._count += n
        if self._count == _MOST_CELLS:
            self._cells[: _MOST_CELLS // 2] = self._cells.reshape(_MOST_CELLS // 2, 2, -1).mean(axis=1)
            self._count //= 2
            self._rows_per_cell *= 2
        return block[n * per :]
