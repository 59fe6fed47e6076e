"""A small campaign made in memory, for tests of single stages of diagnosis: three runs of four hours."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from gyrotc.causes import History
from gyrotc.diagnose import Colour, Records, RunRecord, Search, SignatureBank, build_bank, open_search
from numpy.typing import NDArray

Array = NDArray[np.float64]
ROW_S, BLOCK_S = 20.0, 100.0
LEVEL_DPH = 1e-3  # standard deviation of white block means

# Corners of the temperature, (h, C): several rates, loops of several widths, holds reached from both sides.
PROGRAMMES = (
    (
        (0.0, 20.0),
        (0.3, 55.0),
        (0.6, 55.0),
        (1.5, -20.0),
        (1.8, -20.0),
        (2.6, 40.0),
        (3.1, 10.0),
        (4.0, 45.0),
    ),
    ((0.0, -20.0), (0.4, -20.0), (2.2, 50.0), (2.5, 50.0), (3.2, 5.0), (4.0, 5.0)),
    (
        (0.0, 50.0),
        (0.4, 50.0),
        (0.7, 20.0),
        (1.2, 20.0),
        (1.5, -15.0),
        (2.0, -15.0),
        (2.4, 30.0),
        (4.0, 30.0),
    ),
)


@dataclass(frozen=True)
class Campaign:
    """Records without a rate, their bank, and the temperature of every block."""

    records: Records
    bank: SignatureBank
    temperature: Array

    def with_rate(self, rows: list[Array], noise: Array) -> Records:
        """The same runs with rates per row, and noise of block means (the same in all rows of a block)."""
        spans, index = self.records.spans(), self.records.index
        runs = [
            replace(run, rate_dph=rate + noise[span][index[k]])
            for k, (run, rate, span) in enumerate(zip(self.records.runs, rows, spans, strict=True))
        ]
        return Records(tuple(runs), BLOCK_S)

    def search(self, y: Array, declared: Colour | None = None, **options: Array) -> Search:
        """The search of block means."""
        return open_search(self.records, self.bank, y, declared=declared, **options)


def small_records() -> Records:
    """Three runs, one a day, switched on ten minutes before their first row; the rates are 0."""
    runs = []
    for k, corners in enumerate(PROGRAMMES):
        hours, temperature = np.array(corners).T
        time = np.arange(0.0, 3600.0 * hours[-1], ROW_S)
        history = History(
            time_s=time,
            temperature_c=np.interp(time, 3600.0 * hours, temperature),
            on_s=time + 600.0,
            run=k,
            runs=len(PROGRAMMES),
            day=float(k),
        )
        usable = np.ones(time.size, dtype=bool)
        runs.append(RunRecord(f"run-{k}", history, np.zeros(time.size), usable, f"environment {k}"))
    return Records(tuple(runs), BLOCK_S)


def small_campaign() -> Campaign:
    records = small_records()
    temperature = records.average([run.history.temperature_c for run in records.runs])
    return Campaign(records, build_bank(records, 0), temperature)
