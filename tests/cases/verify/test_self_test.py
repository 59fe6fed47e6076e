"""No float32 build passes the self-test of a table whose results it gets wrong.

A slice for every run; tests/targets/test_self_test.py has the whole matrix.
"""

from __future__ import annotations

from fractions import Fraction
from pathlib import Path

import numpy as np
import pytest
from gyrotc.mirror import FUSIBLE, evaluate_map, product_plus
from gyrotc.tables import N_PROBES, quantise
from self_tests import OK, RIGHT, models, native, write_sources


@pytest.fixture(scope="module")
def sources(tmp_path_factory: pytest.TempPathFactory) -> list[Path]:
    return write_sources(tmp_path_factory.mktemp("tables"))


def test_a_processor_that_flushes_subnormals_is_refused(sources: list[Path], tmp_path: Path) -> None:
    """What other libraries of a program may switch on, and no flag of ours shows; the switch is that of x86-64."""
    flush = tmp_path / "flush.c"
    flush.write_text(
        "__attribute__((constructor)) static void flush(void)\n{\n    __builtin_ia32_ldmxcsr(0x9FC0U);\n}\n"
    )
    verdict = native("gcc", RIGHT, [*sources, flush], tmp_path / "build")
    assert verdict is not None and OK not in verdict.statuses


def test_fused_products_are_those_of_exact_arithmetic() -> None:
    rng = np.random.default_rng(7)
    a, b = rng.normal(0, 3, 2000).astype(np.float32), rng.normal(0, 3, 2000).astype(np.float32)
    c = (-(a.astype(np.float64) * b) * rng.choice([1.0, 0.5, 1e-4, 1e4], 2000)).astype(np.float32)
    found = product_plus("weight", a, b, c, frozenset({"weight"}))
    for x, y, z, value in zip(a, b, c, found, strict=True):
        exact = Fraction(float(x)) * Fraction(float(y)) + Fraction(float(z))
        near = [Fraction(float(np.nextafter(value, np.float32(d)))) for d in (-np.inf, np.inf)]
        error = abs(exact - Fraction(float(value)))
        assert all(error <= abs(exact - n) for n in near)


def test_known_answers_differ_wherever_a_product_is_fused() -> None:
    """Each of the sums alone, and all of them, changes a known answer of nearly every table."""
    builds = [frozenset({place}) for place in FUSIBLE] + [frozenset(FUSIBLE)]
    with_centers = 0
    for model in models():
        table = quantise(model, "f32")
        probes = table.probes.reshape(N_PROBES, 4)
        reported = [int(np.sum(evaluate_map(table, probes[:, :2], b)[1] != probes[:, 2])) for b in builds]
        assert np.array_equal(evaluate_map(table, probes[:, :2])[1], probes[:, 2])
        if len(model.networks[0].weights) >= 3:
            with_centers += 1
            assert min(reported) >= 1, (model.serial, reported)
            assert reported[-1] >= 4, (model.serial, reported)
    assert with_centers >= 25
