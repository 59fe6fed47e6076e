"""examples/nav_loop: the firmware in the emulator prints what the host prints: the reference's bias times time."""

from __future__ import annotations

import subprocess
from pathlib import Path

import numpy as np
import pytest
from emitted import GOLDEN, emitted
from gyrotc.mirror import replay
from gyrotc.model import load_model
from gyrotc.tables import quantise_all
from gyrotc.verify import all_targets, compile_c, run_program
from results import Results

EXAMPLE = Path(__file__).resolve().parents[2] / "examples" / "nav_loop"
TICKS, TICK_US, SAMPLES_PER_BLOCK, NO_READING = 64, 15625, 10, -32768


def _printed(name: str, numeric: str, folder: Path, work: Path) -> list[str]:
    """Lines of the example on a target, compiled with the emitted files as a user copies them."""
    target = all_targets()[name]
    work.mkdir()
    c = folder / "c"
    sources = [EXAMPLE / "main.c", EXAMPLE / f"nav_{numeric}.c", c / f"gtc_{numeric}.c", c / "gtc_rlg_0042.c"]
    compile_c(target, sources, work / "nav_loop", include=c)
    done = run_program(target, work / "nav_loop", data=[(EXAMPLE / "sequence.txt").read_bytes()])
    assert done.returncode == 0, done.stderr
    return done.stdout.decode("ascii").splitlines()


def _bias_angle_arcsec(numeric: str) -> float:
    """Sum of bias times time over the sequence, by the reference, which loads no compiled code."""
    table = quantise_all(load_model(GOLDEN), [numeric]).tables[numeric]
    words = np.loadtxt(EXAMPLE / "sequence.txt")[:, 0]
    temperature = np.where(words == NO_READING, np.nan, words / 128.0)
    bits = table.encode_inputs(temperature)[:, None]
    missed = np.zeros(len(words), dtype=np.int64)
    found = replay(table, bits, missed=missed, samples_per_block=SAMPLES_PER_BLOCK)
    return float(np.sum(table.decode_bias(found.bits)) * TICKS * TICK_US * 1e-6)


@pytest.mark.parametrize("numeric", ["f32", "q31"])
def test_firmware_and_host_print_the_same(numeric: str, tmp_path: Path, results: Results) -> None:
    folder = emitted(tmp_path)
    names = ["host-gcc-O2", "cortex-m4f"]
    host, firmware = (_printed(name, numeric, folder, tmp_path / name) for name in names)
    assert len(host) == 20 and firmware == host
    _, _, measured, compensated, bits = host[-1].split()
    table = quantise_all(load_model(GOLDEN), [numeric]).tables[numeric]
    fraction = 16 if numeric == "f32" else table.bias_frac_bits
    counts = int(np.loadtxt(EXAMPLE / "sequence.txt")[:, 1].sum())
    angle = int(bits, 16) - (2**64 if int(bits, 16) >= 2**63 else 0)
    subtracted = counts * 2.0**-16 - angle * 2.0**-fraction
    assert abs(subtracted - _bias_angle_arcsec(numeric)) < 2.0**-fraction
    assert abs(int(compensated)) < 0.05 * abs(int(measured))
    results.add(
        "nav_loop",
        {
            "numeric": numeric,
            "lines": len(host),
            "differing_lines": sum(a != b for a, b in zip(host, firmware, strict=True)),
            "measured_arcsec": int(measured) / 1024,
            "compensated_arcsec": int(compensated) / 1024,
        },
    )


@pytest.mark.parametrize("numeric", ["f32", "q31"])
def test_the_examples_own_makefile_builds_and_compares(numeric: str) -> None:
    done = subprocess.run(
        ["make", "-B", "-C", str(EXAMPLE), f"NAV={numeric}"], capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    assert "the same in every bit" in done.stdout
