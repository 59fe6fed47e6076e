"""The last line of `build`: what was gained about zero, what of it a constant alone gives, and about the mean."""

from __future__ import annotations

import numpy as np
import pytest
from gyrotc.cli.results import summary
from gyrotc.common.metrics import Averages
from gyrotc.pages.comparison import ENVIRONMENTS
from gyrotc.results.evaluation import EvaluatedRun, Evaluation, ModelSizes, Pooled, RunStatistics

RNG = np.random.default_rng(3)
BEFORE = 7e-3 + 9e-4 * RNG.normal(size=400)
AFTER = 7e-4 * RNG.normal(size=400)
CONSTANT = 7.2e-3  # mean of the training runs


def part(before: np.ndarray, after: np.ndarray) -> Pooled:
    still = np.zeros(len(before))
    return Pooled.of([Averages(still, before, after, still)])


def evaluation(**changes: object) -> Evaluation:
    exam, train = part(BEFORE, AFTER), part(np.full(400, CONSTANT), AFTER)
    longer = dict.fromkeys(("rms_30min_dph", "angle_1h_arcsec", "first_10min_rms_dph"))
    runs = tuple(
        EvaluatedRun(file=f"{name}.csv", role="exam", environment=name, samples=400, before=exam.before,
                     after=RunStatistics(**exam.after.model_dump(), **longer))
        for name in ENVIRONMENTS
    )  # fmt: skip
    sizes = ModelSizes(method="mrbf", centers=4, table_bytes=104, rom_bytes=None, ram_bytes=None, sizes_on=None,
                       sum_abs_weights_dph=1e-3)  # fmt: skip
    fields: dict[str, object] = {
        "gyrotc_version": "0.1.0", "serial": "A-1", "axis": None, "numeric": "f32", "block_s": 10.0,
        "average_s": 100.0, "noise_floor_dph": 7e-4, "noise_floor_source": "simulated", "mismatches": None,
        "runs": runs, "train": train, "exam": exam, "findings": (), "model": sizes,
    }  # fmt: skip
    return Evaluation(**{**fields, **changes})  # type: ignore[arg-type]


def test_the_headline_says_how_much_of_the_improvement_is_a_constant() -> None:
    def rms(x: np.ndarray) -> float:
        return float(np.sqrt(np.mean(x**2)))

    zero, alone = rms(BEFORE) / rms(AFTER), rms(BEFORE) / rms(BEFORE - CONSTANT)
    mean = BEFORE.std() / AFTER.std()
    assert len({f"{x:.2f}" for x in (zero, alone, mean)}) == 3
    assert summary(evaluation()).startswith(
        f"improvement about zero {zero:.2f} (paper: 9.8-10.4; a constant alone: {alone:.2f}), about the mean {mean:.2f}"
    )


@pytest.mark.parametrize(
    ("changes", "begins"),
    [
        ({"noise_floor_source": "estimated"}, "improvement about zero {0:.2f} (a constant alone: "),
        ({"train": None}, "improvement about zero {0:.2f} (paper: 9.8-10.4), about the mean {1:.2f}; RMS "),
        (
            {"exam": None, "left_out": part(BEFORE, AFTER)},
            "improvement about zero on spans left out {0:.2f} (a constant alone: ",
        ),
    ],
)
def test_what_is_not_known_is_not_said(changes: dict[str, object], begins: str) -> None:
    """The paper's figures beside its own campaign alone; a constant only where there are training runs."""
    judged = part(BEFORE, AFTER)
    assert judged.improvement is not None and judged.before.std_dph is not None and judged.after.std_dph
    ratio = judged.before.std_dph / judged.after.std_dph
    assert summary(evaluation(**changes)).startswith(begins.format(judged.improvement, ratio))
