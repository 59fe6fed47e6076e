"""What a board test prints, read and compared: results or CRCs of groups, and the cost of the calls.

The text may come from an emulator (which may colour its lines) or from a user's terminal: line ends may be any, and
what an emulator prints of its own is passed over. Of a log that a user brings every line is accounted for.
"""

from __future__ import annotations

import re
import zlib
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from ..common.errors import CheckFailed

__all__ = ["BoardComparison", "BoardLog", "BoardOutput", "Cost", "compared_words", "read_log", "read_output"]

Words = NDArray[np.uint32]
Line = tuple[int, str]
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
    words: Words
    costs: dict[str, Cost] = field(default_factory=dict)
    line: int = 1  # of its `begin`


@dataclass(frozen=True, slots=True)
class BoardLog:
    """A whole log: its parts, the number of its lines, and those that stand outside of a board test, by number."""

    parts: tuple[BoardOutput, ...]
    lines: int
    outside: tuple[Line, ...]


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
                raise CheckFailed(
                    f"line {part.line}: {part.numeric} begins again, and no `done` stands before it"
                )
            running.add(part.numeric)
            parts.append(part)
        position = stop
    if running:
        last = lines[-1]
        raise CheckFailed(f"the log ends before `done`; line {last[0]} is its last: {last[1][:80]!r}")
    return BoardLog(tuple(parts), len(text.splitlines()), tuple(outside))


def _numbered(text: str) -> list[Line]:
    """Lines that hold something, by their number from 1 on."""
    stripped = (line.strip().rstrip(".") for line in _COLOURS.sub("", text).splitlines())
    return [(number, line) for number, line in enumerate(stripped, 1) if line]


def _found(lines: list[Line]) -> list[tuple[BoardOutput, tuple[int, int]]]:
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


def _part(lines: list[Line], start: int, head: re.Match[str], board: str) -> tuple[BoardOutput, int]:
    """The part whose `begin` is `lines[start]`, and the position after it."""
    shape = _RESULT if head["mode"] == "all" else _GROUP_CRC
    stop = next((k for k in range(start + 1, len(lines)) if shape.fullmatch(lines[k][1]) is None), None)
    if stop is None:
        raise CheckFailed(f"the board test did not run to its end (last output: {lines[-1][1][:80]!r})")
    number, text = lines[stop]
    end = _END.fullmatch(text)
    if end is None:
        raise CheckFailed(
            f"line {number} is damaged, or the board test did not run to its end: {text[:80]!r}"
        )
    n_results = int(end[1], 16)
    expected = n_results if head["mode"] == "all" else -(-n_results // _GROUP)
    if stop - start - 1 != expected:
        raise CheckFailed(
            f"the output holds {stop - start - 1} lines of results, its end in line {number} says {expected}"
        )
    costs, after = _costs(lines, stop + 1)
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


def _words(results: list[Line], *, pairs: bool) -> NDArray[np.uint32]:
    words = np.frombuffer(bytes.fromhex("".join(text for _, text in results)), dtype=">u4").astype(np.uint32)
    return words.reshape(-1, 2) if pairs else words


def _costs(lines: list[Line], position: int) -> tuple[dict[str, Cost], int]:
    costs = {}
    while position < len(lines) and (found := _COST.fullmatch(lines[position][1])) is not None:
        calls, low, high, sum_high, sum_low, stack = (int(word, 16) for word in found["words"].split())
        costs[found["what"]] = Cost(calls, low, high, (sum_high << 32) + sum_low, stack)
        position += 1
    return costs, position


def compared_words(output: BoardOutput, expected: Words) -> BoardComparison:
    """Compares the words of a board test with the reference's (status, bits), shape (n, 2).

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


def _compare_groups(crcs: Words, expected: Words) -> BoardComparison:
    mismatches, first = 0, []
    for k, got in enumerate(crcs):
        group = expected[k * _GROUP : (k + 1) * _GROUP]
        want = zlib.crc32(group.astype("<u4").tobytes())
        if int(got) != want:
            mismatches += len(group)
            start = k * _GROUP
            first.append(
                f"vectors {start} to {start + len(group) - 1}: CRC {int(got):08x}, reference {want:08x}"
            )
    return BoardComparison(len(expected), mismatches, tuple(first[:_SHOWN_MISMATCHES]))
