"""Whether the runtime takes a table: every word in its range, and what relates several words.

The ranges are read from the runtime's own text, libc/gtc_limits.inl, so that the generator cannot emit what
`gtc_<n>_open` and `gtc_<n>_check` refuse. The conditions on several words are those of libc/gtc_table.inl;
tests/py/test_words.py holds both sides against each other.
"""

from __future__ import annotations

import functools
import re
from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..common.runtime import runtime_folders
from ..target.recursion import TableKind
from ..target.squares import RULES
from ..target.table import ARRAYS, Table

__all__ = ["outside"]

_ROW = re.compile(r"RANGE\((.*?)\),(?:\s*/\* ([^*]*?) \*/)?$")
_NAME = re.compile(r"^#define (GTC_\w+) (\d+)U?\b", re.MULTILINE)
# Words of a table before its arrays, and the first of them that counts records: docs/FORMAT.md, section 3
_N_WHOLE, _N_NUMBERS, _FIRST_COUNT = 18, 13, 8
_REACH = np.float32(8.0)  # half ranges to which a normalised input may go
_WIDTH = np.float32(2.0**-100)  # narrowest range: what is divided by it stays finite
_SUM = 2**30  # of the magnitudes of weights, so that no sum overflows: docs/numerics.md, section 3
# C, in the units of either arithmetic: the target holds temperatures outside (docs/numerics.md, section 1)
_PLAUSIBLE = {"f32": (-90.0, 200.0), "q31": (-90 * 65536, 200 * 65536)}
_SPAN = 2**26 - 1  # of an input in 2^-16 C: five bits more are 31 (libc/gtc_q31.c)
_LAST_POSITION = 65535  # 16 bits of an input: docs/numerics.md, section 3
_LARGEST = 2**31 - 1  # a signed 32-bit word

Limits = list[tuple[str, float, float]]  # of words in order: name, least, most


def outside(table: Table) -> str | None:
    """The first word or condition that the runtime refuses, in words; None if it takes the table."""
    return next(_refused(table), None)


def _refused(table: Table) -> Iterator[str]:
    limits = _limits(table.numeric)
    whole, numbers, network, center, guard, guard_whole, term, sigma = limits
    header, ends = table.header[2:], _FIRST_COUNT + _N_NUMBERS
    yield from _beyond(header[:_FIRST_COUNT] + header[ends:], whole)
    if table.networks.size == 0 or table.n_channels == 0:
        return
    yield from _beyond(table.numbers(header[_FIRST_COUNT:ends]), numbers)
    low, high = table.numbers(table.authority)
    if not low <= table.numbers([table.fallback])[0] <= high:
        yield "fallback is beyond the authority"
    cells = table.sigma_cells[0] * table.sigma_cells[1]
    words = 2 * cells + RULES + table.terms.size // ARRAYS["terms"]
    if table.sigma.size and (cells == 0 or table.sigma.size != words):
        yield "sigma has not a word for each of its cells, twice, each rule and each term"
    yield from _guards(table, guard, guard_whole)
    records = table.networks.reshape(-1, ARRAYS["networks"])
    if int(records[:, 0].sum(dtype=np.uint64)) != table.n_centers:
        yield "networks that do not share out the centers"
    yield from _each(table, records[:, 1:], network)
    yield from _each(table, table.centers.reshape(-1, ARRAYS["centers"]), center)
    yield from _terms(table, term)
    yield from _each(table, table.sigma.reshape(-1, 1), sigma)
    yield from _regions(table, records)
    yield from (_f32 if table.numeric == "f32" else _q31)(table, records)


def _beyond(found: Any, limits: Limits) -> Iterator[str]:
    for value, (name, least, most) in zip(found, limits, strict=True):
        if not least <= float(value) <= most:
            yield f"{name} is {float(value):g}, not in {least:g} ... {most:g}"


def _each(table: Table, records: NDArray[np.uint32], limits: Limits) -> Iterator[str]:
    for record in records:
        yield from _beyond(table.numbers(record), limits)


def _guards(table: Table, limits: Limits, wholes: Limits) -> Iterator[str]:
    for channel, record in enumerate(table.guards.reshape(-1, ARRAYS["guards"])):
        numbers = table.numbers(record)
        yield from _beyond(numbers[:4], limits)
        yield from _beyond(record[4:7], wholes)
        yield from _beyond(numbers[7:], [("guard: fallback", *limits[0][1:])])
        low, high = (_PLAUSIBLE[table.numeric]) if channel == 0 else (numbers[0], numbers[1])
        if not low <= numbers[0] <= numbers[1] <= high:
            yield "range of a guard is reversed, or wider than that of a temperature"
        if channel and not numbers[0] <= numbers[7] <= numbers[1]:
            yield "fallback of a guard is beyond its range"


def _terms(table: Table, limits: Limits) -> Iterator[str]:
    width, last = ARRAYS["terms"] - 2, table.n_networks
    if last < 1:
        yield "no network is left to the map"
    for record, channel, stand_in in zip(
        table.terms.reshape(-1, ARRAYS["terms"]), table.channels, table.stand_ins, strict=True
    ):
        kind = int(record[0])
        last += stand_in != 0
        if stand_in and (stand_in != last or channel == 0):
            yield f"stand-in of a term is network {stand_in}"
        if not 1 <= kind <= len(limits) // width:
            yield f"kind of a term is {kind}"
        elif channel >= table.n_channels or (channel != 0) != TableKind(kind).reads_channel:
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
    for axis, ((low, high), gain, offset) in enumerate(
        zip(edges, gains, (center, np.float32(0.0)), strict=True)
    ):
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
    centers = table.numbers(table.centers).reshape(-1, ARRAYS["centers"])
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
def _limits(numeric: str) -> tuple[Limits, ...]:
    """Rows of libc/gtc_limits.inl for one arithmetic: whole numbers, numbers, network, center, guard, terms, sigma."""
    include, libc = runtime_folders()
    headers = [(include / name).read_text(encoding="ascii") for name in ("gtc_config.h", "gtc_table.h")]
    names = dict(_NAME.findall("".join(headers)))
    first = 0 if numeric == "f32" else 2
    rows: Limits = []
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
