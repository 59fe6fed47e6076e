"""Gyros of different serials whose recordings hold the same rows, or the same noise: those of one are a copy.

Rows are compared by hashes. Noise is compared by the signs that each gyro keeps of it (`noise_signs`), without a
correlation of every pair: some signs of a window, spaced unevenly, are a number, and two recordings that have a number
in common are compared sign by sign at that lag (locality-sensitive hashing: Charikar, "Similarity estimation
techniques from rounding algorithms", STOC 2002; spaced seeds: Ma, Tromp, Li, "PatternHunter", Bioinformatics 18, 2002).
"""

from __future__ import annotations

import base64
import math
from collections import Counter, defaultdict
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..common.arrays import FloatArray
from ..recordings.copies import FASTEST_SIGNS, SLOWEST
from ..results.fleet import Copy, FleetEntry, NoiseSigns

_DIGITS = 16  # of a hash
_LEAST_COMMON = 2  # hashes; one alone might be chance among 100,000 gyros
_CROWD = 16  # gyros of which one hash is known: enough to name
_WINDOWS = 4  # ways to space the signs of a window: each finds a faint copy by itself
_GAPS = (2, 4)  # between signs of a window: nearer ones are not independent, for noise is band-limited
_NARROWEST, _WIDEST = 12, 26  # signs that are compared; the widest lie in two words
_LAG_BITS = 14  # of a lag, in signs
_WORD = 56  # signs that are compared at once: what eight bytes hold from any bit of the first on
_FIRST_LOOK, _LEAST_EXCESS = (
    4 * _WORD,
    0.3,
)  # signs about a window; by how much more of them agree than differ
_SIGMAS = 7.0  # of the signs that agree by chance: once in 4e11, and a fleet of a thousand looks at 1e7 lags
_ALIKE = 0.5  # correlation: at periods of minutes nothing shakes two gyros by as much as their own noise

_MIX = np.uint64(0x9E3779B97F4A7C15)  # odd: no two words become one

Numbers = NDArray[np.int64]


def copies(entries: Sequence[FleetEntry]) -> list[Copy]:
    """Pairs of gyros of different serials that share rows, or else noise, in the order of the entries."""
    pairs = {**_same_noise(entries), **_same_rows(entries)}
    return [
        Copy(
            name=entries[a].name,
            serial=entries[a].serial or "",
            other=entries[b].name,
            other_serial=entries[b].serial or "",
            share=min(1.0, share),
            likeness=likeness,
        )
        for (a, b), (share, likeness) in sorted(pairs.items())
    ]


def with_copies(entries: Sequence[FleetEntry], found: Sequence[Copy]) -> list[FleetEntry]:
    """The entries, each of a pair with the finding `copy_of_other` and the others' names."""
    others: dict[str, list[str]] = defaultdict(list)
    for copy in found:
        others[copy.name].append(copy.other)
        others[copy.other].append(copy.name)
    return [
        entry.model_copy(update={"findings": (*entry.findings, "copy_of_other"), "copy_of": tuple(others[entry.name])})
        if entry.name in others and entry.model_hash is not None
        else entry
        for entry in entries
    ]


_Pairs = dict[tuple[int, int], tuple[float, float | None]]
"""Share and likeness of pairs of entries, by their numbers."""


def _same_rows(entries: Sequence[FleetEntry]) -> _Pairs:
    words = [_words_of(entry.sketch) for entry in entries]
    holders: dict[str, list[int]] = defaultdict(list)
    for number, of_one in enumerate(words):
        for word in of_one:
            if len(holders[word]) < _CROWD:
                holders[word].append(number)
    common: Counter[tuple[int, int]] = Counter()
    for numbers in holders.values():
        if len(numbers) > 1:
            common.update((a, b) for k, a in enumerate(numbers) for b in numbers[k + 1 :])
    return {
        (a, b): (count / min(len(words[a]), len(words[b])), None)
        for (a, b), count in common.items()
        if count >= min(_LEAST_COMMON, len(words[a])) and (entries[a].serial or "") != (entries[b].serial or "")
    }


def _words_of(sketch: str) -> list[str]:
    return [sketch[k : k + _DIGITS] for k in range(0, len(sketch), _DIGITS)]


def _same_noise(entries: Sequence[FleetEntry]) -> _Pairs:
    serials = {serial: k for k, serial in enumerate(dict.fromkeys(entry.serial or "" for entry in entries))}
    by_octave: dict[int, list[tuple[int, NoiseSigns]]] = defaultdict(list)
    for number, entry in enumerate(entries):
        for signs in entry.noise:
            by_octave[signs.octave].append((number, signs))
    alike: dict[tuple[int, int], dict[str, tuple[float, float]]] = defaultdict(dict)
    for octave, held in by_octave.items():
        serial = np.array([serials[entries[number].serial or ""] for number, _ in held])
        for i, j, count, likeness in _Runs.of([signs for _, signs in held], serial).alike():
            of_runs, file = alike[held[i][0], held[j][0]], held[i][1].file
            of_runs[file] = max(of_runs.get(file, (0.0, 0.0)), (count * 2.0**octave, likeness))
    return {
        pair: (
            sum(span_s for span_s, _ in of_runs.values()) / min(_span_s(entries[k]) for k in pair),
            max(likeness for _, likeness in of_runs.values()),
        )
        for pair, of_runs in alike.items()
    }


def _span_s(entry: FleetEntry) -> float:
    """Of all recordings whose noise is known."""
    spans = {one.file: one.count * 2.0**one.octave for one in entry.noise}
    return sum(spans.values())


@dataclass(frozen=True, slots=True)
class _Runs:
    """Signs of the noise of many runs, one behind the other.

    Attributes:
        signs: 0 or 1, shape (n,).
        words: The 64 signs from each eighth one on, the first one in the highest bit.
        start: Place of each run's first sign.
        count: Number of its signs.
        serial: Number of its gyro's serial.
    """

    signs: NDArray[np.uint8]
    words: NDArray[np.uint64]
    start: Numbers
    count: Numbers
    serial: Numbers

    @staticmethod
    def of(runs: Sequence[NoiseSigns], serial: Numbers) -> _Runs:
        parts = [np.unpackbits(np.frombuffer(base64.b64decode(one.signs), np.uint8))[: one.count] for one in runs]
        count = np.array([len(part) for part in parts])
        signs = np.concatenate(parts)
        packed = np.r_[np.packbits(signs), np.zeros(2 * _WORD // 8 + 8, np.uint8)]
        eight = np.lib.stride_tricks.sliding_window_view(packed, 8)
        words = np.ascontiguousarray(eight).view(">u8")[:, 0].astype(np.uint64)
        return _Runs(signs, words, np.cumsum(count) - count, count, serial)

    def alike(self) -> list[tuple[int, int, int, float]]:
        """Pairs of runs of different serials with the same noise: the earlier one first, signs in common, likeness."""
        met = np.unique(np.concatenate([self._met(np.random.default_rng(k)) for k in range(_WINDOWS)]))
        pair, lag = met >> _LAG_BITS, (met & (2**_LAG_BITS - 1)) - 2 ** (_LAG_BITS - 1)
        one, other = pair // len(self.start), pair % len(self.start)
        first, other_first = np.maximum(0, -lag), np.maximum(0, lag)
        both = np.minimum(self.count[one] - first, self.count[other] - other_first)
        excess = self._excess(self.start[one] + first, self.start[other] + other_first, both)
        likeness = np.sin(0.5 * np.pi * excess)  # of Gaussian noise whose signs agree so often
        independent = 2.0 * (FASTEST_SIGNS - SLOWEST) * both
        kept = np.flatnonzero((likeness >= _ALIKE) & (excess * np.sqrt(independent) >= _SIGMAS))
        columns = (one[kept], other[kept], both[kept], likeness[kept])
        return list(zip(*(column.tolist() for column in columns), strict=True))

    def _met(self, rng: np.random.Generator) -> Numbers:
        """Pairs of runs, and lags, at which windows have the same number: signs at drawn places, against the first.

        A window counts if the second sign is another than the first and the third is the same: one in four. Signs are
        as many as leave each window about one foreign one with its number, so that time goes with the signs in all.
        """
        bits = min(max(round(math.log2(len(self.signs) / 4.0)), _NARROWEST), _WIDEST)
        offsets = np.r_[0, np.cumsum(rng.integers(_GAPS[0], _GAPS[1] + 1, 2 + bits))]
        n = len(self.signs) - int(offsets[-1])
        if n <= 0:
            return np.zeros(0, np.int64)
        run = np.repeat(np.arange(len(self.start), dtype=np.int32), self.count)
        second, third = (self.signs[o : o + n] ^ self.signs[:n] for o in offsets[1:3])
        whole = run[:n] == run[int(offsets[-1]) :]
        at = np.flatnonzero(whole & (second == 1) & (third == 0))
        number = self._numbers(at, offsets)
        order = np.argsort(number, kind="stable")
        number, at = number[order], at[order]
        run, found = run[at].astype(np.int64), [np.zeros(0, np.int64)]
        for step in range(1, _CROWD):
            same = np.flatnonzero(number[step:] == number[:-step])
            if len(same) == 0:
                break
            same = same[self.serial[run[same]] != self.serial[run[same + step]]]
            found.append(self._looked_at(run[same], at[same], run[same + step], at[same + step]))
        return np.concatenate(found)

    def _numbers(self, at: Numbers, offsets: Numbers) -> NDArray[np.uint64]:
        """A number for each window: its signs against its first, in two words."""
        chosen = np.zeros(2 * _WORD, np.uint64)
        chosen[offsets] = 1
        masks = [int("".join(map(str, half)), 2) for half in chosen.reshape(2, _WORD).tolist()]
        turned = np.where(self.signs[at] == 1, np.uint64(2**_WORD - 1), np.uint64(0))
        low, high = ((self._from(at + k * _WORD) ^ turned) & np.uint64(m) for k, m in enumerate(masks))
        return np.asarray(low * _MIX ^ high)

    def _looked_at(self, one: Numbers, at: Numbers, other: Numbers, other_at: Numbers) -> Numbers:
        """Those pairs, and lags, whose signs about a window agree, too."""
        place, other_place = at - self.start[one], other_at - self.start[other]
        before = np.minimum(np.minimum(place, other_place), _WORD)
        after = np.minimum(self.count[one] - place, self.count[other] - other_place)
        count = np.minimum(before + after, _FIRST_LOOK)
        kept = self._excess(at - before, other_at - before, count) >= _LEAST_EXCESS
        lag = (other_place - place)[kept] + 2 ** (_LAG_BITS - 1)
        return np.asarray(((one[kept] * len(self.start) + other[kept]) << _LAG_BITS) + lag)

    def _excess(self, one: Numbers, other: Numbers, count: Numbers) -> FloatArray:
        """By how much more of so many signs from two places on agree than differ, or the other way round: 0 to 1."""
        differ = np.zeros(len(count), np.int64)
        for done in range(0, int(count.max(initial=0)), _WORD):
            left = np.flatnonzero(count > done)
            words = self._from(one[left] + done) ^ self._from(other[left] + done)
            words >>= np.maximum(0, _WORD - (count[left] - done)).astype(np.uint64)
            differ[left] += _ones(words)
        return np.asarray(np.abs(1.0 - 2.0 * differ / count))

    def _from(self, place: Numbers) -> NDArray[np.uint64]:
        """`_WORD` signs from each place on, the first one in the highest bit."""
        return np.asarray((self.words[place >> 3] << (place & 7).astype(np.uint64)) >> np.uint64(64 - _WORD))


def _ones(words: NDArray[np.uint64]) -> Numbers:
    """How many bits of each word are set: sums of neighbours, twice as wide each time."""
    for width, mask in ((1, 0x5555555555555555), (2, 0x3333333333333333), (4, 0x0F0F0F0F0F0F0F0F)):
        words = (words & np.uint64(mask)) + ((words >> np.uint64(width)) & np.uint64(mask))
    return np.asarray((words * np.uint64(0x0101010101010101)) >> np.uint64(56), np.int64)
