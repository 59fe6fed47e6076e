"""Negative controls on targets whose arithmetic is peculiar: each caught by a program that ran to its end."""

from __future__ import annotations

from pathlib import Path

import pytest
from emitted import emitted, ran_and_differed, with_flags
from gyrotc.verify import Target, board_entries
from jobs import job_of
from test_negative_controls import CONTRACTED, SELF_TEST_FAILED, natural_expressions


def _f32(folder: Path, target: Target) -> dict:
    return next(e for e in board_entries(job_of(folder), target) if e.numeric == "f32").content()


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    return emitted(tmp_path)


def test_natural_expressions_on_x87_are_caught(folder: Path) -> None:
    natural_expressions(folder)
    entry = _f32(folder, with_flags("i386-x87-gcc", "-Wno-unused-variable"))
    assert ran_and_differed(entry), entry


def test_gnu_dialect_on_x87_is_caught_by_the_self_test_too(folder: Path) -> None:
    """-std=gnu99 keeps excess precision across assignments."""
    entry = _f32(folder, with_flags("i386-x87-gcc", "-std=gnu99"))
    assert ran_and_differed(entry), entry
    assert entry["first_mismatches"][0].startswith(SELF_TEST_FAILED)


def test_clang_on_x87_is_caught_by_the_self_test_too(folder: Path) -> None:
    """clang rounds on assignment only where it must store; hence no float32 there."""
    target = with_flags("i386-x87-clang").model_copy(update={"numerics": ("f32",)})
    entry = _f32(folder, target)
    assert ran_and_differed(entry), entry
    assert entry["first_mismatches"][0].startswith(SELF_TEST_FAILED)


# The cross compiler's library was built for the FPU and returns this one in a register of it.
FLOAT_OF_UNSIGNED = """
float __floatunsisf(unsigned long n);
float __floatunsisf(unsigned long n)
{
    const long odd = (long)((n >> 1) | (n & 1UL));
    return (n < 0x80000000UL) ? (float)(long)n : 2.0F * (float)odd;
}
"""


def test_m68k_software_float_is_caught_by_the_self_test(folder: Path) -> None:
    """Its library rounds an exact tie the wrong way: 0xBF25C800 squared."""
    helper = folder / "float_of_unsigned.c"
    helper.write_text(FLOAT_OF_UNSIGNED)
    link = ("-static", "-Wl,-z,muldefs", str(helper))
    target = with_flags("m68k", "-msoft-float").model_copy(update={"link": link})
    entry = _f32(folder, target)
    assert ran_and_differed(entry), entry
    assert entry["first_mismatches"][0].startswith(SELF_TEST_FAILED)


@pytest.mark.parametrize("name", ["aarch64", "riscv64", "powerpc", "cortex-m7"])
def test_contracted_builds_are_caught_by_vectors_and_by_the_self_test(folder: Path, name: str) -> None:
    entry = _f32(folder, with_flags(name, *CONTRACTED))
    assert ran_and_differed(entry), entry
    assert entry["mismatches"] > 100
    assert entry["first_mismatches"][0].startswith(SELF_TEST_FAILED)
