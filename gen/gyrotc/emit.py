"""Write the C files of a model: tables, runtime, image, vectors, board test, example.

Stage 6 of the house (… → tables → **C** → proof → report). A pure function of the model: no date,
no path, no host, no version, so one model gives the same bytes on every machine. All arithmetic was
done in `quantise`; here integers are printed.
"""

from __future__ import annotations

import functools
import re
import shutil
import struct
import tempfile
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import jinja2
import numpy as np
from numpy.typing import NDArray

from .amalgamate import amalgamate, runtime_folders
from .errors import CheckFailed, InputError
from .model import Model
from .quantise import NUMERICS, Table, quantise
from .reference import answers
from .vectors import MISSING, make_vectors

__all__ = [
    "Emission",
    "answers_text",
    "emit",
    "emit_texts",
    "emitted_model",
    "emitted_tables",
    "quantise_all",
    "replace_folder",
]

LAYOUT = 1
_UNSIGNED, _NUMBER = "unsigned", "number"
_INTEGERS = ("quantity", "unit", "id", "slope_blocks", "hold_blocks", "stuck_samples", "bias_frac_bits")
_NUMBERS = ("max_step", "max_slope", "fallback")
_COUNTS = ("n_networks", "n_centers", "n_channels", "n_terms", "coverage_cells", "sigma_cells", "n_probes")
_RECORDS = {"networks": 8, "centers": 5, "terms": 8, "probes": 4}
_TITLES = {"f32": "float32", "q31": "fixed point"}
_ARRAY_COMMENTS = {
    "networks": "centers, w0, linear in T and slope, region: T min, max, slope min, max",
    "centers": "T: center, gain; slope: center, gain; weight",
    "terms": "kind, channel, parameters",
    "coverage": "one bit for each cell of T (fastest) and slope, low bit first",
    "sigma": "1 sigma of the compensated bias, a row for each cell of slope",
    "probes": "known answers: T, slope, bias, status",
}
_TERM_CODES = {1: "memory", 2: "play", 3: "warm_up", 4: "harmonic", 5: "auxiliary"}
_HEAD_WORDS = 3  # magic, layout and arithmetic, length


@dataclass(frozen=True, slots=True)
class Emission:
    """What was written: the tables by arithmetic, and the arithmetics that `quantise` refused, with why."""

    tables: dict[str, Table]
    refused: dict[str, str]


@dataclass(frozen=True, slots=True)
class _Member:
    name: str
    text: str
    comment: str = ""


@dataclass(frozen=True, slots=True)
class _Array:
    name: str
    comment: str
    size: int
    rows: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class _TableText:
    numeric: str
    title: str
    members: tuple[_Member, ...]
    arrays: tuple[_Array, ...]
    term_codes: tuple[str, ...]


def quantise_all(model: Model, numerics: Sequence[str] | None) -> Emission:
    """Tables of a model for the arithmetics asked for (None: every one that the runtime has).

    Raises:
        InputError: An unknown arithmetic, or a method that has no table.
        CheckFailed: An arithmetic asked for by name is refused, or none remains.
    """
    if model.method in ("mlr", "poly"):
        raise InputError(
            "model.json, field method", f"{model.method!r} is for comparison only", "a network (mrbf, ...)"
        )
    unknown = sorted(set(numerics or ()) - set(NUMERICS))
    if unknown:
        raise InputError("--numeric", repr(unknown[0]), " or ".join(NUMERICS))
    tables: dict[str, Table] = {}
    refused: dict[str, str] = {}
    for numeric in NUMERICS if numerics is None else tuple(dict.fromkeys(numerics)):
        try:
            tables[numeric] = quantise(model, numeric)
        except CheckFailed as error:
            if numerics is not None:
                raise
            refused[numeric] = str(error)
    if not tables:
        raise CheckFailed("; ".join(refused.values()))
    return Emission(tables, refused)


def emit(
    model: Model, out: Path, *, numerics: Sequence[str] | None = None, zero_at: float | None = None
) -> Emission:
    """Writes `out/c/`. The folder appears whole or not at all; an older one is replaced."""
    emission = quantise_all(model if zero_at is None else model.zeroed_at(zero_at), numerics)
    texts = emit_texts(model, emission, asked=numerics is not None, zero_at=zero_at)
    replace_folder(out / "c", texts)
    return emission


def emitted_tables(folder: Path, model: Model) -> dict[str, Table]:
    """The tables that an emitted folder must hold: made again from the model, with the same options.

    Raises:
        InputError: There is no emitted code of this model.
    """
    text = _emitted_header(folder, model)
    numerics = tuple(n for n in NUMERICS if f"gtc_{n}_table_t gtc_{model.symbol}_{n};" in text)
    return quantise_all(emitted_model(folder, model), numerics).tables


def emitted_model(folder: Path, model: Model) -> Model:
    """The model that an emitted folder computes: with `--zero-at`, the shifted one.

    Raises:
        InputError: There is no emitted code of this model.
    """
    zero_at = re.search(r"Make again: .* --zero-at (\S+)", _emitted_header(folder, model))
    return model.zeroed_at(float(zero_at[1])) if zero_at else model


def _emitted_header(folder: Path, model: Model) -> str:
    header = folder / f"gtc_{model.id}.h"
    try:
        return header.read_text(encoding="ascii", errors="replace")
    except OSError as error:
        raise InputError(
            str(header), f"cannot be read ({error.strerror})", "a folder that emit wrote"
        ) from error


def replace_folder(folder: Path, files: dict[str, bytes]) -> None:
    """Puts a folder with exactly these files in place of `folder`, by renaming."""
    folder.parent.mkdir(parents=True, exist_ok=True)
    new = Path(tempfile.mkdtemp(prefix=f".{folder.name}.", dir=folder.parent))
    try:
        for name, data in files.items():
            (new / name).write_bytes(data)
        new.chmod(0o755)
        if folder.exists():
            old = Path(tempfile.mkdtemp(prefix=f".{folder.name}.old.", dir=folder.parent))
            folder.replace(old / folder.name)
            new.replace(folder)
            shutil.rmtree(old, ignore_errors=True)
        else:
            new.replace(folder)
    except BaseException:
        shutil.rmtree(new, ignore_errors=True)
        raise


def emit_texts(
    model: Model, emission: Emission, *, asked: bool = False, zero_at: float | None = None
) -> dict[str, bytes]:
    """All files of `c/` by name."""
    numerics = tuple(emission.tables)
    vectors = make_vectors(model, numerics)
    options = (f" --numeric {','.join(numerics)}" if asked else "") + (
        f" --zero-at {zero_at!r}" if zero_at is not None else ""
    )
    first = next(iter(emission.tables.values()))
    values: dict[str, Any] = {
        "id": model.id,
        "symbol": model.symbol,
        "serial": model.serial,
        "axis": model.axis,
        "model_hash": model.hash,
        "options": options,
        "layout": LAYOUT,
        "numerics": numerics,
        "v": vectors,
        "n": numerics[0],
        "n_channels": vectors.n_channels,
        "missing": {n: f"0x{word:08x}UL" for n, word in MISSING.items()},
        "id_code": first.id,
        "tables": [_table_text(t, _row_comments(model)) for t in emission.tables.values()],
        "facts": list(_facts(model)),
        "valid": _valid(model),
        "block_s": f"{model.block_s:g}",
        "sizes": list(_sizes(emission)),
        "warnings": list(model.meta.get("warnings", ())),
        **_example_values(model),
    }
    named = {
        f"gtc_{model.id}.h": "table.h.j2",
        f"gtc_{model.id}.c": "table.c.j2",
        f"vectors_{model.id}.h": "vectors.h.j2",
        "board_test.c": "board_test.c.j2",
        "main.c": "main.c.j2",
    }
    texts = {name: _templates().get_template(t).render(values).encode("ascii") for name, t in named.items()}
    header, source = amalgamate(*runtime_folders(), bank=len(model.networks) > 1)
    texts["gtc.h"], texts["gtc.c"] = header.encode("ascii"), source.encode("ascii")
    for numeric, table in emission.tables.items():
        suffix = "" if numeric == numerics[0] else f"_{numeric}"
        texts[f"gtc_{model.id}{suffix}.bin"] = _image(table)
        texts[f"gtc_{model.id}{suffix}.hex"] = _intel_hex(_image(table)).encode("ascii")
    texts[f"vectors_{model.id}.txt"] = answers_text(
        {n: answers(t, vectors) for n, t in emission.tables.items()}
    )
    return texts


def answers_text(expected: Mapping[str, NDArray[np.uint32]]) -> bytes:
    """`vectors_<id>.txt` of the answers by arithmetic, each (status, bits), shape (n, 2)."""
    parts = [
        f"begin {numeric} {len(rows):08x}\n".encode("ascii") + _hex_lines(rows)
        for numeric, rows in expected.items()
    ]
    return b"".join(parts)


@functools.cache
def _templates() -> jinja2.Environment:
    """Compiled once in a process."""
    return jinja2.Environment(
        loader=jinja2.PackageLoader("gyrotc", "templates"),
        undefined=jinja2.StrictUndefined,
        keep_trailing_newline=True,
        autoescape=False,
    )


def _hex_lines(rows: NDArray[np.uint32]) -> bytes:
    """Two words a line, in eight hex digits each."""
    digits = np.frombuffer(rows.astype(">u4").tobytes().hex().encode("ascii"), dtype=np.uint8).reshape(-1, 16)
    lines = np.full((len(rows), 18), ord(" "), dtype=np.uint8)
    lines[:, :8], lines[:, 9:17], lines[:, 17] = digits[:, :8], digits[:, 8:], ord("\n")
    return lines.tobytes()


def _facts(model: Model) -> Iterator[tuple[str, str]]:
    """Calibration date and meta, one line each."""
    for key, value in sorted(model.meta.items()):
        if key in ("warnings", "environments") or isinstance(value, (dict, list)):
            continue
        text = " ".join(str(value).split())
        safe = text.encode("ascii", "replace").decode("ascii").replace("*/", "* /").replace("/*", "/ *")[:120]
        yield key[:24], safe


def _valid(model: Model) -> str:
    (t0, t1), (r0, r1) = model.envelope.temperature_c, model.envelope.slope_c_per_min
    return f"{t0:.2f} ... {t1:.2f} C, {r0:.3f} ... {r1:.3f} C/min"


def _sizes(emission: Emission) -> Iterator[str]:
    for numeric, table in emission.tables.items():
        yield (
            f"{numeric + ':':<12} {table.table_bytes} bytes of table; "
            f"|error| <= {table.error_bound_dph:.2e} deg/h against the model (terms excluded)"
        )


def _example_values(model: Model) -> dict[str, Any]:
    middle = round(sum(model.envelope.temperature_c) / 2.0, 1)
    per_second = 100 if abs(model.block_s * 100 - round(model.block_s * 100)) < 1e-9 else 1
    return {
        "first_temperature": f"{middle:.1f}",
        "first_temperature_q16": round(middle * 65536),
        "samples_per_second": per_second,
        "samples_per_block": max(1, round(model.block_s * per_second)),
    }


def _image(table: Table) -> bytes:
    return struct.pack(f"<{len(table.words)}I", *table.words)


def _intel_hex(data: bytes) -> str:
    def record(kind: int, address: int, payload: bytes) -> str:
        body = bytes([len(payload), address >> 8 & 255, address & 255, kind]) + payload
        return ":" + (body + bytes([-sum(body) & 255])).hex().upper() + "\n"

    lines = []
    for start in range(0, len(data), 16):
        if start and start % 65536 == 0:
            lines.append(record(4, 0, struct.pack(">H", start >> 16)))
        lines.append(record(0, start & 0xFFFF, data[start : start + 16]))
    return "".join(lines) + record(1, 0, b"")


def _table_text(table: Table, comments: dict[str, list[str]]) -> _TableText:
    """Decodes the image's words into named members; the order is that of gtc_table.h."""
    words = iter(table.words[_HEAD_WORDS:])
    sizes = {"scale": 3, "envelope": 4}
    counts: dict[str, list[int]] = {}
    members = [_Member("layout", str(LAYOUT))]
    for name in _INTEGERS:
        word = next(words)
        members.append(_Member(name, f"0x{word:08x}UL" if name == "id" else f"{word}UL"))
    for name in (*_NUMBERS, "scale", "envelope"):
        group = [_number(table.numeric, next(words)) for _ in range(sizes.get(name, 1))]
        members.append(_Member(name, f"{{ {', '.join(group)} }}" if name in sizes else group[0]))
    for name in _COUNTS:
        counts[name] = [next(words) for _ in range(2 if name.endswith("cells") else 1)]
        text = ", ".join(f"{n}UL" for n in counts[name])
        members.append(_Member(name, f"{{ {text} }}" if name.endswith("cells") else text))
    arrays = []
    kinds: list[int] = []
    for name, length in _array_lengths(counts).items():
        body = [next(words) for _ in range(length)]
        if name == "terms":
            kinds = body[:: _RECORDS["terms"]]
        if length:
            arrays.append(_array(table.numeric, name, body, counts, comments.get(name, [])))
        members.append(_Member(name, f"{table.numeric}_{name}" if length else "NULL"))
    members.append(_Member("crc", f"0x{next(words):08x}UL"))
    codes = [f"gtc_{table.numeric}_term_{_TERM_CODES[k]}" for k in kinds]
    filled = ", ".join([f"&{c}" for c in codes] or ["NULL"])
    members.append(_Member("term_code", f"{{ {filled} }}"))
    return _TableText(
        table.numeric, _TITLES[table.numeric], tuple(members), tuple(arrays), tuple(dict.fromkeys(codes))
    )


def _array_lengths(counts: dict[str, list[int]]) -> dict[str, int]:
    cells, sigma = counts["coverage_cells"], counts["sigma_cells"]
    return {
        "networks": counts["n_networks"][0] * _RECORDS["networks"],
        "centers": counts["n_centers"][0] * _RECORDS["centers"],
        "terms": counts["n_terms"][0] * _RECORDS["terms"],
        "coverage": (cells[0] * cells[1] + 31) // 32,
        "sigma": sigma[0] * sigma[1],
        "probes": counts["n_probes"][0] * _RECORDS["probes"],
    }


def _row_comments(model: Model) -> dict[str, list[str]]:
    """What a row of an array says in the units of the trade."""
    centers = [
        f"{t:.2f} C, {r:+.3f} C/min; widths {_width(d_t)}, {_width(d_r)}; {w:+.3e} deg/h"
        for n in model.networks
        for (t, r), (d_t, d_r), w in zip(n.centers, n.widths, n.weights, strict=True)
    ]
    return {"centers": centers, "terms": [term.id for term in model.terms]}


def _width(width: float | None) -> str:
    return "infinite" if width is None else f"{width:.3f}"


def _array(
    numeric: str, name: str, body: list[int], counts: dict[str, list[int]], comments: list[str]
) -> _Array:
    width = _RECORDS.get(name, counts["sigma_cells"][0] if name == "sigma" else 6)
    rows = []
    for start in range(0, len(body), width):
        cells = [
            _word(numeric, w, integer=_is_integer(name, k)) for k, w in enumerate(body[start : start + width])
        ]
        number = start // width
        comment = f" /* {comments[number]} */" if number < len(comments) else ""
        rows.append(", ".join(cells) + "," + comment)
    return _Array(name, _ARRAY_COMMENTS[name], len(body), tuple(rows))


def _is_integer(name: str, column: int) -> bool:
    """Words of a float32 table that are integers all the same."""
    return (
        name == "coverage"
        or (name == "networks" and column == 0)
        or (name == "terms" and column < 2)
        or (name == "probes" and column == 3)
    )


def _word(numeric: str, word: int, *, integer: bool) -> str:
    if integer:
        return f"B(0x{word:x}UL)"
    return f"V({_float_text(word)})" if numeric == "f32" else f"B(0x{word:08x}UL)"


def _number(numeric: str, word: int) -> str:
    if numeric == "f32":
        return f"V({_float_text(word)})"
    signed = word - 2**32 if word >= 2**31 else word
    return "(-2147483647L - 1L)" if signed == -(2**31) else f"{signed}L"


def _float_text(word: int) -> str:
    """A float32 as a C constant: 9 significant digits, which read back to the same bits."""
    value = struct.unpack("<f", struct.pack("<I", word))[0]
    text = f"{value:.9g}"
    return (text if any(c in text for c in ".en") else text + ".0") + "F"
