"""The board test on one target, run here or from a log of hardware: compiled, run, read, compared, measured.

What it prints may come from an emulator (which may colour its lines) or from a user's terminal: line ends may be any,
and what an emulator prints of its own is passed over. Of a log that a user brings every line is accounted for.
"""

from __future__ import annotations

import re
import zlib
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..common.errors import CheckFailed
from ..common.inputs import read_input
from ..mirror.history import answers
from ..results.files import write_own
from ..results.folder import scratch_folder
from ..results.release import CallCost, LogPart, ReadLog, VerifiedTarget
from ..tables.emission import Emission, board_test_sources
from ..tables.vectors import Vectors
from .emitted import Job, checked_sources, table_files
from .sizes import function_costs
from .toolchain import (
    Object,
    Symbol,
    Target,
    compile_objects,
    compiler_version,
    link,
    run_program,
    runtime_object,
    shared_object,
    symbols,
)

LogWords = NDArray[np.uint32]
LogLine = tuple[int, str]
_GROUP = 256  # results to a CRC: BOARD_CRC of board_test.c
_SHOWN_MISMATCHES = 5  # enough to see a pattern
_COLOURS = re.compile(r"\x1b\[[0-9;]*m")
_BEGIN = re.compile(
    r"begin (?P<id>\S+) (?P<numeric>\w+) (?P<mode>all|crc) (?P<model>[0-9a-f]{8}) (?P<random>[0-9a-f]{8})"
)
_RESULT = re.compile(r"[0-9a-f]{8} [0-9a-f]{8}")
_GROUP_CRC = re.compile(r"[0-9a-f]{8}")
_END = re.compile(r"end ([0-9a-f]{8})")
_COST = re.compile(r"cost (?P<what>map|step)(?P<words>( [0-9a-f]{8}){6})")
# A line that only a part has, whole or torn.
_LOST = re.compile(r"[0-9a-f]{8}( [0-9a-f]{1,8})?|end [0-9a-f]{8}|cost (map|step) .*")


@dataclass(frozen=True, slots=True)
class Cost:
    """Cost of one kind of call, less an empty call: ticks of the board's counter, bytes of stack."""

    calls: int
    low: int
    high: int
    total: int
    stack: int


@dataclass(frozen=True, slots=True)
class BoardOutput:
    """One arithmetic of a board test: identity, then its words, (n, 2) results or (n,) CRCs of groups."""

    id: str
    numeric: str
    model: int  # first 32 bits of the model's hash
    random: int  # random map vectors
    board: str  # what the board calls itself; may be empty
    n_results: int
    words: LogWords
    costs: dict[str, Cost] = field(default_factory=dict)
    line: int = 1  # of its `begin`


@dataclass(frozen=True, slots=True)
class BoardLog:
    """A whole log: its parts, the number of its lines, and those that stand outside of a board test, by number."""

    parts: tuple[BoardOutput, ...]
    lines: int
    outside: tuple[LogLine, ...]


@dataclass(frozen=True, slots=True)
class BoardComparison:
    """Results compared, mismatches among them, and the first of them with all bits.

    Where only CRCs were printed, all results of a differing group count as mismatches.
    """

    vectors: int
    mismatches: int
    first: tuple[str, ...]


def read_output(text: str) -> list[BoardOutput]:
    """The parts of a board test's output, one for each arithmetic; whatever stands outside of them is passed over.

    Raises:
        CheckFailed: It is not whole: no `begin`, no `end`, a damaged line, another number of results.
    """
    return [part for part, _ in _found(_numbered(text))]


def read_log(text: str) -> BoardLog:
    """The parts of a log that was recorded elsewhere, with every line of it accounted for.

    From a `begin` (with the `board` before it) to `done` every line must be understood. Outside, a board may print what
    it likes but for lines that look like results: these have lost their `begin`.

    Raises:
        CheckFailed: As for `read_output`, or a line that is not understood, or no `done`; names the line.
    """
    lines = _numbered(text)
    outside: list[tuple[int, str]] = []
    parts: list[BoardOutput] = []
    running: set[str] = set()  # arithmetics since the last `done`
    position = 0
    for part, (start, stop) in [*_found(lines), (None, (len(lines), len(lines)))]:
        for number, line in lines[position:start]:
            if running and line == "done":
                running = set()
            elif running:
                raise CheckFailed(f"line {number} is not understood: {line[:80]!r}")
            elif _LOST.fullmatch(line):
                raise CheckFailed(
                    f"line {number} is a part of a board test whose line `begin` is missing or damaged: {line[:80]!r}"
                )
            else:
                outside.append((number, line))
        if part is not None:
            if part.numeric in running:
                raise CheckFailed(f"line {part.line}: {part.numeric} begins again, and no `done` stands before it")
            running.add(part.numeric)
            parts.append(part)
        position = stop
    if running:
        last = lines[-1]
        raise CheckFailed(f"the log ends before `done`; line {last[0]} is its last: {last[1][:80]!r}")
    return BoardLog(tuple(parts), len(text.splitlines()), tuple(outside))


def _numbered(text: str) -> list[LogLine]:
    """Lines that hold something, by their number from 1 on."""
    stripped = (line.strip().rstrip(".") for line in _COLOURS.sub("", text).splitlines())
    return [(number, line) for number, line in enumerate(stripped, 1) if line]


def _found(lines: list[LogLine]) -> list[tuple[BoardOutput, tuple[int, int]]]:
    """Every part, with the positions in `lines` where it starts and after which it ends."""
    found: list[tuple[BoardOutput, tuple[int, int]]] = []
    position = 0
    while position < len(lines):
        head = _BEGIN.fullmatch(lines[position][1])
        if head is None:
            position += 1
            continue
        named = position > 0 and lines[position - 1][1].startswith("board ")
        board = lines[position - 1][1][6:] if named else ""
        part, stop = _part(lines, position, head, board)
        found.append((part, (position - named, stop)))
        position = stop
    if not found:
        tail = lines[-1][1] if lines else "nothing"
        raise CheckFailed(f"the output has no line `begin` of a board test (last line: {tail[:80]!r})")
    return found


def _part(lines: list[LogLine], start: int, head: re.Match[str], board: str) -> tuple[BoardOutput, int]:
    """The part whose `begin` is `lines[start]`, and the position after it."""
    shape = _RESULT if head["mode"] == "all" else _GROUP_CRC
    stop = next((k for k in range(start + 1, len(lines)) if shape.fullmatch(lines[k][1]) is None), None)
    if stop is None:
        raise CheckFailed(f"the board test did not run to its end (last output: {lines[-1][1][:80]!r})")
    number, text = lines[stop]
    end = _END.fullmatch(text)
    if end is None:
        raise CheckFailed(f"line {number} is damaged, or the board test did not run to its end: {text[:80]!r}")
    n_results = int(end[1], 16)
    expected = n_results if head["mode"] == "all" else -(-n_results // _GROUP)
    if stop - start - 1 != expected:
        raise CheckFailed(
            f"the output holds {stop - start - 1} lines of results, its end in line {number} says {expected}"
        )
    costs, after = _read_costs(lines, stop + 1)
    part = BoardOutput(
        id=head["id"],
        numeric=head["numeric"],
        model=int(head["model"], 16),
        random=int(head["random"], 16),
        board=board,
        n_results=n_results,
        words=_words(lines[start + 1 : stop], pairs=head["mode"] == "all"),
        costs=costs,
        line=lines[start][0],
    )
    return part, after


def _words(results: list[LogLine], *, pairs: bool) -> NDArray[np.uint32]:
    words = np.frombuffer(bytes.fromhex("".join(text for _, text in results)), dtype=">u4").astype(np.uint32)
    return words.reshape(-1, 2) if pairs else words


def _read_costs(lines: list[LogLine], position: int) -> tuple[dict[str, Cost], int]:
    costs = {}
    while position < len(lines) and (found := _COST.fullmatch(lines[position][1])) is not None:
        calls, low, high, sum_high, sum_low, stack = (int(word, 16) for word in found["words"].split())
        costs[found["what"]] = Cost(calls, low, high, (sum_high << 32) + sum_low, stack)
        position += 1
    return costs, position


def compared_words(output: BoardOutput, expected: LogWords) -> BoardComparison:
    """Compare the words of a board test with the reference's (status, bits), shape (n, 2).

    Raises:
        CheckFailed: Another number of results.
    """
    if output.n_results != len(expected):
        raise CheckFailed(f"the board test made {output.n_results} results instead of {len(expected)}")
    if output.words.ndim == 1:
        return _compare_groups(output.words, expected)
    wrong = np.flatnonzero(np.any(output.words != expected, axis=1))
    first = tuple(
        f"vector {k}: status {got[0]:08x} bits {got[1]:08x}, reference {want[0]:08x} {want[1]:08x}"
        for k, got, want in ((int(k), output.words[k], expected[k]) for k in wrong[:_SHOWN_MISMATCHES])
    )
    return BoardComparison(len(expected), int(wrong.size), first)


def _compare_groups(crcs: LogWords, expected: LogWords) -> BoardComparison:
    mismatches, first = 0, []
    for k, got in enumerate(crcs):
        group = expected[k * _GROUP : (k + 1) * _GROUP]
        want = zlib.crc32(group.astype("<u4").tobytes())
        if int(got) != want:
            mismatches += len(group)
            start = k * _GROUP
            first.append(f"vectors {start} to {start + len(group) - 1}: CRC {int(got):08x}, reference {want:08x}")
    return BoardComparison(len(expected), mismatches, tuple(first[:_SHOWN_MISMATCHES]))


_CODE = "tT"
_CONSTANT = "rR"


def board_entries(job: Job, target: Target) -> list[VerifiedTarget]:
    """Entries of `verify.json` for one target, one for each arithmetic."""
    numerics = [n for n in job.tables if n in target.numerics]
    entries = []
    if target.has_tools():
        with scratch_folder() as work:
            entries = list(_entries(job, target, numerics, work))
    # What was linked shows that nothing is missing: an empty program is linked only to explain a failure.
    if all(entry.status == "fail" for entry in entries) and (package := target.missing()) is not None:
        return [VerifiedTarget(name=target.name, status="missing", numeric=n, package=package) for n in numerics]
    return entries


def _entries(job: Job, target: Target, numerics: list[str], work: Path) -> Iterator[VerifiedTarget]:
    """Compile runtime, table and a test program for each arithmetic, and run it."""
    board = work / "board"
    board.mkdir()
    for name, data in board_test_sources(job.model, Emission(job.tables, {})).items():
        write_own(board / name, data)
    c: Path | CheckFailed
    try:
        files = table_files(job.c_folder, job.model, tuple(job.tables))
        c = checked_sources(job.c_folder, work, files, trusted=job.trusted)
    except CheckFailed as error:
        c = error
    for numeric in numerics:
        entry = partial(
            VerifiedTarget,
            name=target.name,
            numeric=numeric,
            compiler=compiler_version(target.compiler),
            flags=" ".join(target.all_flags),
            table_bytes=job.tables[numeric].table_bytes,
        )
        extra: dict[str, Any] = {}
        try:
            if isinstance(c, CheckFailed):
                raise c
            runtime = runtime_object(target, c, numeric, work, fresh=job.trusted)
            if functions := function_costs(runtime, numeric):
                extra = {"functions": functions}
            table = shared_object(target, c / f"gtc_{job.model.id}.c", work, include=c, fresh=job.trusted)
            shared = _Shared.of(runtime, table, work)
            yield entry(**_ran(job, target, numeric, shared, work, c), **extra)
        except CheckFailed as error:
            yield entry(status="fail", error=str(error), **extra)


@dataclass(frozen=True, slots=True)
class _Shared:
    """Objects of runtime and table: symbols, writable static data."""

    objects: tuple[Path, ...]
    symbols: tuple[Symbol, ...]
    writable_bytes: int

    @classmethod
    def of(cls, runtime: Object, table: Object, work: Path) -> _Shared:
        """Write the objects into a folder."""
        return cls(
            (runtime.put(work / "gtc.o"), table.put(work / "table.o")),
            (*runtime.symbols, *table.symbols),
            runtime.writable_bytes + table.writable_bytes,
        )


def _ran(job: Job, target: Target, numeric: str, shared: _Shared, work: Path, c: Path) -> dict[str, Any]:
    """Run a target in one arithmetic; return its results by the names of `VerifiedTarget`."""
    defines = [f"BOARD_{n.upper()}={int(n == numeric)}" for n in job.tables]
    if target.counts:
        defines.append('BOARD_HEADER="board.h"')
    test = compile_objects(target, [work / "board" / "board_test.c"], work, include=c, defines=defines)
    program = work / f"board_{numeric}"
    link(target, [*test, *shared.objects], program)
    run = run_program(target, program)
    text = run.stdout.decode("ascii", "replace")
    # Some simulators print what a program says among their own messages.
    output = _output_of(text if "begin " in text else run.stderr, job, numeric)
    if run.returncode != 0:
        raise CheckFailed(f"the program ended with status {run.returncode}: {run.stderr[:200]}")
    comparison = compared_words(output, job.expected[numeric])
    return {
        "status": "fail" if comparison.mismatches else "pass",
        "vectors": comparison.vectors,
        "mismatches": comparison.mismatches,
        "first_mismatches": comparison.first,
        **_costs(target, output),
        **_sizes(target, program, shared),
    }


def _output_of(text: str, job: Job, numeric: str) -> BoardOutput:
    """The part of a board test's output for one arithmetic.

    Raises:
        CheckFailed: It is not whole, or of another model.
    """
    parts = [part for part in read_output(text) if part.numeric == numeric]
    if len(parts) != 1:
        raise CheckFailed(f"the output has {len(parts)} parts for {numeric} instead of one")
    check_identity(parts[0], job)
    return parts[0]


def check_identity(output: BoardOutput, job: Job) -> None:
    """Refuse the output of another model."""
    if (output.id, output.model) != (job.model.id, int(job.model.hash[:8], 16)):
        raise CheckFailed(
            f"the output is of table {output.id}, model {output.model:08x}..., "
            f"not of {job.model.id}, model {job.model.hash[:8]}..."
        )


def _costs(target: Target, output: BoardOutput) -> dict[str, Any]:
    """Counts and stack of a call of the map and, separately, of a sample (one in a block evaluates the map)."""
    if target.counts is None:
        return {}
    found: dict[str, Any] = {}
    for what, cost in output.costs.items():
        prefix = "" if what == "map" else f"{what}_"
        found[prefix + target.counts] = CallCost(
            min=round(cost.low / target.ticks_per_count),
            mean=round(cost.total / cost.calls / target.ticks_per_count, 1),
            max=round(cost.high / target.ticks_per_count),
        )
        found[f"{prefix}stack_bytes"] = cost.stack
    return found


def _sizes(target: Target, program: Path, shared: _Shared) -> dict[str, int]:
    """Code and constants of runtime and table that the program links, and their writable static data.

    What is constant is reported by the objects: linker scripts put constants beside the code.
    """
    own = {symbol.name: symbol.kind for symbol in shared.symbols}
    linked = {symbol.name: symbol for symbol in symbols(target, program) if symbol.name in own}.values()
    return {
        "code_bytes": sum(symbol.size for symbol in linked if own[symbol.name] in _CODE),
        "read_only_bytes": sum(symbol.size for symbol in linked if own[symbol.name] in _CONSTANT),
        "ram_bytes": shared.writable_bytes,
    }


_SHOWN = 5  # lines outside of a board test, differences


def log_entries(job: Job, vectors: Vectors, log: Path) -> tuple[list[VerifiedTarget], ReadLog]:
    """Entries of `verify.json`, one for each board and arithmetic, and what the log holds in all.

    All parts of an arithmetic are compared; an entry passes only if each of them does.

    Raises:
        InputError: The file cannot be read.
        CheckFailed: It does not hold whole board tests of this model alone; names the line.
    """
    try:
        found = log_parts(log)
        compared = [(part, _compared(job, vectors, part)) for part in found.parts]
    except CheckFailed as error:
        raise CheckFailed(f"{log}: {error}") from error
    groups: dict[tuple[str, str], list[tuple[BoardOutput, BoardComparison]]] = {}
    for part, comparison in compared:
        groups.setdefault((part.board or log.stem, part.numeric), []).append((part, comparison))
    whole = ReadLog(
        file=log.name,
        lines=found.lines,
        parts=tuple(
            LogPart(line=p.line, numeric=p.numeric, vectors=c.vectors, mismatches=c.mismatches) for p, c in compared
        ),
        absent=tuple(n for n in job.tables if all(p.numeric != n for p, _ in compared)),
        outside=len(found.outside),
        first_outside=tuple(f"line {number}: {line[:80]}" for number, line in found.outside[:_SHOWN]),
    )
    return [_entry(job, log, name, parts) for (name, _), parts in groups.items()], whole


def log_parts(log: Path) -> BoardLog:
    """The board tests that a log holds.

    Raises:
        InputError: The file cannot be read.
        CheckFailed: A line of a board test is damaged, or one is not whole.
    """
    return read_log(read_input(log, "result_mib", "the output of board_test.c").decode("ascii", "replace"))


def _compared(job: Job, vectors: Vectors, part: BoardOutput) -> BoardComparison:
    """A part against the reference."""
    check_identity(part, job)
    table = job.tables.get(part.numeric)
    if table is None:
        raise CheckFailed(f"line {part.line}: no {part.numeric} table was emitted")
    fixed = len(job.expected[part.numeric]) - vectors.n_random
    if part.n_results != fixed + part.random:
        raise CheckFailed(
            f"line {part.line}: {part.random} random vectors were asked for, which makes {fixed + part.random} "
            f"results; the board test made {part.n_results}"
        )
    return compared_words(part, answers(table, replace(vectors, n_random=part.random)))


def _entry(job: Job, log: Path, name: str, parts: Sequence[tuple[BoardOutput, BoardComparison]]) -> VerifiedTarget:
    """Return the entry of a board in one arithmetic; the cost of the calls is that of the last part."""
    mismatches = sum(c.mismatches for _, c in parts)
    several = len(parts) > 1
    first = [f"part at line {p.line}, {text}" if several else text for p, c in parts for text in c.first]
    output = parts[-1][0]
    return VerifiedTarget(
        name=name,
        status="fail" if mismatches else "pass",
        numeric=output.numeric,
        compiler="not known",
        flags="not known",
        log=log.name,
        parts=len(parts),
        table_bytes=job.tables[output.numeric].table_bytes,
        vectors=sum(c.vectors for _, c in parts),
        mismatches=mismatches,
        first_mismatches=tuple(first[:_SHOWN]),
        **_tick_costs(output),
    )


def _tick_costs(output: BoardOutput) -> dict[str, Any]:
    """Ticks and stack of the calls, by the names of `VerifiedTarget`."""
    found: dict[str, Any] = {}
    for what, cost in output.costs.items():
        prefix = "" if what == "map" else f"{what}_"
        mean = round(cost.total / cost.calls, 1)
        found[f"{prefix}ticks"] = CallCost(min=cost.low, mean=mean, max=cost.high)
        found[f"{prefix}stack_bytes"] = cost.stack
    return found
