"""Round a model to a table, check that the runtime takes it, and add known answers.

The ranges are read from the runtime's own text, libc/gtc_limits.inl, so that the generator cannot emit what
`gtc_<n>_open` and `gtc_<n>_check` refuse. The conditions on several words are those of libc/gtc_open.inl;
tests/cases/mirror/test_reference.py holds both sides against each other.

In float32 they are chosen, among many, to come out otherwise where a compiler fuses a product into a sum, whichever
sum it is: the self-test of the target must not pass by luck.

After it only 32-bit words exist. The bound that a table carries covers arithmetic, rounded parameters and rounded
inputs against the model in float64; extension terms are not part of it, curves and products of channels have a bound
of their own. What rounding costs is stated as the growth of the residual's RMS that it can cause, and never a reason
to refuse a table.
"""

from __future__ import annotations

import functools
import math
import re
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..common.errors import CheckFailed, InputError, quoted
from ..common.inputs import PLAUSIBLE_C, runtime_folders
from ..mirror.f32 import FUSIBLE
from ..mirror.front_end import missed_before, samples_per_block
from ..mirror.history import evaluate_map, replay
from ..mirror.kinds import TableKind
from ..mirror.sigma import RULES
from ..mirror.table import ARRAYS, Table, Words
from ..model import Model, load_model
from ..recordings.records import Applied, Rows
from ..results.base import NUMERICS
from . import f32, q31
from .error_bounds import channel_error_dph, with_authority

__all__ = ["NUMERICS", "N_PROBES", "Table", "outside", "quantise", "rms_growth", "rounding_bound_dph", "with_probes"]

_ROW = re.compile(r"RANGE\((.*?)\),(?:\s*/\* ([^*]*?) \*/)?$")
_NAME = re.compile(r"^#define (GTC_\w+) (\d+)U?\b", re.MULTILINE)
# Words of a table before its arrays, and the first of them that counts records: docs/FORMAT.md, section 3
_N_WHOLE, _N_NUMBERS, _FIRST_COUNT = 19, 13, 9
_REACH = np.float32(8.0)  # half ranges to which a normalised input may go
_WIDTH = np.float32(2.0**-100)  # narrowest range: what is divided by it stays finite
_SUM = 2**30  # of the magnitudes of weights, so that no sum overflows: docs/numerics.md, section 3
# In the units of either arithmetic.
_PLAUSIBLE = {"f32": PLAUSIBLE_C, "q31": tuple(int(limit * 65536) for limit in PLAUSIBLE_C)}
_SPAN = 2**26 - 1  # of an input in 2^-16 C: five bits more are 31 (libc/gtc_q31.c)
_LAST_POSITION = 65535  # 16 bits of an input: docs/numerics.md, section 3
_MAX_WORDS = 0x4000  # of the arrays of a table, MAX_TABLE_WORDS of libc/gtc_check.inl
_LARGEST = 2**31 - 1  # a signed 32-bit word

WordLimits = list[tuple[str, float, float]]  # of words in order: name, least, most


def outside(table: Table, frac_bits: int = q31.DEFAULT_BITS) -> str | None:
    """Return the first word or condition that the runtime refuses, in words; None if it takes the table.

    Args:
        frac_bits: Fraction bits of a bias in fixed point that the runtime decodes.
    """
    return next(_refused(table, frac_bits), None)


def _refused(table: Table, frac_bits: int) -> Iterator[str]:
    limits = word_limits(table.numeric, frac_bits)
    whole, numbers, network, center, guard, guard_whole, term, sigma = limits
    header, ends = table.header[2:], _FIRST_COUNT + _N_NUMBERS
    yield from _beyond(header[:_FIRST_COUNT] + header[ends:], whole)
    n_words = sum(int(getattr(table, name).size) for name in ARRAYS)
    if n_words > _MAX_WORDS:
        yield f"a table of {n_words} words in its arrays, more than {_MAX_WORDS}"
    if table.networks.size == 0 or table.n_channels == 0:
        return
    yield from _beyond(table.numbers(header[_FIRST_COUNT:ends]), numbers)
    low, high = table.numbers(table.authority)
    if not low <= table.numbers([table.fallback])[0] <= high:
        yield "fallback is beyond the authority"
    cells = table.sigma_cells[0] * table.sigma_cells[1]
    words = table.sigma_grids * cells + RULES + table.terms.size // ARRAYS["terms"]
    if table.sigma.size and (cells == 0 or table.sigma.size != words):
        yield f"sigma has not {table.sigma_grids} words for each of its cells, one for each rule and each term"
    yield from _guards(table, guard, guard_whole)
    records = table.records("networks")
    if int(records[:, 0].sum(dtype=np.uint64)) != table.n_centers:
        yield "networks that do not share out the centers"
    yield from _each(table, records[:, 1:], network)
    yield from _each(table, table.records("centers"), center)
    yield from _terms(table, term)
    yield from _each(table, table.sigma.reshape(-1, 1), sigma)
    yield from _regions(table, records)
    yield from (_f32 if table.numeric == "f32" else _q31)(table, records)


def _beyond(found: Any, limits: WordLimits) -> Iterator[str]:
    for value, (name, least, most) in zip(found, limits, strict=True):
        if not least <= float(value) <= most:
            yield f"{name} is {float(value):g}, not in {least:g} ... {most:g}"


def _each(table: Table, records: NDArray[np.uint32], limits: WordLimits) -> Iterator[str]:
    for record in records:
        yield from _beyond(table.numbers(record), limits)


def _guards(table: Table, limits: WordLimits, wholes: WordLimits) -> Iterator[str]:
    for channel, record in enumerate(table.records("guards")):
        numbers = table.numbers(record)
        yield from _beyond(numbers[:4], limits)
        yield from _beyond(record[4:7], wholes)
        yield from _beyond(numbers[7:], [("guard: fallback", *limits[0][1:])])
        low, high = (_PLAUSIBLE[table.numeric]) if channel == 0 else (numbers[0], numbers[1])
        if not low <= numbers[0] <= numbers[1] <= high:
            yield "range of a guard is reversed, or wider than that of a temperature"
        if channel and not numbers[0] <= numbers[7] <= numbers[1]:
            yield "fallback of a guard is beyond its range"


def _terms(table: Table, limits: WordLimits) -> Iterator[str]:
    width, last = ARRAYS["terms"] - 2, table.n_networks
    if last < 1:
        yield "no network is left to the map"
    for record, channel, fallback_model in zip(
        table.records("terms"), table.channels, table.fallback_models, strict=True
    ):
        kind = int(record[0])
        last += fallback_model != 0
        if fallback_model and (fallback_model != last or channel == 0):
            yield f"fallback model of a term is network {fallback_model}"
        if not 1 <= kind <= len(limits) // width:
            yield f"kind of a term is {kind}"
        elif channel >= table.n_channels or (channel != 0) != TableKind(kind).description.reads_channel:
            yield f"channel of a term is {channel}"
        else:
            yield from _beyond(table.numbers(record[2:]), limits[(kind - 1) * width : kind * width])


def _regions(table: Table, records: NDArray[np.uint32]) -> Iterator[str]:
    for record in records:
        edges = table.numbers(record[4:])
        for low, high in (edges[:2], edges[2:]):
            wide = high - low >= _WIDTH if table.numeric == "f32" else low < high
            if not (wide or (table.n_networks == 1 and low <= high)):
                yield "region of a network has no width"


def _f32(table: Table, records: NDArray[np.uint32]) -> Iterator[str]:
    center, *gains = table.numbers(table.scale)
    edges = table.numbers(table.envelope).reshape(2, 2)
    for axis, ((low, high), gain, offset) in enumerate(zip(edges, gains, (center, np.float32(0.0)), strict=True)):
        if not (high - low >= _WIDTH or table.envelope[2 * axis] == table.envelope[2 * axis + 1]):
            yield "envelope is reversed or too narrow"
        with np.errstate(all="ignore"):
            reach = [(edge - offset) * gain for edge in (low, high)]
        if not all(-_REACH <= z <= _REACH for z in reach):
            yield "envelope reaches beyond 8 half ranges of the model's scale"


def _q31(table: Table, records: NDArray[np.uint32]) -> Iterator[str]:
    gains = table.numbers(table.scale).tolist()[:2]
    edges = table.numbers(table.envelope).reshape(2, 2).tolist()
    for (low, high), gain in zip(edges, gains, strict=True):
        span = high - low
        if not (0 <= span <= _SPAN and (span * 32 * gain) >> 32 <= _LAST_POSITION):
            yield "envelope is reversed, too wide, or its positions end beyond 65535"
    centers = table.numbers(table.records("centers"))
    last = centers[:, [0, 2]] * _LAST_POSITION + centers[:, [1, 3]]
    if np.any(np.abs(last) > _LARGEST):
        yield "argument of a Gaussian leaves 32 bits"
    first = 0
    for record in records:
        own = slice(first, first + int(record[0]))
        first = own.stop
        total = int(np.abs(table.numbers(record[1:4])).sum() + np.abs(centers[own, 4]).sum())
        if total > _SUM:
            yield f"magnitudes of a network's weights make {total}, more than {_SUM}"


@functools.cache
def word_limits(numeric: str, frac_bits: int) -> tuple[WordLimits, ...]:
    """Rows of libc/gtc_limits.inl for one arithmetic and the unit of its runtime.

    They are those of whole numbers, numbers, network, center, guard, terms, sigma.
    """
    include, libc = runtime_folders()
    headers = [(include / name).read_text(encoding="ascii") for name in ("gtc_config.h", "gtc_table.h")]
    names = dict(_NAME.findall("".join(headers)))
    names |= {"GTC_BIAS_FRAC_BITS": str(frac_bits), "GTC_MAX_CHANNELS": str(1 + int(names["GTC_MAX_TERMS"]))}
    first = 0 if numeric == "f32" else 2
    rows: WordLimits = []
    for line in (libc / "gtc_limits.inl").read_text(encoding="ascii").splitlines():
        if match := _ROW.search(line):
            values = [_number(text, names) for text in match[1].split(",")]
            rows.append((match[2] or "what a term does not use", values[first], values[first + 1]))
    of_terms = len(TableKind) * (ARRAYS["terms"] - 2)
    sizes = [
        _N_WHOLE, _N_NUMBERS, ARRAYS["networks"] - 1, ARRAYS["centers"], 4, 3, of_terms, 1,
    ]  # fmt: skip
    ends = np.cumsum(sizes).tolist()
    assert ends[-1] == len(rows), "libc/gtc_limits.inl has other rows than a table has words"
    return tuple(rows[end - size : end] for size, end in zip(sizes, ends, strict=True))


def _number(text: str, names: dict[str, str]) -> float:
    """Value of a sum of constants of C."""
    total, sign = 0.0, 1.0
    for word in text.split():
        if word in "+-":
            sign = 1.0 if word == "+" else -1.0
        else:
            total += sign * float(names.get(word, word.rstrip("UF")))
    return total


N_PROBES = 8  # known answers in a table: docs/FORMAT.md, section 3
_CANDIDATES = 256  # inputs of which the most telling are taken; more find no better ones
_GOLDEN = (0.7548776662466927, 0.5698402909980532)  # 1/p, 1/p² of p³ = p + 1: an even spread in the plane
#: Each sum fused alone, and what compilers make of all: either of the squares, with everything else.
_BUILDS = (
    *(frozenset({place}) for place in FUSIBLE),
    *(frozenset(FUSIBLE) - {place} for place in ("square of T", "square of slope")),
)


def with_probes(model: Model, table: Table) -> Table:
    """The table with its known answers: six points inside the envelope, and one beyond either corner."""
    k = np.arange(1, _CANDIDATES + 1)[:, None]
    inside = _inputs(model, table, (k * _GOLDEN) % 1.0)
    n = N_PROBES - 2
    chosen = _telling(table, inside, n) if table.numeric == "f32" else list(range(n))
    corners = _inputs(model, table, np.array([[-0.25, -0.25], [1.25, 1.25]]))
    inputs = np.concatenate([inside[chosen], corners])
    status, bits = evaluate_map(table, inputs)
    records = np.concatenate([inputs, bits[:, None], status.astype(np.uint32)[:, None]], axis=1)
    return replace(table, probes=records.reshape(-1))


def _inputs(model: Model, table: Table, where: NDArray[Any]) -> Words:
    """Inputs at shares of the envelope, shape (n, 2)."""
    (t0, t1), (r0, r1) = model.envelope.temperature_c, model.envelope.slope_c_per_min
    low, span = np.array([t0, r0]), np.array([t1 - t0, r1 - r0])
    return table.encode_inputs((low + where * span) * np.array([1.0, model.block_s / 60.0]))


def _telling(table: Table, inputs: Words, n: int) -> list[int]:
    """Numbers of the inputs that show most builds to be wrong, those first that no chosen one shows yet."""
    _, right = evaluate_map(table, inputs)
    tells = np.stack([evaluate_map(table, inputs, fused)[1] != right for fused in _BUILDS])
    known = np.zeros(len(_BUILDS))
    free = np.ones(len(inputs), dtype=np.bool_)
    chosen: list[int] = []
    for _ in range(n):
        worth = np.where(free, 2.0 ** (-8.0 * known) @ tells, -1.0)  # exact: sums of powers of two
        best = int(np.argmax(worth))
        chosen.append(best)
        free[best] = False
        known += tells[:, best]
    return chosen


_MAKERS = {"f32": f32.table_of, "q31": q31.table_of}


def quantise(model: Model, numeric: str) -> Table:
    """Table of a model in one arithmetic, with its known answers.

    Raises:
        InputError: An unknown arithmetic.
        CheckFailed: The arithmetic cannot hold the model.
    """
    if numeric not in _MAKERS:
        raise InputError("--numeric", quoted(numeric), " or ".join(NUMERICS))
    return _quantised(_Known(model.hash, model), numeric)


@dataclass(frozen=True, slots=True)
class _Known:
    """A model by its hash."""

    hash: str
    model: Model = field(compare=False)


@functools.lru_cache(maxsize=4)
def _quantised(known: _Known, numeric: str) -> Table:
    """Kept for the next stages of the same job, which ask again."""
    model = known.model.for_tables()
    try:
        with np.errstate(over="raise", invalid="raise", divide="raise"):
            rounded = with_authority(model, _MAKERS[numeric](model))
    except (FloatingPointError, ZeroDivisionError, OverflowError) as error:
        raise CheckFailed(f"{numeric}: a number of the model leaves the range of this arithmetic ({error})") from error
    refused = outside(rounded, rounded.bias_frac_bits)
    if refused is not None:
        raise CheckFailed(f"{numeric}: the runtime would refuse the table: {refused}")
    return rounded if "known_answers" in model.left_out else with_probes(model, rounded)


def rms_growth(model: Model, table: Table) -> float | None:
    """Return the share by which rounding can raise the RMS of a residual; None if the model states no noise floor.

    An error of rounding is constant at a constant temperature, so averaging does not reduce it: its bound is added, in
    squares, to the noise floor of means over the averaging time.
    """
    if not model.noise_floor_dph:
        return None
    return math.hypot(1.0, rounding_bound_dph(model, table) / model.noise_floor_dph) - 1.0


def rounding_bound_dph(model: Model, table: Table) -> float:
    """Return the bound of what rounding does to map and terms of channels, deg/h."""
    return table.error_bound_dph + channel_error_dph(model.for_tables(), table.numeric, table.bias_frac_bits)


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
    """A table in the first arithmetic that can hold the model: two differ by no more than their bounds."""
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
