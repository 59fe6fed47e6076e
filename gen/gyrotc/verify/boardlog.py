"""What a board test prints, read and compared: results or CRCs of groups, and the cost of the calls.

The text may come from an emulator (which may colour its lines) or from a user's terminal, so lines
outside `begin` ... `end` are ignored and line ends may be any.
"""

from __future__ import annotations

import re
import zlib
from collections.abc import Iterator
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from ..errors import CheckFailed

__all__ = ["BoardOutput", "Comparison", "Cost", "compare", "read_output"]

Words = NDArray[np.uint32]
_GROUP = 256
_SHOWN_MISMATCHES = 5
_COLOURS = re.compile(r"\x1b\[[0-9;]*m")
_BEGIN = re.compile(
    r"^begin (?P<id>\S+) (?P<numeric>\w+) (?P<mode>all|crc) (?P<model>[0-9a-f]{8}) (?P<random>[0-9a-f]{8})$"
)


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


@dataclass(frozen=True, slots=True)
class Comparison:
    """Results compared, mismatches among them, and the first of them with all bits.

    Where only CRCs were printed, all results of a differing group count as mismatches.
    """

    vectors: int
    mismatches: int
    first: tuple[str, ...]


def read_output(text: str) -> list[BoardOutput]:
    """The parts of a board test's output, one for each arithmetic.

    Raises:
        CheckFailed: It is not whole: no `begin`, no `end`, a damaged line, another number of results.
    """
    lines = [line.strip().rstrip(".") for line in _COLOURS.sub("", text).splitlines()]
    parts = list(_parts(lines))
    if not parts:
        tail = next((line for line in reversed(lines) if line), "nothing")
        raise CheckFailed(f"the output has no line `begin` of a board test (last line: {tail[:80]!r})")
    return parts


def _parts(lines: list[str]) -> Iterator[BoardOutput]:
    board, number = "", 0
    while number < len(lines):
        line = lines[number]
        if line.startswith("board "):
            board = line[6:]
        head = _BEGIN.match(line)
        number += 1
        if head is None:
            continue
        stop = next((k for k in range(number, len(lines)) if lines[k].startswith("end ")), None)
        if stop is None:
            last = next(text for text in reversed(lines) if text)
            raise CheckFailed(f"the board test did not run to its end (last output: {last[:80]!r})")
        words = _words(lines, number, stop, 2 if head["mode"] == "all" else 1)
        n_results = int(lines[stop][4:], 16)
        expected = n_results if head["mode"] == "all" else -(-n_results // _GROUP)
        if len(words) != expected:
            raise CheckFailed(f"the output holds {len(words)} lines of results, its end says {expected}")
        costs, number = _costs(lines, stop + 1)
        yield BoardOutput(
            id=head["id"],
            numeric=head["numeric"],
            model=int(head["model"], 16),
            random=int(head["random"], 16),
            board=board,
            n_results=n_results,
            words=words if head["mode"] == "all" else words[:, 0],
            costs=costs,
        )


def _words(lines: list[str], start: int, stop: int, columns: int) -> Words:
    shape = re.compile(r"[0-9a-f]{8}" + r" [0-9a-f]{8}" * (columns - 1))
    for number in range(start, stop):
        if shape.fullmatch(lines[number]) is None:
            raise CheckFailed(f"line {number + 1} of the output is damaged: {lines[number][:80]!r}")
    octets = bytes.fromhex("".join(lines[start:stop]))
    return np.frombuffer(octets, dtype=">u4").astype(np.uint32).reshape(-1, columns)


def _costs(lines: list[str], number: int) -> tuple[dict[str, Cost], int]:
    costs = {}
    while number < len(lines) and lines[number].startswith("cost "):
        _, what, *words = lines[number].split()
        calls, low, high, sum_high, sum_low, stack = (int(word, 16) for word in words)
        costs[what] = Cost(calls, low, high, (sum_high << 32) + sum_low, stack)
        number += 1
    return costs, number


def compare(output: BoardOutput, expected: Words) -> Comparison:
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
    return Comparison(len(expected), int(wrong.size), first)


def _compare_groups(crcs: Words, expected: Words) -> Comparison:
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
    return Comparison(len(expected), mismatches, tuple(first[:_SHOWN_MISMATCHES]))
