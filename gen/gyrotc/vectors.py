"""Known-answer vectors: what `board_test.c` feeds to the emitted code, and what it must answer.

The inputs are made with integers only, by the same rules here and in the C program, so that a
faulty target cannot spoil them: directed map inputs (corners, cell edges, special values), random
map inputs, and a temperature history with holds, ramps and faults through the step functions.
The answers come from the reference, which loads no compiled code.
"""

from __future__ import annotations

import itertools
import struct
import zlib
from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from .model import Model

__all__ = ["MISSING", "Event", "Segment", "Vectors", "make_vectors"]

N_RANDOM = 20000
SAMPLES_PER_BLOCK = 8
MISSING = {"f32": 0x7FC00000, "q31": 0x80000000}
_SPECIAL_F32 = (
    0x00000000, 0x80000000, 0x00000001, 0x80000001, 0x007FFFFF, 0x00800000,
    0x7F7FFFFF, 0xFF7FFFFF, 0x7F800000, 0xFF800000, 0x7FC00000, 0xFFC00001, 0x7F800001,
)  # fmt: skip
_SPECIAL_Q31 = (0, 1, 0xFFFFFFFF, 0x7FFFFFFF, 0x80000000, 0x80000001, 0x00010000, 0xFFFF0000)


@dataclass(frozen=True, slots=True)
class Segment:
    """A piece of the history: `count` samples `start + j step` (2^-12 C) with noise, or a fault."""

    kind: str  # RAMP, BITS (the same bits again and again), MISSED, ALONE (the other channels are missing)
    count: int
    start: int
    step: int
    noise: int
    bits: dict[str, int]


@dataclass(frozen=True, slots=True)
class Event:
    """One call of a step function: a sample (bits of every channel), or `missed` samples."""

    channels: tuple[int, ...]
    missed: int = 0


@dataclass(frozen=True, slots=True)
class Vectors:
    """Inputs of the known-answer test of one table; see the module's head."""

    model: int
    seed: int
    n_random: int
    t_low: int
    t_span: int
    s_low: int
    s_span: int
    samples_per_block: int
    direct: dict[str, tuple[tuple[int, int], ...]]
    segments: tuple[Segment, ...]
    n_channels: int

    @property
    def n_direct(self) -> int:
        return len(next(iter(self.direct.values())))

    def map_inputs(self, numeric: str) -> NDArray[np.uint32]:
        """Bits of (temperature, slope) of all map vectors, shape (n, 2)."""
        draw = _Draw(self.seed)
        words = []
        to_bits = _BITS[numeric]
        for _ in range(self.n_random):
            t, s = draw.between(self.t_low, self.t_span), draw.between(self.s_low, self.s_span)
            words.append((to_bits(t, 12), to_bits(s, 16)))
        return np.array([*self.direct[numeric], *words], dtype=np.uint32).reshape(-1, 2)

    def events(self, numeric: str) -> Iterator[Event]:
        """The calls of the step functions, in order (the draws go on after those of the map)."""
        draw = _Draw(self.seed)
        to_bits = _BITS[numeric]
        for _ in range(2 * self.n_random):
            draw.next()
        for segment in self.segments:
            if segment.kind == "MISSED":
                yield Event((), segment.count)
                continue
            for j in range(segment.count):
                noise = draw.between(-segment.noise, 2 * segment.noise + 1)
                others = [to_bits(draw.between(-4096, 8192), 12) for _ in range(1, self.n_channels)]
                if segment.kind == "ALONE":
                    others = [MISSING[numeric]] * len(others)
                t = segment.start + j * segment.step + noise
                held = segment.kind == "BITS"
                yield Event((segment.bits[numeric] if held else to_bits(t, 12), *others))


class _Draw:
    """Marsaglia's xorshift32, as in board_test.c."""

    def __init__(self, seed: int) -> None:
        self._x = seed

    def next(self) -> int:
        x = self._x
        x ^= (x << 13) & 0xFFFFFFFF
        x ^= x >> 17
        x ^= (x << 5) & 0xFFFFFFFF
        self._x = x
        return x

    def between(self, low: int, span: int) -> int:
        return low + ((self.next() * span) >> 32)


def _f32_bits(n: int, fraction_bits: int) -> int:
    """Bits of n 2^-fraction_bits, rounded to nearest even where n has more than 24 bits."""
    return int(struct.unpack("<I", struct.pack("<f", n * 2.0**-fraction_bits))[0])


def _q31_bits(n: int, fraction_bits: int) -> int:
    return (n << (16 - fraction_bits)) & 0xFFFFFFFF


_BITS = {"f32": _f32_bits, "q31": _q31_bits}


def make_vectors(model: Model, numerics: tuple[str, ...]) -> Vectors:
    """Vectors of a model. Depends on the model alone."""
    (t0, t1), (r0, r1) = model.envelope.temperature_c, model.envelope.slope_c_per_min
    per_block = model.block_s / 60.0
    t_low, t_high = round((t0 - 0.1 * (t1 - t0) - 1.0) * 4096), round((t1 + 0.1 * (t1 - t0) + 1.0) * 4096)
    s_margin = 0.1 * (r1 - r0) + 0.01
    steepest = 2**30  # 2^-16 C per block; more does not fit a fixed-point slope
    s_low, s_high = (
        min(max(round(r * per_block * 65536), -steepest), steepest) for r in (r0 - s_margin, r1 + s_margin)
    )
    return Vectors(
        model=int(model.hash[:8], 16),
        seed=zlib.crc32(model.hash.encode("ascii")) | 1,
        n_random=N_RANDOM,
        t_low=t_low,
        t_span=t_high - t_low,
        s_low=s_low,
        s_span=s_high - s_low,
        samples_per_block=SAMPLES_PER_BLOCK,
        direct={n: tuple(_direct(model, n)) for n in numerics},
        segments=tuple(_history(model, numerics)),
        n_channels=1 + len({t.channel for t in model.terms if t.channel}),
    )


def _direct(model: Model, numeric: str) -> Iterator[tuple[int, int]]:
    """Corners, edges of the coverage cells and their neighbours, centers, then special values."""
    cells = model.coverage.cells if model.coverage else (4, 4)
    t_edges = np.linspace(*model.envelope.temperature_c, min(cells[0], 24) + 1)
    r_edges = np.linspace(*model.envelope.slope_c_per_min, min(cells[1], 12) + 1)
    per_block = model.block_s / 60.0
    middle = (float(t_edges.mean()), float(r_edges.mean()))
    thirds = ((e[0], e[len(e) // 2], e[-1]) for e in (t_edges, r_edges))
    points = list(itertools.product(*thirds))
    points += [(t, middle[1]) for t in t_edges] + [(middle[0], r) for r in r_edges]
    points += [c for network in model.networks for c in network.centers][:32]
    special = _SPECIAL_F32 if numeric == "f32" else _SPECIAL_Q31
    inside = _one(numeric, middle[0]), _one(numeric, middle[1] * per_block)
    for t, r in points:
        t_bits, s_bits = _one(numeric, t), _one(numeric, r * per_block)
        for dt, ds in ((0, 0), (1, 0), (-1, 0), (0, 1), (0, -1)):
            yield (t_bits + dt) & 0xFFFFFFFF, (s_bits + ds) & 0xFFFFFFFF
    # Padded to one length, so that both arithmetics have equally many vectors.
    for k in range(16):
        word = special[k % len(special)]
        yield word, inside[1]
        yield inside[0], word
        yield word, special[(k + 3) % len(special)]


def _one(numeric: str, value: float) -> int:
    if numeric == "f32":
        return int(struct.unpack("<I", struct.pack("<f", value))[0])
    return int(np.clip(round(value * 65536), -(2**31) + 1, 2**31 - 1)) & 0xFFFFFFFF


def _history(model: Model, numerics: tuple[str, ...]) -> Iterator[Segment]:
    """Start-up, hold, ramps over the envelope and beyond, then every fault, and recovery from it."""
    zero = dict.fromkeys(numerics, 0)
    n = SAMPLES_PER_BLOCK
    (t0, t1) = (round(t * 4096) for t in model.envelope.temperature_c)
    rate = max(model.envelope.slope_c_per_min[1], -model.envelope.slope_c_per_min[0], 0.1)
    # A ramp at the envelope's rate, but with at most 1500 samples.
    step = max(min(round(rate * model.block_s / 60.0 / n * 4096), t1 - t0), (t1 - t0) // 1500, 1)
    span = (t1 - t0) // step + 1
    window = n * (model.slope_blocks + 2)
    t = (t0 + t1) // 2

    def ramp(count: int, start: int, step: int = 0, noise: int = 0) -> Segment:
        return Segment("RAMP", count, start, step, noise, zero)

    def bits(count: int, which: str) -> Segment:
        words = {"missing": MISSING, "hot": {"f32": 0x7149F2CA, "q31": 250 << 16}}[which]
        return Segment("BITS", count, 0, 0, 0, {k: words[k] for k in numerics})

    yield bits(3, "missing")
    yield ramp(window, t, noise=40)
    yield ramp(span // 2, t, step, noise=40)
    yield ramp(window, t + step * (span // 2))
    yield ramp(span, t1, -step, noise=200)
    yield ramp(window // 2, t0 - step * 8, 0, noise=5)
    yield ramp(span // 2, t0, step, noise=40)
    for missing in (1, n // 2, n // 2 + 1, n, 3 * n):
        yield bits(missing, "missing")
        yield ramp(window // 2, t, noise=40)
    yield Segment("MISSED", 5, 0, 0, 0, zero)
    yield ramp(window, t, noise=40)
    yield bits(2, "hot")
    yield ramp(window // 2, t, noise=40)
    # One, two and three suspects in a row: held, held, then the new truth.
    jump = round(4096 * (4.0 * model.max_step_c + 20.0))
    inward = -jump if t + jump > 190 * 4096 else jump
    for suspects in (1, 2, 3 * n):
        yield ramp(suspects, t + inward, noise=3)
        yield ramp(window // 2, t, noise=40)
    yield Segment("MISSED", n * (model.hold_blocks + 3), 0, 0, 0, zero)
    yield ramp(window, t, noise=40)
    if any(t.channel for t in model.terms):
        # Fewer than half of a block's samples, half of them, and blocks without any.
        for alone in (n // 2 + 1, n // 2, 2 * n + 3):
            yield replace(ramp(alone, t, noise=40), kind="ALONE")
            yield ramp(3 * n - alone % n, t, noise=40)
    if model.stuck_samples:
        yield ramp(min(model.stuck_samples + 3 * n, 4000), t)
        yield ramp(window, t, noise=40)
    yield ramp(window, t, max(step // 7, 1), noise=2)
