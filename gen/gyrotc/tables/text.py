"""C text: a table with named members, and the numbers of the example."""

from __future__ import annotations

import math
import struct
from dataclasses import dataclass
from typing import Any

from ..common.texts import CText, c_code
from ..mirror.front_end import period_us
from ..mirror.table import LAYOUT, SERIAL_WORDS, Table
from ..model import Model
from .rounding import channel_names, guard_of

_EXAMPLE_US = 10000  # 100 samples a second


def example_values(model: Model) -> dict[str, Any]:
    """Return the readings of the example: the middle of the envelope, and the substitute of each further channel."""
    middle = round(sum(model.envelope.temperature_c) / 2.0, 1)
    readings = [middle, *(guard_of(model, name).fallback for name in channel_names(model))]
    return {
        "readings": [c_code(f"{middle:.1f}F"), *(c_code(f"{value:#.7g}F") for value in readings[1:])],
        "readings_q16": [round(value * 65536) for value in readings],
        "period_us": example_period_us(model),
        "samples": example_samples(model),
    }


def example_samples(model: Model) -> int:
    """Samples until the first start of the example is accepted, of every channel; at least three must agree."""
    longest_s = max(guard_of(model, name).agree_s for name in (None, *channel_names(model)))
    return max(math.ceil(longest_s * 1e6 / example_period_us(model)) + 1, 3 if longest_s else 1)


def example_period_us(model: Model) -> int:
    """A sample period that fits the model's block: 10 ms where it does, else a tenth of the block."""
    block_us = max(1, round(model.block_s * 1e6))
    return _EXAMPLE_US if block_us % _EXAMPLE_US == 0 else period_us(block_us, min(10, block_us))


_INTEGERS = (
    "quantity", "unit", "id", "calibrated", "block_us", "slope_blocks", "lead_blocks", "bias_frac_bits", "parts",
)  # fmt: skip
# Numbers of a member: docs/FORMAT.md, section 3
_NUMBERS = {"fallback": 1, "authority": 2, "effect": 2, "rezero": 1, "scale": 3, "envelope": 4}
_COUNTS = (
    "n_networks", "n_centers", "n_channels", "n_terms", "coverage_cells", "sigma_cells", "n_sigma", "n_probes",
)  # fmt: skip
# Words of a record: docs/FORMAT.md, section 3
_RECORDS = {"networks": 8, "centers": 5, "guards": 8, "terms": 8, "probes": 4}
_TITLES = {"f32": "float32", "q31": "fixed point"}
_ARRAY_COMMENTS = {
    "networks": "centers, w0, linear in T and slope, region: T min, max, slope min, max",
    "centers": "T: center, gain; slope: center, gain; weight",
    "serial": "four characters of the serial a word, the first one lowest",
    "guards": "low, high, max_step, max_rate, agree_us, stuck_us, missing_blocks, fallback",
    "terms": "kind, channel + 65536 * number of the fallback model among the networks, parameters",
    "coverage": "one bit for each cell of T (fastest) and slope, low bit first",
    "sigma": "1 sigma of the compensated bias, a row for each cell of slope",
    "probes": "known answers: T, slope, bias, status",
}
_HEAD_WORDS = 3  # magic, layout and arithmetic, length


@dataclass(frozen=True, slots=True)
class _Member:
    name: str
    text: CText
    comment: str = ""


@dataclass(frozen=True, slots=True)
class _Row:
    cells: CText
    comment: str


@dataclass(frozen=True, slots=True)
class _Array:
    name: str
    comment: str
    size: int
    rows: tuple[_Row, ...]


@dataclass(frozen=True, slots=True)
class TableText:
    """Text of a table for `table.c.j2`, in one arithmetic."""

    numeric: str
    title: str
    members: tuple[_Member, ...]
    arrays: tuple[_Array, ...]


def table_text(table: Table, model: Model) -> TableText:
    """Decode the words of an image into named members, in the order of gtc_table.h."""
    comments = _row_comments(model)
    words = iter(table.words[_HEAD_WORDS:])
    counts: dict[str, list[int]] = {}
    members = [_member("layout", str(LAYOUT))]
    for name in _INTEGERS:
        word = next(words)
        members.append(_member(name, f"0x{word:08x}UL" if name in ("id", "parts") else f"{word}UL"))
    for name, size in _NUMBERS.items():
        group = [_number(table.numeric, next(words)) for _ in range(size)]
        members.append(_member(name, f"{{ {', '.join(group)} }}" if size > 1 else group[0]))
    for name in _COUNTS:
        counts[name] = [next(words) for _ in range(2 if name.endswith("cells") else 1)]
        text = ", ".join(f"{n}UL" for n in counts[name])
        text = f"{table.n_networks}UL" if name == "n_networks" else text  # an image counts all
        members.append(_member(name, f"{{ {text} }}" if name.endswith("cells") else text))
    members.append(_member("n_fallback_models", f"{table.n_fallback_models}UL"))
    arrays = []
    for name, length in _array_lengths(counts).items():
        body = [next(words) for _ in range(length)]
        if length:
            arrays.append(_array(table.numeric, name, body, counts, comments.get(name, [])))
        members.append(_member(name, f"{table.numeric}_{name}" if length else "NULL"))
    members.append(_member("crc", f"0x{next(words):08x}UL"))
    return TableText(
        table.numeric,
        _TITLES[table.numeric],
        tuple(members),
        tuple(arrays),
    )


def _member(name: str, text: str) -> _Member:
    return _Member(name, c_code(text))


def _array_lengths(counts: dict[str, list[int]]) -> dict[str, int]:
    cells = counts["coverage_cells"]
    return {
        "serial": SERIAL_WORDS,
        "networks": counts["n_networks"][0] * _RECORDS["networks"],
        "centers": counts["n_centers"][0] * _RECORDS["centers"],
        "guards": counts["n_channels"][0] * _RECORDS["guards"],
        "terms": counts["n_terms"][0] * _RECORDS["terms"],
        "coverage": (cells[0] * cells[1] + 31) // 32,
        "sigma": counts["n_sigma"][0],
        "probes": counts["n_probes"][0] * _RECORDS["probes"],
    }


def _row_comments(model: Model) -> dict[str, list[str]]:
    """Return comments that give a row of an array in deg/h, C and C/min."""
    centers = [
        f"{t:.2f} C, {r:+.3f} C/min; widths {_width(d_t)}, {_width(d_r)}; {w:+.3e} deg/h"
        for n in (*model.networks, *model.fallback_models)
        for (t, r), (d_t, d_r), w in zip(n.centers, n.widths, n.weights, strict=True)
    ]
    channels = ["temperature_c", *channel_names(model)]
    fallback_models = [f"fallback model of {term.channel}" for term in model.terms if term.fallback_model is not None]
    networks = [*[""] * len(model.networks), *fallback_models]
    return {"networks": networks, "centers": centers, "guards": channels, "terms": [term.id for term in model.terms]}


def _width(width: float | None) -> str:
    return "infinite" if width is None else f"{width:.3f}"


def _array(numeric: str, name: str, body: list[int], counts: dict[str, list[int]], comments: list[str]) -> _Array:
    width = _RECORDS.get(name, (counts["sigma_cells"][0] or 6) if name == "sigma" else 6)
    rows = []
    for start in range(0, len(body), width):
        cells = [_word(numeric, w, integer=_is_integer(name, k)) for k, w in enumerate(body[start : start + width])]
        number = start // width
        rows.append(_Row(c_code(", ".join(cells)), comments[number] if number < len(comments) else ""))
    return _Array(name, _ARRAY_COMMENTS[name], len(body), tuple(rows))


def _is_integer(name: str, column: int) -> bool:
    """Words of a float32 table that are integers all the same."""
    return (
        name in ("serial", "coverage")
        or (name == "guards" and 4 <= column < 7)
        or (name == "networks" and column == 0)
        or (name == "terms" and column < 2)
        or (name == "probes" and column == 3)
    )


def _word(numeric: str, word: int, *, integer: bool) -> str:
    if integer:
        return f"B(0x{word:x}UL)"
    return f"V({float_text(word)})" if numeric == "f32" else f"B(0x{word:08x}UL)"


def _number(numeric: str, word: int) -> str:
    if numeric == "f32":
        return f"V({float_text(word)})"
    signed = word - 2**32 if word >= 2**31 else word
    return "(-2147483647L - 1L)" if signed == -(2**31) else f"{signed}L"


def float_text(word: int) -> str:
    """A float32 as a C constant: 9 significant digits, which read back to the same bits."""
    value = struct.unpack("<f", struct.pack("<I", word))[0]
    text = f"{value:.9g}"
    return (text if any(c in text for c in ".en") else text + ".0") + "F"
