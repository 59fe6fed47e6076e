"""Known-answer vectors: what `board_test.c` feeds to the emitted code, and what it must answer.

The inputs are made with integers only, by the same rules here and in the C program, so that a
faulty target cannot spoil them: directed map inputs (corners, cell edges, special values), random
map inputs, and a temperature history with holds, ramps and faults through the step functions.
The answers come from the reference, which loads no compiled code.
"""

from __future__ import annotations

import functools
import itertools
import struct
import zlib
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ..mirror.front_end import period_us
from ..mirror.history import Calls
from ..model import Model
from .rounding import channel_names, guard_of

N_RANDOM = 20000  # a fault that shows in one input of a thousand is missed with a chance of 2e-9
SAMPLES_PER_BLOCK = 8  # short blocks, so that a few thousand samples make hundreds of corrections
# A quiet NaN, and the word that fixed point has for no value (docs/FORMAT.md)
MISSING_READING = {"f32": 0x7FC00000, "q31": 0x80000000}
_SPECIAL_F32 = (
    0x00000000, 0x80000000, 0x00000001, 0x80000001, 0x007FFFFF, 0x00800000,
    0x7F7FFFFF, 0xFF7FFFFF, 0x7F800000, 0xFF800000, 0x7FC00000, 0xFFC00001, 0x7F800001,
)  # fmt: skip
# Ends of the range, both sides of 0, and a power of two with its opposite
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
    period_us: int
    direct: dict[str, tuple[tuple[int, int], ...]]
    segments: tuple[Segment, ...]
    n_channels: int

    @property
    def n_direct(self) -> int:
        return len(next(iter(self.direct.values())))

    def map_inputs(self, numeric: str) -> NDArray[np.uint32]:
        """Bits of (temperature, slope) of all map vectors, shape (n, 2)."""
        draws = self._draws()[: 2 * self.n_random].reshape(-1, 2)
        t = _scaled(draws[:, 0], self.t_low, self.t_span)
        slope = _scaled(draws[:, 1], self.s_low, self.s_span)
        drawn = np.stack([_bits(numeric, t, 12), _bits(numeric, slope, 16)], axis=1)
        return np.concatenate([np.array(self.direct[numeric], dtype=np.uint32).reshape(-1, 2), drawn])

    def calls(self, numeric: str) -> Calls:
        """The calls of the step functions (the draws go on after those of the map)."""
        draws = self._draws()[2 * self.n_random :]
        channels, missed = [], []
        for segment in self.segments:
            if segment.kind == "MISSED":
                channels.append(np.zeros((1, self.n_channels), dtype=np.uint32))
                missed.append(np.array([segment.count], dtype=np.int64))
                continue
            used, draws = np.split(draws, [segment.count * self.n_channels])
            channels.append(_samples(segment, numeric, used.reshape(-1, self.n_channels)))
            missed.append(np.zeros(segment.count, dtype=np.int64))
        return Calls(np.concatenate(channels), np.concatenate(missed))

    def _draws(self) -> NDArray[np.uint32]:
        """All random numbers, those of the map vectors first."""
        samples = sum(s.count for s in self.segments if s.kind != "MISSED")
        return _draws(self.seed, 2 * self.n_random + samples * self.n_channels)


def _samples(segment: Segment, numeric: str, draws: NDArray[np.uint32]) -> NDArray[np.uint32]:
    """Bits of every channel of a segment's samples."""
    words = np.empty(draws.shape, dtype=np.uint32)
    noise = _scaled(draws[:, 0], -segment.noise, 2 * segment.noise + 1)
    steps = segment.start + segment.step * np.arange(segment.count, dtype=np.int64)
    words[:, 0] = segment.bits[numeric] if segment.kind == "BITS" else _bits(numeric, steps + noise, 12)
    alone = segment.kind == "ALONE"
    words[:, 1:] = MISSING_READING[numeric] if alone else _bits(numeric, _scaled(draws[:, 1:], -4096, 8192), 12)
    return words


@functools.lru_cache(maxsize=4)
def _draws(seed: int, count: int) -> NDArray[np.uint32]:
    """The first numbers of Marsaglia's xorshift32, as in board_test.c.

    A step is linear over the bits of the state. From 2^k numbers and what 2^k steps make of each state follow the next
    2^k numbers.
    """
    numbers, doublings = _stepped(np.array([seed], dtype=np.uint32)), 0
    while numbers.size < count:
        following = _after(_steps_of(doublings), numbers[: count - numbers.size])
        numbers, doublings = np.concatenate([numbers, following]), doublings + 1
    numbers.flags.writeable = False
    return numbers[:count]


@functools.cache
def _steps_of(doublings: int) -> NDArray[np.uint32]:
    """Return the state 2^doublings steps after each octet, the others being 0, shape (4, 256)."""
    bits = np.uint32(1) << np.arange(32, dtype=np.uint32)
    if doublings:
        half = _steps_of(doublings - 1)
        bits = _after(half, _after(half, bits))
    else:
        bits = _stepped(bits)
    made = np.zeros((4, 1), dtype=np.uint32)
    for of_bit in bits.reshape(4, 8).T:
        made = np.concatenate([made, made ^ of_bit[:, None]], axis=1)
    return made


def _stepped(x: NDArray[np.uint32]) -> NDArray[np.uint32]:
    x = x ^ (x << np.uint32(13))
    x = x ^ (x >> np.uint32(17))
    return np.asarray(x ^ (x << np.uint32(5)))


def _after(steps: NDArray[np.uint32], x: NDArray[np.uint32]) -> NDArray[np.uint32]:
    """States after some steps, by what these make of each octet."""
    result: NDArray[np.uint32] = steps[0][x & np.uint32(255)]
    for k in range(1, 4):
        result ^= steps[k][(x >> np.uint32(8 * k)) & np.uint32(255)]
    return result


def _scaled(draws: NDArray[np.uint32], low: int, span: int) -> NDArray[np.int64]:
    """Numbers in low ... low + span - 1; the product fits 64 bits for any span up to 2^31."""
    return low + ((draws.astype(np.int64) * span) >> 32)


def _bits(numeric: str, n: NDArray[np.int64], fraction_bits: int) -> NDArray[np.uint32]:
    """Bits of n 2^-fraction_bits; float32 rounds to nearest even where n has more than 24 bits."""
    if numeric == "f32":
        return (n * 2.0**-fraction_bits).astype(np.float32).view(np.uint32)
    return (n << (16 - fraction_bits)).astype(np.uint32)


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
        period_us=period_us(max(1, round(model.block_s * 1e6)), SAMPLES_PER_BLOCK),
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


def _history(model: Model, numerics: tuple[str, ...]) -> Iterator[Segment]:  # noqa: PLR0915 - one script
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
        words = {"missing": MISSING_READING, "hot": {"f32": 0x7149F2CA, "q31": 250 << 16}}[which]
        return Segment("BITS", count, 0, 0, 0, {k: words[k] for k in numerics})

    yield bits(3, "missing")
    yield ramp(window, t, noise=40)
    yield ramp(span // 2, t, step, noise=40)
    yield ramp(window, t + step * (span // 2))
    yield ramp(span, t1, -step, noise=200)
    yield ramp(window // 2, t0 - step * 8, 0, noise=5)
    yield ramp(span // 2, t0, step, noise=40)
    for missing in (1, n // 2, n // 2 + 1, n - 2, n - 1, n, 3 * n):
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
        # Fewer than half of a block's samples, half of them, two, one, and blocks without any.
        for alone in (n // 2 + 1, n // 2, n - 2, n - 1, 2 * n + 3):
            yield replace(ramp(alone, t, noise=40), kind="ALONE")
            yield ramp(3 * n - alone % n, t, noise=40)
    if model.fallback_models:
        # Lost, and a ramp over the envelope beside it; then it comes back.
        longest_s = max(guard_of(model, name).missing_s for name in channel_names(model))
        yield replace(ramp(min(round(longest_s / model.block_s * n) + 2 * n, 4000), t, noise=40), kind="ALONE")
        yield replace(ramp(span, t1, -step, noise=40), kind="ALONE")
        yield ramp(window, t, noise=40)
    if model.stuck_s:
        yield ramp(min(round(model.stuck_s / model.block_s * n) + 3 * n, 4000), t)
        yield ramp(window, t, noise=40)
    yield ramp(window, t, max(step // 7, 1), noise=2)


def answers_text(expected: Mapping[str, NDArray[np.uint32]]) -> bytes:
    """Text of the answers by arithmetic, each (status, bits), shape (n, 2)."""
    parts = [
        f"begin {numeric} {len(rows):08x}\n".encode("ascii") + _hex_lines(rows) for numeric, rows in expected.items()
    ]
    return b"".join(parts)


def _hex_lines(rows: NDArray[np.uint32]) -> bytes:
    """Two words a line, in eight hex digits each."""
    digits = np.frombuffer(rows.astype(">u4").tobytes().hex().encode("ascii"), dtype=np.uint8).reshape(-1, 16)
    lines = np.full((len(rows), 18), ord(" "), dtype=np.uint8)
    lines[:, :8], lines[:, 9:17], lines[:, 17] = digits[:, :8], digits[:, 8:], ord("\n")
    return lines.tobytes()
