"""What a verification says of all arithmetics is what the worst of them has, whichever this is."""

from __future__ import annotations

from pathlib import Path

import pytest
from gyrotc.model import Model, Network
from gyrotc.tables import emit
from gyrotc.verify import verify
from models import random_model


def scaled(size: float) -> Model:
    """A small map whose constant alone is large or small."""
    network = Network(w0=size, linear=(1e-4, 1e-5), centers=((0.0, 0.0),), widths=((1.0, 1.0),), weights=(1e-3,))
    return random_model(1, networks=(network,), fallback_dph=size)


@pytest.mark.parametrize(("size", "worst"), [(1e-4, "q31"), (50.0, "f32")])
def test_the_error_bound_is_that_of_the_worst_arithmetic(size: float, worst: str, tmp_path: Path) -> None:
    """float32 rounds in shares of a value; fixed point has one step for all of a table."""
    model = scaled(size)
    emit(model, tmp_path)
    found = verify(tmp_path, compiled=False)
    bounds = {error.numeric: error.bound_dph for error in found.errors}
    assert set(bounds) == {"f32", "q31"}
    assert found.error_bound_dph == max(bounds.values())
    assert found.worst_error_dph.value == max(error.worst_dph for error in found.errors)
    assert max(bounds, key=lambda numeric: bounds[numeric]) == worst
