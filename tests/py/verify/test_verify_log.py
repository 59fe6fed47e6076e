"""`gyrotc verify --log`: every part of a log is compared, and every line of it accounted for."""

from __future__ import annotations

import random
from pathlib import Path

import pytest
from conftest import Command
from emitted import emitted
from gyrotc.common.errors import CheckFailed
from gyrotc.verify.job import verify
from jobs import job_of


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return emitted(tmp_path_factory.mktemp("whole"))


@pytest.fixture(scope="module")
def run(whole: Path) -> list[str]:
    """What a board prints that is right: two arithmetics, each with its cost."""
    job = job_of(whole)
    lines = []
    for numeric, rows in job.expected.items():
        lines += ["board bench", f"begin {job.model.id} {numeric} all {job.model.hash[:8]} {20000:08x}"]
        lines += [f"{status:08x} {bits:08x}" for status, bits in rows.tolist()]
        lines += [f"end {len(rows):08x}", *(f"cost {what}" + " 00000010" * 6 for what in ("map", "step"))]
    return [*lines, "done"]


def _spoilt(line: str) -> str:
    return line[:-1] + ("0" if line[-1] != "0" else "1")


def _result(folder: Path, tmp_path: Path, lines: list[str]) -> dict:
    log = tmp_path / "bench.log"
    log.write_text("\r\n".join(lines) + "\r\n")
    return verify(folder, log=log).content()


def _at(run: list[str], start: str, numeric: str) -> int:
    """Where the line of a part stands."""
    begin = next(k for k, line in enumerate(run) if line.startswith("begin ") and f" {numeric} " in line)
    return next(k for k in range(begin, len(run)) if run[k].startswith(start))


def test_chatter_before_and_after_is_allowed_and_counted(whole: Path, run: list[str], tmp_path: Path) -> None:
    lines = ["U-Boot 2026.01", "board support 3", "", *run, "$ reboot", "end of log", "done", "board off"]
    result = _result(whole, tmp_path, lines)
    assert result["failed"] == 0 and result["passed"] == 2
    assert result["log"]["lines"] == len(lines) and result["log"]["outside"] == 6
    assert [part["line"] for part in result["log"]["parts"]] == [5, 4 + _at(run, "begin", "q31")]
    assert {e["name"] for e in result["targets"]} == {"bench"} and result["log"]["absent"] == []


@pytest.mark.parametrize("order", ["good first", "bad first"])
def test_a_bad_run_beside_a_good_one_fails(order: str, whole: Path, run: list[str], tmp_path: Path) -> None:
    bad = list(run)
    k = _at(run, "end", "f32") - 7
    bad[k] = _spoilt(bad[k])
    lines = [*run, "login:", *bad] if order == "good first" else [*bad, *run]
    result = _result(whole, tmp_path, lines)
    entries = {e["numeric"]: e for e in result["targets"]}
    assert (entries["f32"]["status"], entries["f32"]["mismatches"], entries["f32"]["parts"]) == ("fail", 1, 2)
    assert "part at line" in entries["f32"]["first_mismatches"][0]
    assert entries["q31"]["status"] == "pass" and result["failed"] == 1
    assert [p["mismatches"] for p in result["log"]["parts"]].count(1) == 1


DAMAGE = {
    "begin": lambda line: line.replace("begin", "bexin"),
    "begin's arithmetic": lambda line: line.replace(" all ", " al "),
    "begin's model": lambda line: line[:-17] + "x" + line[-16:],
    "begin's count": _spoilt,
    "end": lambda line: line.replace("end", "and"),
    "end's count": _spoilt,
    "end's digits": lambda line: line[:-1] + "z",
    "cost": lambda line: line.replace("cost", "c0st"),
    "cost's digits": lambda line: line[:-1],
}


@pytest.mark.parametrize("numeric", ["f32", "q31"])
@pytest.mark.parametrize("damage", DAMAGE)
def test_a_damaged_line_is_named(
    damage: str, numeric: str, whole: Path, run: list[str], tmp_path: Path
) -> None:
    k = _at(run, damage.partition("'")[0], numeric)
    lines = list(run)
    lines[k] = DAMAGE[damage](lines[k])
    assert lines[k] != run[k]
    with pytest.raises(CheckFailed, match=r"bench\.log: .*line \d+") as caught:
        pytest.fail(f"{_result(whole, tmp_path, lines)}")
    near = [str(n) for n in (k, k + 1, k + 2)] + [str(_at(run, "begin", n) + 1) for n in ("f32", "q31")]
    ends = [str(_at(run, "end", n) + 1) for n in ("f32", "q31")]
    boards = [str(_at(run, "begin", n)) for n in ("f32", "q31")]
    assert any(f"line {number}" in str(caught.value) for number in near + ends + boards), caught.value


def test_any_line_lost_torn_or_put_in_is_seen(whole: Path, run: list[str], tmp_path: Path) -> None:
    """All lines of a run count: without one, with half of one, with one more between them it is no pass."""
    seed = random.SystemRandom().randrange(2**32)
    print(f"seed {seed}")
    draw = random.Random(seed)
    for what in ("lost", "torn", "put in", "twice"):
        for k in [*draw.sample(range(2, len(run)), 3), len(run) - 1]:
            if run[k].startswith("board ") or (what in ("put in", "twice") and run[k] == "done"):
                continue
            new = {
                "lost": [],
                "torn": [run[k][: len(run[k]) // 2]],
                "put in": ["temperature alarm", run[k]],
                "twice": [run[k], run[k]],
            }[what]
            if what == "lost" and run[k].startswith("cost "):
                continue  # costs are optional
            try:
                result = _result(whole, tmp_path, run[:k] + new + run[k + 1 :])
            except CheckFailed:
                continue
            assert result["failed"], (what, k, run[k])


def test_a_log_that_is_cut_off_after_a_part_is_refused(whole: Path, run: list[str], tmp_path: Path) -> None:
    with pytest.raises(CheckFailed, match="before `done`"):
        pytest.fail(f"{_result(whole, tmp_path, run[: _at(run, 'begin', 'q31') - 1])}")


def test_a_count_of_random_vectors_that_does_not_fit_is_refused_before_it_is_made(
    whole: Path, run: list[str], tmp_path: Path
) -> None:
    k = _at(run, "begin", "f32")
    lines = list(run)
    lines[k] = lines[k][:-8] + "f0004e20"  # four thousand million: memory for all of them was taken
    with pytest.raises(CheckFailed, match="random vectors"):
        pytest.fail(f"{_result(whole, tmp_path, lines)}")


def test_one_arithmetic_alone_is_said(whole: Path, run: list[str], tmp_path: Path, gyrotc: Command) -> None:
    copy = emitted(tmp_path / "copy")
    log = tmp_path / "bench.log"
    log.write_text("\n".join(["boot", *run[: _at(run, "begin", "q31") - 1], "done", ""]))
    done = gyrotc("verify", copy, "--log", log)
    assert done.returncode == 0
    assert "did not test q31" in done.stdout and "outside: line 1: boot" in done.stdout
