"""Builds that are wrong on purpose. Each must be caught by a program that ran to its end with mismatches.

A proof harness that cannot fail proves nothing. Controls that need further emulators stand in
tests/targets/.
"""

from __future__ import annotations

import re
import shutil
import subprocess
from pathlib import Path

import pytest
from emitted import emitted, ran_and_differed, spoil, with_flags
from gyrotc.verify import Job, Target, board_entries
from jobs import job_of
from models import bank_of, random_model, random_terms

SELF_TEST_FAILED = "vector 0: status fffffffd"  # GTC_E_SELF_TEST
LAYOUT_REFUSED = "vector 0: status fffffffe"  # GTC_E_LAYOUT
IMAGE_REFUSED = "vector 0: status fffffffc"  # GTC_E_IMAGE
CONTRACTED = ("-std=gnu99", "-ffp-contract=fast")
# Macros that gcc sets with -ffast-math, which the runtime refuses to compile with.
FAST_MATH = ("-ffast-math", "-U__FAST_MATH__")


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    return emitted(tmp_path)


def _entry(job: Job, target: Target, numeric: str) -> dict:
    return next(e for e in _contents(job, target) if e["numeric"] == numeric)


def _contents(job: Job, target: Target) -> list[dict]:
    return [entry.content() for entry in board_entries(job, target)]


@pytest.mark.parametrize("name", ["cortex-m4f", "s390x"])
def test_contracted_build_is_caught_by_vectors_and_by_the_self_test(folder: Path, name: str) -> None:
    """gcc's own dialect fuses a * b + c across statements wherever the processor can."""
    job = job_of(folder)
    entry = _entry(job, with_flags(name, *CONTRACTED), "f32")
    assert ran_and_differed(entry), entry
    assert entry["mismatches"] > 100
    assert entry["first_mismatches"][0].startswith(SELF_TEST_FAILED)
    assert not ran_and_differed(_entry(job, with_flags(name), "f32"))


def test_contracted_build_leaves_fixed_point_exact(folder: Path) -> None:
    job = job_of(folder)
    assert "q31" in job.tables
    assert _entry(job, with_flags("cortex-m4f", *CONTRACTED), "q31")["status"] == "pass"


def test_fast_math_is_refused_by_the_compiler_and_caught_where_it_hides(folder: Path) -> None:
    job = job_of(folder)
    assert "fast-math" in _entry(job, with_flags("host-gcc-O2", "-ffast-math"), "f32")["error"]
    entry = _entry(job, with_flags("host-gcc-O2", *FAST_MATH), "f32")
    assert ran_and_differed(entry), entry


def test_natural_expressions_are_caught_where_float_is_computed_in_double(folder: Path) -> None:
    """s390x evaluates float expressions in double: one expression rounds once where two statements round twice."""
    compiler = "s390x-linux-gnu-gcc"
    command = [compiler, "-std=c99", "-dM", "-E", "-x", "c", "/dev/null"]
    macros = subprocess.run(command, capture_output=True, text=True, check=True).stdout
    natural_expressions(folder)
    entry = _entry(job_of(folder), with_flags("s390x", "-Wno-unused-variable"), "f32")
    in_double = "#define __FLT_EVAL_METHOD__ 1" in macros  # gcc 14 computes in float there
    assert ran_and_differed(entry) == in_double, entry


def natural_expressions(folder: Path) -> None:
    """Joins product and sum of the float32 map into one expression each."""
    spoil(
        folder / "c" / "gtc_f32.c", r"(\w+) = ([^;=\n]+ \* [^;\n]+);\n +acc = acc \+ \1;", r"acc = acc + \2;", count=0
    )


def test_a_wrong_rounding_shift_is_caught(folder: Path) -> None:
    """The fixed-point sum divided towards zero instead of rounded down: one unit, seen by the vectors."""
    job = job_of(folder)
    if "q31" not in job.tables:
        pytest.fail("the fixed-point table of the golden model is missing")
    spoil(folder / "c" / "gtc_q31.c", r"\(uint_least64_t\)sum >> 29", "(uint_least64_t)(sum / 536870912LL)")
    entry = _entry(job, with_flags("host-gcc-O2"), "q31")
    assert ran_and_differed(entry), entry
    assert entry["first_mismatches"][0].startswith(SELF_TEST_FAILED)


@pytest.mark.parametrize("numeric", ["f32", "q31"])
def test_a_flipped_bit_in_an_array_of_the_table_is_caught(folder: Path, numeric: str) -> None:
    path = folder / "c" / "gtc_rlg_0042.c"
    text = path.read_text()
    start = text.index(f"{numeric}_coverage[")
    match = re.compile(r"0x([0-9a-f]+)UL").search(text, start)
    assert match is not None
    path.write_text(text[: match.start(1)] + f"{int(match[1], 16) ^ 8:x}" + text[match.end(1) :])
    entry = _entry(job_of(folder), with_flags("host-gcc-O2"), numeric)
    assert ran_and_differed(entry), entry
    assert entry["first_mismatches"][0].startswith(IMAGE_REFUSED)


@pytest.mark.parametrize("numeric", ["f32", "q31"])
def test_a_table_of_another_layout_is_refused_at_run_time(folder: Path, numeric: str) -> None:
    """By `check`, and by `init`: every result of the history is that of a state that was never started."""
    spoil(folder / "c" / "gtc_rlg_0042.c", r"\.layout = \d+,", ".layout = 99,", count=0)
    entry = _entry(job_of(folder), with_flags("host-gcc-O2"), numeric)
    assert ran_and_differed(entry), entry
    assert entry["first_mismatches"][0].startswith(LAYOUT_REFUSED)
    assert entry["mismatches"] > 1000


def test_a_table_of_another_layout_is_refused_by_the_compiler(folder: Path) -> None:
    spoil(folder / "c" / "gtc.h", r"#define GTC_TABLE_LAYOUT 3", "#define GTC_TABLE_LAYOUT 4")
    for entry in _contents(job_of(folder), with_flags("host-gcc-O2")):
        assert entry["status"] == "fail" and "layout" in entry["error"]


@pytest.fixture(scope="module", params=[2, 3])
def extended(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A bank of three networks with four terms; both together have every kind of term."""
    model = random_model(request.param)
    folder = tmp_path_factory.mktemp("extended")
    return emitted(folder, bank_of(model.model_copy(update={"terms": random_terms(request.param)})))


TERM_FAULTS = {
    "memory that does not move": (r"follow_memory\(z, x, gain\);", "(void)gain;"),
    "play with one wall in the middle": (r" low = (?:\(\w+\))?diff\(x, width\)", " low = x"),
    "warm-up a block late": (r"warm_up_value\(state->elapsed,", "warm_up_value(state->elapsed + 1U,"),
    "harmonic with half its phase": (r"\(x, frequency, phase, amp", "(x, frequency, phase / 2, amp"),
    "few readings of a block refused": (r"\(in->valid >= 2U\) \|\| ", ""),
    "missing channel not said": (r"remarks \|= GTC_HELD", "remarks |= GTC_OK"),
    "no hand-over at the upper edge": (r"if \(high < envelope\[1\]\)", "if (high < envelope[0])"),
}
ABSENT = {2: "play with", 3: "harmonic with"}
"""Begins the fault of the one kind of term that a model lacks, by the seed of the model."""
CAUGHT = [(seed, fault) for seed in ABSENT for fault in TERM_FAULTS if not fault.startswith(ABSENT[seed])]


@pytest.mark.parametrize(("extended", "fault"), CAUGHT, indirect=["extended"])
def test_a_fault_in_a_term_or_in_the_hand_over_is_caught(fault: str, extended: Path, tmp_path: Path) -> None:
    copy = Path(shutil.copytree(extended, tmp_path / "copy"))
    for numeric in ("f32", "q31"):
        spoil(copy / "c" / f"gtc_{numeric}.c", *TERM_FAULTS[fault], count=0)
    for entry in _contents(job_of(copy), with_flags("host-gcc-O2")):
        assert ran_and_differed(entry), entry


def test_the_controls_of_terms_start_from_a_build_that_passes(extended: Path) -> None:
    for entry in _contents(job_of(extended), with_flags("host-gcc-O2")):
        assert entry["status"] == "pass", entry


def test_the_controls_start_from_a_build_that_passes(folder: Path) -> None:
    copy = Path(shutil.copytree(folder, folder / "copy"))
    for entry in _contents(job_of(copy), with_flags("host-gcc-O2")):
        assert entry["status"] == "pass", entry
