"""A check that failed is never kept quiet by a build."""

from __future__ import annotations

from types import SimpleNamespace

from gyrotc.jobs.build import _failures
from gyrotc.results.verification import MapError


def test_a_proven_bound_that_is_exceeded_fails_a_build() -> None:
    """`verify` counted it as failed, `build` went on with exit status 0."""
    exceeded = MapError(numeric="q31", status="fail", bound_dph=1e-7, worst_dph=2e-7, inputs_visited=1)
    verification = SimpleNamespace(targets=(), emitted=(), errors=(exceeded,))
    [failure] = _failures(SimpleNamespace(mismatches=0), verification, None)
    assert "q31" in failure and "2e-07" in failure and "1e-07" in failure
