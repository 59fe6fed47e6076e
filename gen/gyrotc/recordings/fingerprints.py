"""Find rows that two recordings have in common, by hashes of windows of rows.

Only exact copies count: the same temperatures and rates as float32, so that a file that was written again with nine
digits is known; times do not count. The noise of a gyro never repeats, so a window of rows that occurs in two
recordings is a copy, if chance cannot have made it. Rows whose rates repeat those of the row before say nothing; a
window consists of rows at which a rate changes, each with the number of rows since the change before it. It counts if
each of its parts is rare: the rates of the part occur at most twice in the recording (twice where a logger wrote a
stretch again). A constant rate, one that toggles and one that repeats a pattern have no such window. If n parts of a
recording are rare, each occurs in another one with a probability of about 2/n at most, and two recordings of n rows
have a window of eight such parts in common by chance with n² (2/n)^8: 2e-11 for 150 rows, less for more.

Of a long recording only windows with small hashes are kept, so that two recordings keep the same ones.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..common.arrays import FloatArray
from .records import Run

RowHashes = NDArray[np.uint64]

_PART, _PARTS = 16, 8  # rows of a part, parts of a window
_RARE = 2  # a part that occurs more often in a recording says nothing
_MAX_KEPT = 2**16  # windows of a recording, about: of longer recordings every second is kept, every fourth, ...
_SEARCHED, _OVERLAP = 2**18, 2**11  # rows that are searched together, and those seen again with the next
_SKETCH = 128  # hashes by which gyros are compared: shared rows show from a twentieth on

# SplitMix64 (Steele, Lea, Flood 2014).
_GOLDEN, _MIX = np.uint64(0x9E3779B97F4A7C15), np.uint64(0xBF58476D1CE4E5B9)
_LARGEST = np.uint64(2**64 - 1)
_INVERSE_GOLDEN = np.uint64(pow(int(_GOLDEN), -1, 2**64))


@dataclass(frozen=True, slots=True)
class Fingerprints:
    """Fingerprints of a recording's rows: increasing hashes of windows, shape (n,), first and last row, their times."""

    hash: RowHashes
    first: NDArray[np.int32]
    last: NDArray[np.int32]
    first_s: FloatArray
    last_s: FloatArray

    def within(self, run: Run) -> Fingerprints:
        """Return those whose first and last row belong to a run."""
        kept = run.in_span(self.first_s) & run.in_span(self.last_s)
        return Fingerprints(self.hash[kept], self.first[kept], self.last[kept], self.first_s[kept], self.last_s[kept])


def fingerprints_of(time_s: FloatArray, temperature_c: FloatArray, rates: Sequence[FloatArray]) -> Fingerprints:
    """Return the fingerprints of a recording: times (s), temperatures, rates or pulses of every axis, shape (n,)."""
    largest = _LARGEST
    for _ in range((len(time_s) // _MAX_KEPT).bit_length()):
        largest //= np.uint64(2)
    found = []
    for start in range(0, max(len(time_s), 1), _SEARCHED):
        part = slice(start, start + _SEARCHED + _OVERLAP)
        hashes, first, last = _windows_of(temperature_c[part], [values[part] for values in rates])
        kept = (hashes <= largest) & (first < _SEARCHED)
        found.append((hashes[kept], first[kept] + start, last[kept] + start))
    hashes, first, last = (np.concatenate(column) for column in zip(*found, strict=True))
    order = np.lexsort((first, hashes))
    order = order[_are_rare(hashes[order])]
    first, last = first[order], last[order]
    return Fingerprints(hashes[order], first.astype(np.int32), last.astype(np.int32), time_s[first], time_s[last])


def _windows_of(
    temperature_c: FloatArray, rates: Sequence[FloatArray]
) -> tuple[RowHashes, NDArray[np.int64], NDArray[np.int64]]:
    """Return hash, first and last row of every window whose parts are all rare."""
    known = np.flatnonzero(np.all([np.isfinite(values) for values in rates], axis=0))
    of_rates = _hash_of([values[known] for values in rates])
    changed = np.flatnonzero(np.r_[True, of_rates[1:] != of_rates[:-1]][: len(known)])
    at = known[changed]
    size = _PART * _PARTS
    if len(at) < size:
        nothing = np.zeros(0, np.int64)
        return nothing.astype(np.uint64), nothing, nothing
    steps = np.diff(at, prepend=at[0]).astype(np.uint64)
    rate_words = _mixed(of_rates[changed] * _GOLDEN + steps)
    row_words = _mixed(rate_words * _GOLDEN + _bits_of(temperature_c[at]))
    parts = _rolling(rate_words, _PART)
    order = np.argsort(parts)
    rare = np.empty(len(parts), dtype=bool)
    rare[order] = _are_rare(parts[order])
    hashes = _rolling(row_words, size)
    all_rare = np.all([rare[k * _PART :][: len(hashes)] for k in range(_PARTS)], axis=0)
    window = np.flatnonzero(all_rare)
    return hashes[window], at[window], at[window + size - 1]


def _rolling(words: RowHashes, length: int) -> RowHashes:
    """Return a hash of each window of `length` words, in order: polynomials modulo 2^64."""
    power = np.full(len(words), _GOLDEN)
    power[0] = 1
    sums = np.r_[np.uint64(0), np.cumsum(words * np.cumprod(power))]
    shift = np.full(len(words) - length + 1, _INVERSE_GOLDEN)
    shift[0] = 1
    return _mixed((sums[length:] - sums[:-length]) * np.cumprod(shift))


def _hash_of(columns: Sequence[FloatArray]) -> RowHashes:
    """Return a hash of each row of columns of one length."""
    words = np.zeros(len(columns[0]), dtype=np.uint64)
    for values in columns:
        words = _mixed(words * _MIX + _bits_of(values))
    return words


def _bits_of(values: FloatArray) -> RowHashes:
    """Return values as float32, as whole numbers; 0 and -0 are one, and so is all that is beyond float32."""
    with np.errstate(over="ignore"):
        narrow = values.astype(np.float32) + np.float32(0.0)
    return np.asarray(narrow.view(np.uint32).astype(np.uint64))


def _mixed(words: RowHashes) -> RowHashes:
    words = (words ^ (words >> np.uint64(30))) * _MIX
    words = (words ^ (words >> np.uint64(27))) * _GOLDEN
    return np.asarray(words ^ (words >> np.uint64(31)))


def _are_rare(ordered: RowHashes) -> NDArray[np.bool_]:
    """Test of ordered words whether they occur at most `_RARE` times."""
    often = np.diff(np.flatnonzero(np.r_[_are_new(ordered), True]))
    return np.repeat(often <= _RARE, often)


def _are_new(ordered: RowHashes) -> NDArray[np.bool_]:
    """Test of ordered words whether they differ from the one before."""
    new = np.ones(len(ordered), dtype=bool)
    np.not_equal(ordered[1:], ordered[:-1], out=new[1:])
    return new


def windows_in_common(prints: Sequence[Fingerprints]) -> dict[tuple[int, int], NDArray[np.int64]]:
    """Return the first row of each window that two runs share, in both, and its rows; shape (n, 3), in order.

    Returns:
        By the numbers of the two runs, the later one first; of a run with itself: a window that comes again.
    """
    found = {(j, j): windows for j, one in enumerate(prints) if len(windows := _repeated(one))}
    at = [np.flatnonzero(_are_new(one.hash)) for one in prints]
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


def _repeated(mine: Fingerprints) -> NDArray[np.int64]:
    before = np.flatnonzero(~_are_new(mine.hash)) - 1
    return _windows(mine, before + 1, mine.first[before])


def _windows(mine: Fingerprints, at: NDArray[np.int64], other: NDArray[np.int32]) -> NDArray[np.int64]:
    first, last = mine.first[at].astype(np.int64), mine.last[at]
    found = np.column_stack([first, other, last - first + 1])
    return np.asarray(found[np.lexsort((found[:, 1], first))])


def sketch(fingerprints: Sequence[Fingerprints]) -> tuple[int, ...]:
    """Return the smallest hashes of all recordings of a gyro: two gyros that share rows share some of them.

    A twentieth of the rows in common shows with more than 99 % (Broder, "On the resemblance and containment of
    documents", 1997: 128 draws).
    """
    smallest = [one.hash[: _RARE * _SKETCH] for one in fingerprints]
    every = np.unique(np.concatenate([np.zeros(0, np.uint64), *smallest]))
    return tuple(every[:_SKETCH].tolist())
