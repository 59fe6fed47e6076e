"""Write the C files of a model: tables, runtime, image and example, which firmware compiles; and a board test.

A pure function of the model: no date, no path, no host, no version, so one model gives the same bytes on every
machine. All arithmetic was done in `tables.quantise`; here integers are printed.
"""

from __future__ import annotations

import functools
import struct
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from decimal import ROUND_CEILING, Decimal, localcontext
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..common.errors import CheckFailed, InputError, quoted
from ..common.progress import Progress, Stages, silent
from ..common.texts import CText, c_code, c_literal
from ..mirror.history import answers
from ..mirror.table import LAYOUT, Table
from ..model import Model
from ..results.files import write_own
from ..results.folder import result_folder
from ..results.templates import c_templates
from .error_bounds import MARGIN, channel_error_dph
from .quantisation import NUMERICS, quantise
from .record import RECORD, SHARED_RUNTIME, Options, read_options, record_text
from .rounding import channel_names
from .runtime import needs_of, runtime_texts
from .text import example_values, table_text
from .vectors import MISSING_READING, Vectors, answers_text, make_vectors

__all__ = [
    "Emission",
    "board_test_sources",
    "board_test_texts",
    "emit",
    "emit_texts",
    "emitted_tables",
    "expected_answers",
    "image_of",
    "quantise_all",
    "write_texts",
]


@dataclass(frozen=True, slots=True)
class Emission:
    """Emitted tables by arithmetic, and the arithmetics that `quantise` refused, with the reason."""

    tables: dict[str, Table]
    refused: dict[str, str]


def quantise_all(model: Model, numerics: Sequence[str] | None, progress: Progress = silent) -> Emission:
    """Tables of a model for the arithmetics asked for (None: every one that the runtime has).

    Raises:
        InputError: An unknown arithmetic.
        CheckFailed: An arithmetic asked for by name is refused, or none remains.
    """
    unknown = sorted(set(numerics or ()) - set(NUMERICS))
    if unknown:
        raise InputError("--numeric", quoted(unknown[0]), " or ".join(NUMERICS))
    tables: dict[str, Table] = {}
    refused: dict[str, str] = {}
    chosen = NUMERICS if numerics is None else tuple(dict.fromkeys(numerics))
    for k, numeric in enumerate(chosen):
        progress(f"rounding to {numeric}", k, len(chosen))
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
    model: Model,
    out: Path,
    *,
    numerics: Sequence[str] | None = None,
    zero_at: float | None = None,
    runtime_apart: bool = False,
    progress: Progress = silent,
) -> Emission:
    """Write `out/c/` and the `out/model.json` that it is made of, both or neither, in place of earlier ones.

    Args:
        numerics: The arithmetics; None: every one that the runtime has.
        zero_at: Temperature at which the tables' map is 0, C; None: not shifted.
        runtime_apart: Write the tables only: the runtime is in `SHARED_RUNTIME`, once for many gyros.
        progress: Takes note of every stage.
    """
    say = Stages(progress, {"rounding": 0.95, "writing": 0.05})
    shifted = model if zero_at is None else model.zeroed_at(zero_at)
    emission = quantise_all(shifted, numerics, say.within("rounding"))
    say("writing")
    texts = emit_texts(model, emission, asked=numerics is not None, zero_at=zero_at, runtime_apart=runtime_apart)
    write_texts(out, texts, model)
    return emission


def emitted_tables(folder: Path, model: Model) -> dict[str, Table]:
    """The tables that an emitted folder must hold: made again from the model, with the same options.

    Raises:
        InputError: There is no emitted code, or its record is damaged.
    """
    options = read_options(folder)
    return quantise_all(options.shifted(model), options.numeric).tables


def write_texts(out: Path, texts: Mapping[str, bytes], model: Model) -> None:
    """Put a folder with exactly these files in place of `out/c`, and the model beside it.

    Raises:
        InputError: Something in `out` was not written by gyrotc, or these were changed since.
    """
    with result_folder(out, "emit", entries=("c", "model.json")) as stage:
        stage.of(model.serial, model.axis)
        model.save(stage.folder / "model.json")
        (stage.folder / "c").mkdir()
        for name, data in texts.items():
            write_own(stage.folder / "c" / name, data)


def emit_texts(
    model: Model,
    emission: Emission,
    *,
    asked: bool = False,
    zero_at: float | None = None,
    runtime_apart: bool = False,
) -> dict[str, bytes]:
    """Return all files of `c/` by name.

    Args:
        model: The model, before `zero_at` shifts it.
        emission: Its tables.
        asked: The arithmetics were asked for by name.
        zero_at: Temperature at which the tables' map is 0, C; None: not shifted.
        runtime_apart: Table and image alone.
    """
    options = Options.model_validate(
        {
            "numeric": tuple(emission.tables) if asked else None,
            "zero_at_c": zero_at,
            "runtime": SHARED_RUNTIME if runtime_apart else None,
        }
    )
    return dict(_texts(_Made.of(model, emission), options))


def expected_answers(model: Model, emission: Emission) -> dict[str, NDArray[np.uint32]]:
    """Answers of the tables to the model's vectors by arithmetic: (status, bits), shape (n, 2), not to write to."""
    return dict(_expected(_Made.of(model, emission)))


def board_test_sources(model: Model, emission: Emission) -> dict[str, bytes]:
    """Return the board test and its vectors by name; they compile beside table and runtime."""
    vectors = _vectors(_Made.of(model, emission))
    values = {
        "id": model.id,
        "symbol": model.symbol,
        "numerics": tuple(emission.tables),
        "v": vectors,
        "n_channels": vectors.n_channels,
        "missing": MISSING_READING,
        "has_time": "time" not in model.left_out,
        "has_uncertainty": "uncertainty" not in model.left_out,
    }
    named = {"board_test.c": "board_test.c.j2", f"vectors_{model.id}.h": "vectors.h.j2"}
    return {name: c_templates().get_template(t).render(values).encode("ascii") for name, t in named.items()}


def board_test_texts(model: Model, emission: Emission) -> dict[str, bytes]:
    """Return the board test, its vectors and the answers that it must print, by name.

    The answers, status and bits of every result in the order of the test, are larger than all that firmware compiles.
    """
    return board_test_sources(model, emission) | {"answers.txt": answers_text(_expected(_Made.of(model, emission)))}


@dataclass(frozen=True, slots=True)
class _Made:
    """A model and its tables; another one is the same if the model's hash is, and the tables are the same objects."""

    hash: str
    tables: tuple[tuple[str, int], ...]
    model: Model = field(compare=False)
    emission: Emission = field(compare=False)

    @classmethod
    def of(cls, model: Model, emission: Emission) -> _Made:
        tables = tuple((numeric, id(table)) for numeric, table in emission.tables.items())
        return cls(model.hash, tables, model, emission)


@functools.lru_cache(maxsize=2)
def _vectors(made: _Made) -> Vectors:
    return make_vectors(made.model, tuple(made.emission.tables))


@functools.lru_cache(maxsize=2)
def _expected(made: _Made) -> dict[str, NDArray[np.uint32]]:
    """Kept for the next stages of the same job, which ask again; so are the texts."""
    found = {numeric: answers(table, _vectors(made)) for numeric, table in made.emission.tables.items()}
    for rows in found.values():
        rows.flags.writeable = False
    return found


@functools.lru_cache(maxsize=2)
def _texts(made: _Made, options: Options) -> dict[str, bytes]:
    model, emission = made.model, made.emission
    numerics = tuple(emission.tables)
    named = {f"gtc_{model.id}.h": "table.h.j2", f"gtc_{model.id}.c": "table.c.j2"}
    if options.runtime is None:
        named["main.c"] = "main.c.j2"
    texts = _from_templates(named, model, emission, options)
    if options.runtime is None:
        texts |= runtime_texts(needs_of(model), numerics)
    for numeric, table in emission.tables.items():
        suffix = "" if numeric == numerics[0] else f"_{numeric}"
        texts[f"gtc_{model.id}{suffix}.bin"] = image_of(table)
        if options.runtime is None:
            texts[f"gtc_{model.id}{suffix}.hex"] = _intel_hex(image_of(table)).encode("ascii")
    texts[RECORD] = record_text(model, options, texts)
    return texts


def _from_templates(named: Mapping[str, str], model: Model, emission: Emission, options: Options) -> dict[str, bytes]:
    """Files by name of which `named` gives the template."""
    numerics = tuple(emission.tables)
    values: dict[str, Any] = {
        "id": model.id,
        "symbol": model.symbol,
        "serial": model.serial,
        "axis": model.axis,
        "model_hash": model.hash,
        "options": options.text,
        "layout": LAYOUT,
        "numerics": numerics,
        "n": numerics[0],
        "n_channels": next(iter(emission.tables.values())).n_channels,
        "id_code": emission.tables[numerics[0]].id,
        "tables": [table_text(t, model) for t in emission.tables.values()],
        "facts": list(_facts(model)),
        "valid": _valid(model),
        "block_s": f"{model.block_s:g}",
        "sizes": list(_sizes(model, emission)),
        "runtime": options.runtime,
        "left_out": ", ".join(part.replace("_", " ") for part in model.left_out),
        "macros": list(_macros(model, emission)),
        "warnings": list(model.warnings),
        **example_values(model),
    }
    return {name: c_templates().get_template(t).render(values).encode("ascii") for name, t in named.items()}


def _facts(model: Model) -> Iterator[str]:
    """Calibration date and meta, one line each; the template makes them safe."""
    for key, value in sorted(model.meta.items()):
        if key in ("warnings", "environments") or isinstance(value, (dict, list)):
            continue
        text = " ".join(str(value).split())
        yield f"{key[:24] + ':':<12} {text[:120]}"


def _valid(model: Model) -> str:
    (t0, t1), (r0, r1) = model.envelope.temperature_c, model.envelope.slope_c_per_min
    return f"{t0:.2f} ... {t1:.2f} C, {r0:.3f} ... {r1:.3f} C/min"


def _sizes(model: Model, emission: Emission) -> Iterator[str]:
    for numeric, table in emission.tables.items():
        of_channels = channel_error_dph(model, table.numeric, table.bias_frac_bits)
        beside = f", curves and products of channels: {_upwards(of_channels)}" if of_channels else ""
        yield (
            f"{numeric + ':':<12} {table.table_bytes} bytes of read-only data, "
            f"{table.parameter_bytes} of them parameters; "
            f"|error| <= {_upwards(table.error_bound_dph)} deg/h against the model (terms excluded{beside})"
        )
        if table.n_fallback_models:
            yield (
                f"{numeric} fallback models: {table.fallback_model_bytes} of these parameters are added for channels "
                f"that are lost; of each |error| <= {_upwards(max(table.fallback_model_bounds_dph))} deg/h"
            )


def _upwards(bound: float) -> str:
    """A bound with three digits, never below itself."""
    with localcontext() as context:
        context.rounding = ROUND_CEILING
        return f"{float(f'{Decimal(bound):.2e}'):.2e}"


def _macros(model: Model, emission: Emission) -> Iterator[dict[str, str]]:
    """Yield macros that a program needs of a table before it runs: name behind GTC_<ID>_, text, comment."""
    (t0, t1), (r0, r1) = model.envelope.temperature_c, model.envelope.slope_c_per_min
    yield _macro("BLOCK_US", c_code(f"{round(model.block_s * 1e6)}UL"), "block length, microseconds")
    edges = (("T_MIN_C", t0), ("T_MAX_C", t1), ("SLOPE_MIN_C_PER_MIN", r0), ("SLOPE_MAX_C_PER_MIN", r1))
    for name, value in edges:
        text = CText(f"({c_code(f'{value:#.7g}F')})")
        yield _macro(name, text, "envelope: beyond it GTC_CLAMPED")
    yield from _time_macros(model)
    yield from _authority_macros(emission)
    names = channel_names(model)
    yield _macro("N_CHANNELS", c_code(f"{1 + len(names)}"), "numbers of a sample")
    channels = [("temperature_c", "C, of the gyro's own sensor"), *((n, "unit as recorded") for n in names)]
    for k, (name, unit) in enumerate(channels):
        yield _macro(f"CHANNEL_{k}", CText(f'"{c_literal(name)}"'), unit)
    for numeric, table in emission.tables.items():
        if numeric == "q31":
            yield _macro("Q31_BIAS_FRAC_BITS", c_code(f"{table.bias_frac_bits}"), "bias in 2^-this deg/h")
        size = c_code(f"{table.table_bytes}UL")
        yield _macro(f"{numeric.upper()}_TABLE_BYTES", size, "read-only data, with pointers of 32 bits")


def _macro(name: str, text: CText, comment: str) -> dict[str, str]:
    return {"name": name, "text": text, "comment": comment}


def _time_macros(model: Model) -> Iterator[dict[str, str]]:
    block_us = max(1, round(model.block_s * 1e6))
    longest, shortest = block_us + block_us // 1000, max(1, -(-block_us // 2**20))
    yield _macro("PERIOD_MIN_US", c_code(f"{shortest}UL"), "shortest sample period, microseconds")
    yield _macro("PERIOD_MAX_US", c_code(f"{longest}UL"), "longest sample period")
    stuck = f"{round(model.stuck_s * 1e6)}UL"
    comment = "a temperature that stays the same so long is none; 0: never, the recordings do not show after what time"
    yield _macro("STUCK_US", c_code(stuck), comment)


def _authority_macros(emission: Emission) -> Iterator[dict[str, str]]:
    """The widest of the arithmetics."""
    ends = [table.decode_bias(table.authority) for table in emission.tables.values()]
    values = {"MIN": min(low for low, _ in ends), "MAX": max(high for _, high in ends)}
    for name, value in values.items():
        text = CText(f"({c_code(f'{value:#.9g}F')})")
        comment = f"no correction lies {'below' if name == 'MIN' else 'above'} it, deg/h: margin {MARGIN:.0%} of range"
        yield _macro(f"AUTHORITY_{name}_DPH", text, comment)


def image_of(table: Table) -> bytes:
    """The words of a table as octets, the least significant first, as a target holds them."""
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
