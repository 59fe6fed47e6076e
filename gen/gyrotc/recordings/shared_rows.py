"""Rows that two recordings have in common: a gyro's noise never repeats, a copied row does.

A window of consecutive rows is hashed (temperature and rates as float32; times do not count). Of the hashes every
sixteenth is kept (of long recordings fewer), chosen by its own value, so that two recordings keep the same ones and
memory stays small
(winnowing: Schleimer, Wilkerson, Aiken, "Winnowing: local algorithms for document fingerprinting", SIGMOD 2003).

Quantised rates repeat by chance, so a window counts only where chance cannot have made it. A row tells as many bits as
its rate is unexpected after the rate before it, and after the sixteen before, by how often these occur in the recording
itself, the row not counted: (n(both) - 1/2) / n(before), 1/2 as of Krichevsky and Trofimov. A rate that is constant,
toggles or repeats a pattern tells nothing; rows that only repeat the one before are left out.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .._core import windows_of
from ..common.arrays import FloatArray
from .records import Run

Words = NDArray[np.uint64]

_LENGTHS = (128, 1024)  # of windows, rows; the longer ones for coarse rates
_ONE_IN = 16  # power of 2; a sixteenth of the windows finds a shared stretch of a few hundred rows
_MOST_KEPT = 2**16  # windows of a length, about: longer recordings keep one in 32, 64, ...
_BITS = 80.0  # 2^50 alignments of two dozen runs of 100 h at 100 Hz, and a false alarm in 2^30 data sets
_SEARCHED, _OVERLAP = 2**18, 2**11  # rows that are looked at together, and those seen again with the next
_PATTERN = 3  # windows that a recording holds this often are a pattern
_SKETCH = 128  # hashes: rows that two gyros share are seen from a twentieth on (docs/fleet.md)


@dataclass(frozen=True, slots=True)
class Fingerprints:
    """What is kept of a recording's rows: increasing hashes of windows, shape (n,), first and last row, their times."""

    hash: Words
    first: NDArray[np.int32]
    last: NDArray[np.int32]
    first_s: FloatArray
    last_s: FloatArray

    def within(self, run: Run) -> Fingerprints:
        """Those whose first and last row belong to a run."""
        kept = run.in_span(self.first_s) & run.in_span(self.last_s)
        return Fingerprints(self.hash[kept], self.first[kept], self.last[kept], self.first_s[kept], self.last_s[kept])


def fingerprints_of(time_s: FloatArray, temperature_c: FloatArray, rates: Sequence[FloatArray]) -> Fingerprints:
    """Fingerprints of a recording: times (s), temperatures, rates or pulses of every axis; arrays of shape (n,)."""
    one_in = _ONE_IN
    while len(time_s) > one_in * _MOST_KEPT:
        one_in *= 2
    found = []
    for start in range(0, max(len(time_s), 1), _SEARCHED):
        part = slice(start, start + _SEARCHED + _OVERLAP)
        columns = [np.ascontiguousarray(values[part], dtype=np.float64) for values in (temperature_c, *rates)]
        kept = windows_of(columns[0], columns[1:], _LENGTHS, one_in - 1, _BITS, _SEARCHED)
        found.append((kept[0], kept[1] + start, kept[2] + start))
    hashes, first, last = (np.concatenate(column) for column in zip(*found, strict=True))
    order = np.lexsort((first, hashes))
    hashes = hashes[order]
    often = np.diff(np.flatnonzero(np.r_[_new(hashes), True]))
    rare = np.repeat(often < _PATTERN, often)
    hashes, order = hashes[rare], order[rare]
    first, last = first[order], last[order]
    return Fingerprints(hashes, first.astype(np.int32), last.astype(np.int32), time_s[first], time_s[last])


def _new(ordered: Words) -> NDArray[np.bool_]:
    """Which of ordered words differ from the one before."""
    new = np.ones(len(ordered), dtype=bool)
    np.not_equal(ordered[1:], ordered[:-1], out=new[1:])
    return new


def windows_in_common(prints: Sequence[Fingerprints]) -> dict[tuple[int, int], NDArray[np.int64]]:
    """First row of each window that two runs have, in the one and in the other, and its rows, shape (n, 3), in order.

    Returns:
        By the numbers of the two runs, the later one first; of a run with itself: a window that comes again.
    """
    found = {(j, j): windows for j, one in enumerate(prints) if len(windows := _that_repeat(one))}
    at = [np.flatnonzero(_new(one.hash)) for one in prints]
    hashes = np.concatenate([np.zeros(0, np.uint64), *(one.hash[rows] for one, rows in zip(prints, at, strict=True))])
    run = np.repeat(np.arange(len(prints)), [len(rows) for rows in at])
    order = np.argsort(hashes, kind="stable")  # those that are alike by run
    hashes, run, place = hashes[order], run[order], np.concatenate([np.zeros(0, np.int64), *at])[order]
    pairs = []
    for lag in range(1, len(prints)):
        alike = np.flatnonzero(hashes[lag:] == hashes[:-lag])
        if len(alike) == 0:
            break
        pairs.append(np.column_stack([run[alike + lag], run[alike], place[alike + lag], place[alike]]))
    each = np.concatenate(pairs) if pairs else np.zeros((0, 4), dtype=np.int64)
    for j, i in np.unique(each[:, :2], axis=0).tolist():
        mine, its = each[(each[:, 0] == j) & (each[:, 1] == i), 2:].T
        found[j, i] = _windows(prints[j], mine, prints[i].first[its])
    return dict(sorted(found.items()))


def _that_repeat(mine: Fingerprints) -> NDArray[np.int64]:
    before = np.flatnonzero(~_new(mine.hash)) - 1
    return _windows(mine, before + 1, mine.first[before])


def _windows(mine: Fingerprints, at: NDArray[np.int64], other: NDArray[np.int32]) -> NDArray[np.int64]:
    first, last = mine.first[at].astype(np.int64), mine.last[at]
    found = np.column_stack([first, other, last - first + 1])
    return np.asarray(found[np.lexsort((found[:, 1], first))])


def sketch(fingerprints: Sequence[Fingerprints]) -> tuple[int, ...]:
    """The smallest hashes of all recordings of a gyro: two gyros that share rows share some of them.

    A twentieth of the rows in common shows with more than 99 % (Broder, "On the resemblance and containment of
    documents", 1997: 128 draws).
    """
    smallest = [one.hash[: _PATTERN * _SKETCH] for one in fingerprints]  # in order, each less than _PATTERN times
    every = np.unique(np.concatenate([np.zeros(0, np.uint64), *smallest]))
    return tuple(every[:_SKETCH].tolist())
