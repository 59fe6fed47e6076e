"""Bounds on instructions: graphs of code by hand, loops by their text, and what an emulator counts."""

from __future__ import annotations

import sys
from pathlib import Path
from types import SimpleNamespace

import pytest
from conftest import ROOT
from emitted import measured
from gyrotc.common.errors import CheckFailed
from gyrotc.results.release import FunctionCost
from gyrotc.verify import board
from gyrotc.verify.bounds import Paths, Program
from gyrotc.verify.flow import Counts, LoopText, parse_flows
from gyrotc.verify.sizes import PUBLIC
from gyrotc.verify.toolchain import Object, all_targets

sys.path.insert(0, str(ROOT))

from bench.bounds import bounds_of, gaussian_instructions, model_of, section

COUNTS = Counts({"n_terms": 3, "slope_blocks": 10}, 4, False, 5, 100, ())
TEXT = [
    "for (i = 0U; i < FN(n_terms)(state->table); i++) {",
    "    for (k = 0U; k < (uint_least32_t)GTC_MAX_TERMS; k++) {",
    "        while (queue != 0U) {",
    "            x++;",
]


def code(*rows: str) -> str:
    """What objdump prints: a name, `address instruction operands`, `:line` of the text."""
    printed = []
    for row in rows:
        if row.startswith(":"):
            printed.append(f"/place/gtc.c{row}")
        elif row.endswith(":"):
            printed.append(f"{int(row.split()[0], 16):08x} <{row.split()[1][:-1]}>:")
        else:
            address, name, *operands = row.split(" ", 2)
            printed.append(f"    {address}:\t{name}" + "".join(f"\t{o}" for o in operands))
    return "\n".join(printed)


def most(*rows: str) -> int:
    """The bound of the function at address 0."""
    text = LoopText(TEXT, {"GTC_MAX_TERMS": 4}, COUNTS)
    paths = Paths(Program(parse_flows(code(*rows), "gtc.c"), {}, text), "f32")
    paths.whole(0)
    return paths.most()


def test_the_longer_of_two_ways_counts() -> None:
    assert most("0 f:", "0 cmp r0, #0", "2 beq.n 8 <f+0x8>", "4 adds r0, #1", "6 adds r0, #2", "8 bx lr") == 5


def test_a_loop_that_is_tested_last_turns_as_often_as_its_text_says() -> None:
    rows = ("0 f:", "0 movs r1, #0", ":1", "2 adds r1, #1", "4 cmp r1, r0", "6 bne.n 2 <f+0x2>", "8 bx lr")
    assert most(*rows) == 1 + 3 * 3 + 1


def test_a_loop_that_is_tested_first_is_tested_once_more() -> None:
    rows = (
        "0 f:", "0 movs r1, #0", ":1", "2 cmp r1, r0", "4 beq.n a <f+0xa>", "6 adds r1, #1", "8 b.n 2 <f+0x2>",
        ":0", "a bx lr",
    )  # fmt: skip
    assert most(*rows) == 1 + 3 * 4 + 2 + 1


def test_a_loop_that_goes_round_behind_its_test_is_tested_last_if_its_body_stands_before() -> None:
    rows = (
        "0 f:", "0 movs r1, #0", ":4", "2 cmp r2, #0", "4 beq.n 8 <f+0x8>", "6 adds r3, #1",
        ":1", "8 adds r1, #1", "a cmp r1, #3", "c beq.n 12 <f+0x12>", ":4", "e movs r2, #1", "10 b.n 2 <f+0x2>",
        ":0", "12 bx lr",
    )  # fmt: skip
    assert most(*rows) == 1 + 3 * 6 + 2 * 2 + 1


def test_what_is_called_counts_each_time_and_a_jump_to_a_function_ends() -> None:
    called = ("20 g:", "20 adds r0, #1", "22 bx lr")
    assert most("0 f:", "0 push {lr}", "2 bl 20 <g>", "6 bl 20 <g>", "a pop {pc}", *called) == 4 + 2 * 2
    assert most("0 f:", "0 adds r0, #1", "2 b.w 20 <g>", *called) == 2 + 2


def test_inner_loops_turn_for_each_turn_of_the_outer() -> None:
    rows = (
        "0 f:", "0 movs r1, #0", "2 movs r2, #0", ":2", "4 adds r2, #1", "6 bne.n 4 <f+0x4>",
        ":1", "8 adds r1, #1", "a bne.n 2 <f+0x2>", ":0", "c bx lr",
    )  # fmt: skip
    assert most(*rows) == 1 + 3 * (1 + 4 * 2 + 2) + 1


@pytest.mark.parametrize(
    ("rows", "why"),
    [
        (("0 f:", "0 bl 0 <f>", "4 bx lr"), "cannot be followed"),
        (("0 f:", "0 tbb [pc, r0]", "4 bx lr"), "not followed"),
        (("0 f:", "0 add pc, r3", "2 bx lr"), "not followed"),
        (("0 f:", ":3", "0 adds r0, #1", "2 bne.n 0 <f>", "4 bx lr"), "no bound for the loop of line 3"),
        (("0 f:", "0 adds r0, #1", "2 bne.n 0 <f>", "4 bx lr"), "of no one loop"),
        (
            ("0 f:", "0 beq.n 6 <f>", "2 adds r0, #1", "4 beq.n a <f>", "6 adds r0, #1", "8 b.n 2 <f>", "a bx lr"),
            "two entries",
        ),
    ],
)  # fmt: skip
def test_code_without_a_bound_is_refused(rows: tuple[str, ...], why: str) -> None:
    with pytest.raises(CheckFailed, match=why):
        most(*rows)


@pytest.mark.slow
def test_no_count_exceeds_its_bound_and_no_bound_is_far_from_the_count() -> None:
    """An increment is divided by libgcc, whose longest way its divisor never takes; both shares of a rest are shifted
    as often as the largest squares of any table need; how far other bounds are from the counts depends on how a release
    of the compiler arranges branches."""
    target = all_targets()["cortex-m4f"]
    if target.missing():
        pytest.skip(f"{target.missing()} is not installed")
    rows = bounds_of(model_of("filter"), target)
    assert [(r["numeric"], r["function"]) for r in rows] == [(n, f) for n in ("f32", "q31") for f in PUBLIC]
    quotients = {(r["numeric"], r["function"]): r["bound"] / r["counted"] for r in rows}
    assert min(quotients.values()) >= 1.0
    print({key: round(quotient, 3) for key, quotient in quotients.items()})
    if measured(target):
        assert quotients.pop(("q31", "rezero")) <= 1.45, "1.332 with GCC 12.2, 1.405 with GCC 14.2"
        assert max(quotients.values()) <= 1.3, "1.252 with GCC 12.2, 1.235 with GCC 14.2"
    page = section({"rows": [r | {"model": "filter", "core": "cortex-m4f"} for r in rows]})
    assert "No count exceeds its bound" in page


def test_a_gaussian_of_a_channel_takes_about_25_instructions() -> None:
    target = all_targets()["cortex-m4f"]
    if target.missing():
        pytest.skip(f"{target.missing()} is not installed")
    found = gaussian_instructions()
    print(found)
    assert set(found) == {"f32", "q31"} and min(found.values()) > 0.0, "its code was found"
    if measured(target):
        assert all(20.0 <= count <= 30.0 for count in found.values()), "25.5 and 25.0 with GCC 12.2 and 14.2"


def test_a_target_whose_code_has_no_bound_is_verified_without_one(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    """Bits that agree were reported as a fail: code at -O3 has loops that no line of the text bounds."""
    cost = FunctionCost(code_bytes=10, stack_bytes=4, helpers=())

    def refuse(*_: object) -> dict[str, dict[str, int]]:
        raise CheckFailed("no bound")

    monkeypatch.setattr(board, "function_costs", lambda *_: {"f32": {"map": cost}})
    monkeypatch.setattr(board, "instruction_bounds", refuse)
    job = SimpleNamespace(tables={}, model=SimpleNamespace(symbol="a"))
    runtime = Object("", b"", (), 0, "")
    found = board._functions(job, all_targets()["cortex-m4f"], tmp_path, tmp_path, runtime)
    assert found == {"f32": {"map": cost}}
