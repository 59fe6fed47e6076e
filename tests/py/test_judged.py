"""What a model is judged by is decided in one place, and a check that failed is never kept quiet."""

from __future__ import annotations

from typing import Any

import pytest
from gyrotc.jobs.build import _failures
from gyrotc.judge.judged import judged_by

POOLED = {"improvement": 9.0}


@pytest.mark.parametrize(
    ("there", "kind"),
    [
        (("exam", "left_out", "train"), "exam"),
        (("left_out", "train"), "left_out"),
        (("train",), "train"),
        ((), None),
    ],
)
def test_unseen_runs_count_before_spans_left_out_and_these_before_training(
    there: tuple[str, ...], kind: str | None
) -> None:
    evaluation: dict[str, Any] = {"exam": None, "train": None} | dict.fromkeys(there, POOLED)
    judged = judged_by(evaluation)
    assert (judged and judged.kind) == kind
    assert judged is None or judged.pooled is POOLED


def test_a_proven_bound_that_is_exceeded_fails_a_build() -> None:
    """`verify` counted it as failed, `build` went on with exit status 0."""
    verification = {
        "targets": [],
        "emitted": [],
        "errors": [{"numeric": "q31", "status": "fail", "bound_dph": 1e-7, "worst_dph": 2e-7}],
    }
    [failure] = _failures({"mismatches": 0}, verification, None)
    assert "q31" in failure and "2e-07" in failure and "1e-07" in failure
