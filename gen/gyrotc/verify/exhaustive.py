"""Visit every input of a fixed-point table with the compiled code, which must keep to the reference and the model."""

from __future__ import annotations

import math
import os
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from subprocess import DEVNULL, PIPE
from typing import Any

from ..common.errors import CheckFailed, GyrotcError
from ..common.progress import Progress, silent
from ..mirror.q31 import exp2_table
from ..mirror.table import Table
from ..model import Model
from ..results.folder import scratch_folder
from .emitted import checked_sources, table_files
from .toolchain import Target, all_targets, compile_objects, confined, link, runtime_object, shared_object

_SLICES = 128  # of exhaustive.c, which is written independently of libc/ but for the code under test
_LIMIT_S = 4 * 3600  # of processor time for one of the processes; all 2^32 inputs take minutes
_KEPT_LINES = 1000  # exhaustive.c prints fewer than ten
_COMPILERS = ("host-clang-O3", "host-gcc-O3")
_SOURCE = Path(__file__).resolve().parent / "exhaustive.c"


@dataclass(frozen=True, slots=True)
class Visited:
    """Result of visiting all pairs of positions.

    `worst_dph` is the largest departure from the model over all inputs that a pair stands for (at the
    corners of its cell), `arithmetic_dph` that at the middle of the cell, `mean_dph` the mean departure there.
    """

    inputs: int
    mismatches: int
    first: tuple[str, ...]
    worst_dph: float
    arithmetic_dph: float
    mean_dph: float


def visit_all(
    c_folder: Path,
    model: Model,
    table: Table,
    *,
    every: int = 1,
    trusted: bool = False,
    progress: Progress = silent,
) -> Visited:
    """Visit every pair of positions, or every `every`-th slice of slopes.

    Args:
        model: The model that the table was made of.
        table: Its fixed-point table.
        trusted: Code of the folder that is not gyrotc's is compiled and run, too.
        progress: Takes note of every slice that is done.

    Raises:
        CheckFailed: The emitted code does not compile, or the program failed.
        GyrotcError: There is no host compiler.
    """
    target = _host()
    with scratch_folder() as work:
        program = _compiled(target, c_folder, model, work, trusted=trusted)
        parts = os.cpu_count() or 1
        lines = list(_numbers(model, table))
        done = _Counter(progress)
        with ThreadPoolExecutor(max_workers=parts) as pool:
            results = list(
                pool.map(lambda part: _run(program, [f"{part} {parts} {every}", *lines], done), range(parts))
            )
    return _together(results)


def _host() -> Target:
    for name in _COMPILERS:
        target = all_targets()[name]
        if target.missing() is None:
            return target
    raise GyrotcError("no C compiler: install clang or gcc")


def _compiled(target: Target, c_folder: Path, model: Model, work: Path, *, trusted: bool) -> Path:
    c = checked_sources(c_folder, work, table_files(c_folder, model, ("q31",)), trusted=trusted)
    runtime = runtime_object(target, c, "q31", work, fresh=trusted).put(work / "gtc.o")
    table = shared_object(target, c / f"gtc_{model.id}.c", work, include=c, fresh=trusted).put(work / "table.o")
    emitted = [runtime, table]
    # The program itself is no code for targets: it may use what the host has.
    loose = target.model_copy(update={"flags": (*target.flags, "-ffast-math", "-Wno-error")})
    defines = [f"TABLE=gtc_{model.symbol}_q31", f'HEADER="gtc_{model.id}.h"']
    (own,) = compile_objects(loose, [_SOURCE], work, include=c, defines=defines)
    program = work / "exhaustive"
    link(target.model_copy(update={"link": (*target.link, "-lm")}), [own, *emitted], program)
    return program


def _numbers(model: Model, table: Table) -> Iterator[str]:
    """Yield the input of exhaustive.c: integers of the table's words, then the model in float64."""
    per_block = model.block_s / 60.0
    low_t, high_t, low_r, high_r = table.numbers(table.envelope).tolist()
    gain_t, gain_r, narrow = table.scale
    center, half = model.scale.temperature_c
    half_r = model.scale.slope_c_per_min
    (t0, t1), (r0, r1) = model.envelope.temperature_c, model.envelope.slope_c_per_min
    yield f"{low_t} {high_t} {gain_t} {t0!r} {t1!r} {center!r} {half!r}"
    yield f"{low_r} {high_r} {gain_r} {r0 * per_block!r} {r1 * per_block!r} 0.0 {half_r * per_block!r}"
    yield f"{narrow} {' '.join(str(int(e)) for e in exp2_table())}"
    network = model.networks[0]
    own, w0, linear_t, linear_r, *_ = table.numbers(table.networks).tolist()
    yield f"{w0} {linear_t} {linear_r} {own} {len(network.weights)}"
    for record in table.numbers(table.records("centers"))[:own].tolist():
        yield " ".join(map(str, record))
    yield f"{table.coverage_cells[0]} {table.coverage_cells[1]}"
    yield " ".join(str(int(word)) for word in table.coverage)
    yield f"{2.0**-table.bias_frac_bits!r} {network.w0!r} {network.linear[0]!r} {network.linear[1]!r}"
    for (c_t, c_r), widths, weight in zip(network.centers, network.widths, network.weights, strict=True):
        inverse = [0.0 if width is None else 1.0 / width for width in widths]
        yield f"{(c_t - center) / half!r} {inverse[0]!r} {c_r / half_r!r} {inverse[1]!r} {weight!r}"


class _Counter:
    """Slices done, by all processes together."""

    def __init__(self, progress: Progress) -> None:
        self._progress = progress
        self._done = 0

    def one_more(self) -> None:
        self._done += 1
        self._progress("visiting every input", self._done, _SLICES)


def _run(program: Path, lines: list[str], done: _Counter) -> list[str]:
    """Lines that one process printed, without its progress."""
    kept: list[str] = []
    with confined([str(program)], program.parent, stdin=PIPE, stdout=PIPE, stderr=DEVNULL, cpu_s=_LIMIT_S) as process:
        assert process.stdin is not None and process.stdout is not None
        with suppress(BrokenPipeError), process.stdin:  # its status says that it ended early
            process.stdin.write(("\n".join(lines) + "\n").encode("ascii"))
        for line in process.stdout:
            if line.startswith(b"progress"):
                done.one_more()
            elif len(kept) < _KEPT_LINES:
                kept.append(line.decode("ascii", "replace").strip())
        process.wait()
    if process.returncode != 0:
        raise CheckFailed(f"the visit of all inputs ended with status {process.returncode}")
    return kept


def _together(results: list[list[str]]) -> Visited:
    first = [line for lines in results for line in lines if line.startswith("differs")]
    words: list[list[Any]] = [lines[-1].split()[1:] for lines in results]
    inputs = sum(int(w[0]) for w in words)
    return Visited(
        inputs=inputs,
        mismatches=sum(int(w[1]) for w in words),
        first=tuple(first[:5]),
        worst_dph=max(float.fromhex(w[3]) for w in words),
        arithmetic_dph=max(float.fromhex(w[2]) for w in words),
        mean_dph=math.fsum(float.fromhex(w[4]) for w in words) / max(inputs, 1),
    )
