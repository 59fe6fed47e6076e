"""From recordings to a model: what is refused before anything is read."""

from __future__ import annotations

from pathlib import Path

import pytest
from gyrotc.common.errors import InputError
from gyrotc.recordings.records import Dataset
from gyrotc.train.fitting import FitOptions, fit_dataset
from gyrotc.train.methods import METHODS, NETWORK_METHODS


def empty() -> Dataset:
    return Dataset(
        folder=Path("recordings"), serial="A-1", axis=None, description="", earth_rate="none", noise=None,
        applied_table=None, meta={}, runs=(), channels=(), warnings=(),
    )  # fmt: skip


@pytest.mark.parametrize("method", [m for m in METHODS if m not in NETWORK_METHODS] + ["magic"])
def test_a_method_whose_map_no_table_holds_makes_no_model(method: str) -> None:
    """A polynomial would lose its higher powers in model.json."""
    with pytest.raises(InputError, match=r"--method: '\w+'; expected .*mrbf_paper.*compare"):
        fit_dataset(empty(), FitOptions(method=method))


def test_without_training_runs_there_is_no_model() -> None:
    with pytest.raises(InputError, match="no run has the role train"):
        fit_dataset(empty(), FitOptions())
