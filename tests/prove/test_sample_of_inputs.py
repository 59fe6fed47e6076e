"""The visit of every input, on a sample of the inputs: figures, and faults that it must see."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from emitted import emitted, spoil
from gyrotc.mirror import evaluate_map
from gyrotc.verify import Visited, visit_all
from jobs import job_of
from models import random_model

SAMPLE = 128  # one slice of 128: slopes from the middle of the range on


def _visit(folder: Path, every: int = SAMPLE) -> Visited:
    job = job_of(folder)
    return visit_all(job.c_folder, job.model, job.tables["q31"], every=every, trusted=True)


def test_sample_of_all_inputs_agrees_and_keeps_the_bound(tmp_path: Path) -> None:
    folder = emitted(tmp_path)
    table = job_of(folder).tables["q31"]
    shares: list[float] = []
    job = job_of(folder)
    visited = visit_all(
        job.c_folder, job.model, table, every=SAMPLE, progress=lambda _, done, total: shares.append(done / total)
    )
    assert visited.mismatches == 0
    assert visited.inputs > 2**24
    assert len(shares) == 128 and shares == sorted(shares) and shares[-1] == 1.0
    assert 0.0 < visited.arithmetic_dph <= visited.worst_dph <= table.error_bound_dph
    arithmetic = {k: v for k, v in table.bound_parts_dph.items() if k != "rounded inputs"}
    assert visited.arithmetic_dph <= sum(arithmetic.values())
    assert abs(visited.mean_dph) <= visited.arithmetic_dph


def test_worst_error_is_that_of_the_model(tmp_path: Path) -> None:
    """The figures of the C program against numpy, at inputs that it visits (one slice of slopes)."""
    folder = emitted(tmp_path)
    job = job_of(folder)
    table = job.tables["q31"]
    visited = _visit(folder)
    rng = np.random.default_rng(3)
    low_t, high_t, low_r, high_r = (int(v) for v in table.numbers(table.envelope))
    middle, top = low_r + (high_r - low_r) // 2 + 1, low_r + (high_r - low_r) * 65 // 128
    inputs = np.stack([rng.integers(low_t, high_t, 20000), rng.integers(middle, top, 20000)], axis=1)
    _, bits = evaluate_map(table, inputs.astype(np.int32).view(np.uint32))
    t, slope = inputs.T / 65536.0
    error = np.abs(table.decode_bias(bits) - job.model.map_dph(t, slope * 60.0 / job.model.block_s))
    assert 0.6 * visited.worst_dph < error.max() <= visited.worst_dph * (1 + 1e-9)


@pytest.mark.parametrize("seed", [1, 2, 5])
def test_sample_agrees_for_other_tables(seed: int, tmp_path: Path) -> None:
    folder = emitted(tmp_path, random_model(seed))
    visited = _visit(folder)
    assert visited.mismatches == 0
    assert visited.worst_dph <= job_of(folder).tables["q31"].error_bound_dph


def test_one_wrong_bit_of_the_gaussians_table_is_seen(tmp_path: Path) -> None:
    folder = emitted(tmp_path)
    spoil(folder / "c" / "gtc_q31.c", "0x3DD4FFA7UL", "0x3DD40000UL")
    visited = _visit(folder)
    assert 0 < visited.mismatches < visited.inputs
    assert "reference" in visited.first[0]


def test_wrong_status_is_seen(tmp_path: Path) -> None:
    folder = emitted(tmp_path)
    spoil(folder / "c" / "gtc_q31.c", r"\|= GTC_UNCOVERED;", "|= GTC_OK;", count=0)
    assert _visit(folder).mismatches > 0


def test_table_that_is_not_the_model_leaves_the_bound(tmp_path: Path) -> None:
    """C and integers agree on a table whose constant is wrong: only the model tells."""
    folder = emitted(tmp_path)
    job = job_of(folder)
    table = job.tables["q31"]
    shift = round(3.0 * table.error_bound_dph * 2.0**table.bias_frac_bits)
    networks = table.networks.copy()
    networks[1] = (int(networks[1]) + shift) & 0xFFFFFFFF
    wrong = replace(table, networks=networks)
    path = folder / "c" / "gtc_rlg_0042.c"
    signed = [int(n[1]) for n in (table.numbers(t.networks) for t in (table, wrong))]
    if f"{signed[0]}" in path.read_text():
        spoil(path, rf"\b{signed[0]}\b", str(signed[1]))
    else:
        spoil(path, f"(?i)0x0*{int(table.networks[1]):x}UL", f"0x{int(networks[1]):x}UL")
    visited = visit_all(job.c_folder, job.model, wrong, every=SAMPLE)
    assert visited.mismatches == 0
    assert visited.worst_dph > table.error_bound_dph
