"""Faults planted in emitted tables, each of which tools/check_table.py must see."""

from __future__ import annotations

import shutil
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from checked_tables import checked, extended
from conftest import ROOT
from emitted import GOLDEN, board_folder, emitted, flip, spoil
from gyrotc.mirror import Table
from gyrotc.model import Model, load_model
from gyrotc.tables import Emission, emit, emit_texts, quantise_all, write_texts

UNCERTAIN = ROOT / "examples" / "nav_loop" / "filter_model.json"


@pytest.fixture(scope="module")
def uncertain(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A table as training ships it: with uncertainties and their rules. Before, it could not be read."""
    return emitted(tmp_path_factory.mktemp("uncertain"), load_model(UNCERTAIN))


def test_a_table_with_uncertainties_is_the_model(uncertain: Path) -> None:
    done = checked(uncertain)
    assert done.returncode == 0, done.stdout + done.stderr


@pytest.mark.parametrize("numeric", ["f32", "q31"])
@pytest.mark.parametrize("word", [0, 45, 80, 81, 89, 90])
def test_seeded_fault_in_the_uncertainty_is_seen(word: int, numeric: str, tmp_path: Path, few_vectors: None) -> None:
    """A cell of either grid, the first rules, noise and correlation time."""
    model = load_model(UNCERTAIN)
    table = quantise_all(model, [numeric]).tables[numeric]
    words = _words(table, "sigma")
    words[word] += 4
    write_texts(tmp_path, emit_texts(model, Emission({numeric: replace(table, sigma=words)}, {}), asked=True), model)
    done = checked(tmp_path)
    assert done.returncode == 1 and f"word {word} of the uncertainty" in done.stdout, done.stdout


@pytest.mark.parametrize(
    "macro", ["Q31_BIAS_FRAC_BITS", "BLOCK_US", "ID", "PERIOD_MAX_US", "T_MIN_C", "AUTHORITY_MIN_DPH", "N_CHANNELS"]
)
def test_a_wrong_macro_of_the_header_is_seen(macro: str, uncertain: Path, tmp_path: Path) -> None:
    shutil.copytree(uncertain, tmp_path / "spoilt")
    header = tmp_path / "spoilt" / "c" / "gtc_sim_0003.h"
    spoil(header, rf"(GTC_SIM_0003_{macro} \(?-?(?:0x)?)[0-9a-f]", r"\g<1>7")
    done = checked(tmp_path / "spoilt")
    assert done.returncode == 1 and ("header" in done.stdout), done.stdout


def test_a_bound_that_proves_nothing_is_seen(uncertain: Path, tmp_path: Path) -> None:
    shutil.copytree(uncertain, tmp_path / "spoilt")
    spoil(tmp_path / "spoilt" / "c" / "gtc_sim_0003.h", r"\|error\| <= \S+", "|error| <= 1.00e-03")
    done = checked(tmp_path / "spoilt")
    assert done.returncode == 1 and "it proves nothing" in done.stdout


def test_a_table_shifted_by_zero_at_is_the_model(tmp_path: Path) -> None:
    model = load_model(GOLDEN)
    emit(model, tmp_path, zero_at=21.0625)
    done = checked(tmp_path)
    assert done.returncode == 0, done.stdout + done.stderr


def _words(table: Table, name: str) -> np.ndarray:
    return np.array(getattr(table, name)).copy()


def _record(column: int, change: Callable[[int], int]) -> Callable[[Table], Table]:
    """Changes one word of the weightiest center."""

    def fault(table: Table) -> Table:
        words = _words(table, "centers").reshape(-1, 5)
        k = int(np.argmax(np.abs(table.numbers(table.centers).reshape(-1, 5)[:, 4].astype(float))))
        words[k, column] = change(int(words[k, column])) & 0xFFFFFFFF
        return replace(table, centers=words.reshape(-1))

    return fault


def _head(column: int) -> Callable[[Table], Table]:
    """Changes the sign of w0 or of a linear part."""

    def fault(table: Table) -> Table:
        words = _words(table, "networks")
        word = int(words[column])
        words[column] = (word ^ 0x80000000) if table.numeric == "f32" else (-word & 0xFFFFFFFF)
        return replace(table, networks=words)

    return fault


def _first_center_dropped(table: Table) -> Table:
    """The fault of a loop that starts at one: the record is there, its weight is not."""
    words = _words(table, "centers").reshape(-1, 5)
    k = int(np.argmax(np.abs(table.numbers(table.centers).reshape(-1, 5)[:, 4].astype(float))))
    words[k, 4] = 0
    return replace(table, centers=words.reshape(-1))


def _inputs_swapped(table: Table) -> Table:
    return replace(table, centers=_words(table, "centers").reshape(-1, 5)[:, [2, 3, 0, 1, 4]].reshape(-1))


def _coverage_inverted(table: Table) -> Table:
    return replace(table, coverage=_words(table, "coverage") ^ np.uint32(1))


def _rate_per_block(table: Table) -> Table:
    words, factor = _words(table, "guards"), 1e-6 * table.block_us
    if table.numeric == "f32":
        words[3:4] = (words[3:4].view(np.float32) * np.float32(factor)).view(np.uint32)
    else:
        words[3] = round(int(words[3]) * factor)
    return replace(table, guards=words)


def _guard(column: int, change: Callable[[int], int]) -> Callable[[Table], Table]:
    """Changes one word of the temperature's guard."""

    def fault(table: Table) -> Table:
        words = _words(table, "guards")
        words[column] = change(int(words[column])) & 0xFFFFFFFF
        return replace(table, guards=words)

    return fault


FAULTS: dict[str, Callable[[Table], Table]] = {
    # A record is center, gain of each input in float32, gain and offset in fixed point.
    "second number of T off by 2^17 units": _record(1, lambda w: w + (1 << 17)),
    "second number of the slope off by 2^23 units": _record(3, lambda w: w - (1 << 23)),
    "first number of T off by 1/64": _record(0, lambda w: w + (w >> 6) + 1000),
    "weight in its 20th bit": _record(4, lambda w: w ^ (1 << 19)),
    "weight of the other sign": _record(4, lambda w: -w if w >= 2**31 else w ^ 0x80000000),
    "w0 of the other sign": _head(1),
    "linear in T of the other sign": _head(2),
    "linear in the slope of the other sign": _head(3),
    "a Gaussian lost": _first_center_dropped,
    "T and slope swapped": _inputs_swapped,
    "one bit of the coverage": _coverage_inverted,
    "limit of the rate per block": _rate_per_block,
    "largest step": _guard(2, lambda w: w ^ (1 << 12)),
    "time of agreement off by a microsecond": _guard(4, lambda w: w + 1),
    "time until it is missing off by a block": _guard(6, lambda w: w + 1),
    "block off by a microsecond": lambda t: replace(t, block_us=t.block_us + 1),
    "a letter of the serial": lambda t: replace(t, serial=_words(t, "serial") ^ np.uint32(1)),
    "date of calibration": lambda t: replace(t, calibrated=t.calibrated ^ 1),
    "slope_blocks off by one": lambda t: replace(t, slope_blocks=t.slope_blocks + 1),
    "fallback": lambda t: replace(t, fallback=(t.fallback ^ (1 << 20))),
    "id": lambda t: replace(t, id=t.id ^ 1),
    "envelope": lambda t: replace(t, envelope=(t.envelope[0], t.envelope[1] - (1 << 12), *t.envelope[2:])),
}


def _array(name: str, column: int, change: Callable[[int], int]) -> Callable[[Table], Table]:
    """Changes one word of an array."""

    def fault(table: Table) -> Table:
        words = _words(table, name)
        words[column] = change(int(words[column])) & 0xFFFFFFFF
        return replace(table, **{name: words})

    return fault


def _second_half_shifted(table: Table) -> Table:
    """The fault of a loop that gives a center to the wrong network of a bank."""
    words = _words(table, "networks")
    words[0] -= 1
    words[8] += 1
    return replace(table, networks=words)


EXTENDED_FAULTS: dict[str, Callable[[Table], Table]] = {
    "an edge between networks": _array("networks", 5, lambda w: w - (1 << 12)),
    "a center in the wrong network": _second_half_shifted,
    "w0 of the second network": _array("networks", 9, lambda w: w ^ 0x80000000),
    "kind of a term": _array("terms", 0, lambda w: w % 5 + 1),
    "channel of a term": _array("terms", 1, lambda w: w + 1),
    "first parameter of a term": _array("terms", 2, lambda w: w + 2),
    "second parameter of a term": _array("terms", 3, lambda w: w + 2),
    "a parameter that the term has not": _array("terms", 7, lambda w: w + 1),
    "channels": lambda t: replace(t, guards=np.concatenate([_words(t, "guards"), _words(t, "guards")[:8]])),
}


@pytest.fixture(scope="module")
def model() -> Model:
    return load_model(GOLDEN)


@pytest.mark.parametrize("numeric", ["f32", "q31"])
@pytest.mark.parametrize("name", FAULTS)
def test_seeded_fault_of_quantisation_is_seen(
    name: str, numeric: str, model: Model, tmp_path: Path, few_vectors: None
) -> None:
    table = quantise_all(model, [numeric]).tables[numeric]
    emission = Emission({numeric: FAULTS[name](table)}, {})
    write_texts(tmp_path, emit_texts(model, emission, asked=True), model)
    done = checked(tmp_path, board_folder(tmp_path / "board", model, emission))
    assert done.returncode == 1, (name, done.stdout, done.stderr)


@pytest.mark.parametrize("numeric", ["f32", "q31"])
@pytest.mark.parametrize("name", EXTENDED_FAULTS)
def test_seeded_fault_in_terms_or_bank_is_seen(name: str, numeric: str, tmp_path: Path, few_vectors: None) -> None:
    model = extended(3)
    table = EXTENDED_FAULTS[name](quantise_all(model, [numeric]).tables[numeric])
    write_texts(tmp_path, emit_texts(model, Emission({numeric: table}, {}), asked=True), model)
    done = checked(tmp_path)
    assert done.returncode == 1, (name, done.stdout, done.stderr)


def test_one_flipped_bit_of_source_image_hex_or_answers_is_seen(tmp_path: Path) -> None:
    for file, pattern, bit in (
        ("gtc_rlg_0042.c", r"\.crc = 0x([0-9a-f]{8})", 3),
        ("gtc_rlg_0042.c", r"q31_centers\[50\] = \{\s+B\(0x([0-9a-f]{8})", 0),
        ("gtc_rlg_0042.h", r"sha256 ([0-9a-f]{8})", 3),
    ):
        folder = emitted(tmp_path / f"{file}{bit}")
        flip(folder / "c" / file, pattern, bit)
        done = checked(folder)
        assert done.returncode == 1, (file, done.stdout, done.stderr)
    folder, board = emitted(tmp_path / "answers"), board_folder(tmp_path / "board")
    assert checked(folder, board).returncode == 0
    flip(board / "answers.txt", r"\n00000004 ([0-9a-f]{8})\n", 28)
    assert checked(folder, board).returncode == 1
    folder = emitted(tmp_path / "image")
    path = folder / "c" / "gtc_rlg_0042.bin"
    data = bytearray(path.read_bytes())
    data[260] ^= 1
    path.write_bytes(data)
    assert checked(folder).returncode == 1
