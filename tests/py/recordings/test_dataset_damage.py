"""Whatever the bytes of a data set are, they are read or refused in words; nothing else happens."""

from __future__ import annotations

import contextlib
import random
from collections.abc import Callable
from pathlib import Path

import pytest
from gyrotc.common.errors import InputError
from gyrotc.quality.check import check
from gyrotc.recordings.load import load
from recordings import ACCEPTED

TRIALS = 150


def _flip(data: bytearray, draw: random.Random) -> None:
    data[draw.randrange(len(data))] = draw.randrange(256)


def _cut(data: bytearray, draw: random.Random) -> None:
    del data[draw.randrange(len(data)) :]


def _drop(data: bytearray, draw: random.Random) -> None:
    start = draw.randrange(len(data))
    del data[start : start + draw.randrange(1, 40)]


def _double(data: bytearray, draw: random.Random) -> None:
    start = draw.randrange(len(data))
    data[start:start] = data[start : start + draw.randrange(1, 40)]


def _insert(data: bytearray, draw: random.Random) -> None:
    word = draw.choice(
        [b",", b"\n", b'"', b"\x00", b"1e999", b"nan", b"[[", b"=", b"\xff", b"-", b"\r", b"{}"]
    )
    at = draw.randrange(len(data))
    data[at:at] = word


DAMAGE: tuple[Callable[[bytearray, random.Random], None], ...] = (_flip, _cut, _drop, _double, _insert)


@pytest.mark.parametrize(
    ("case", "name"),
    [
        ("no dataset.toml", "a.csv"),
        ("Parquet", "a.parquet"),
        ("several runs", "dataset.toml"),
        ("pulses", "a.csv"),
    ],
)
def test_damaged_files_are_read_or_refused(case: str, name: str, tmp_path: Path) -> None:
    seed = random.SystemRandom().randrange(10**6)
    print(f"seed {seed}")
    draw = random.Random(seed)
    folder = tmp_path / "RLG-1"
    ACCEPTED[case](folder)
    whole = (folder / name).read_bytes()
    refused = 0
    for _ in range(TRIALS):
        data = bytearray(whole)
        for _ in range(draw.randint(1, 3)):
            if data:
                draw.choice(DAMAGE)(data, draw)
        (folder / name).write_bytes(data)
        try:
            for run in load(folder).runs:
                run.rows()
        except InputError as problem:
            refused += 1
            assert str(problem)
            assert check(folder).problems, "check tells what fit refuses"
        else:
            assert not check(folder).problems
    assert refused > TRIALS // 10


def test_a_damaged_description_of_parquet_never_ends_the_process(tmp_path: Path) -> None:
    """Descriptions of columns that contradict each other made pyarrow abort when it was asked for one of them."""
    folder, draw = tmp_path / "RLG-1", random.Random(1)
    ACCEPTED["Parquet"](folder)
    path = folder / "a.parquet"
    whole = path.read_bytes()
    footer = len(whole) - 8 - int.from_bytes(whole[-8:-4], "little")
    for _ in range(200):
        data = bytearray(whole)
        for _ in range(draw.randint(1, 3)):
            data[draw.randrange(footer, len(data) - 8)] = draw.randrange(256)
        path.write_bytes(data)
        with contextlib.suppress(InputError):
            load(folder)
