"""The error bound that a table prints holds for every legal model, or the model is refused.

A bank with a narrow hand-over printed 1.7e-3 deg/h where the table was 0.7 deg/h off the model.
"""

from __future__ import annotations

import random
import re
from collections.abc import Callable

import numpy as np
import pytest
from extreme import extreme_bank, extreme_model, worst_error_dph
from gyrotc.emit.files import emit_texts, quantise_all
from gyrotc.errors import CheckFailed
from gyrotc.model import Envelope, Model, Network, Scale
from gyrotc.quantise import NUMERICS, quantise
from models import bank_of, random_model

_MODELS = 12


@pytest.mark.parametrize("make", [extreme_model, extreme_bank])
def test_the_bound_holds_for_any_legal_model(make: Callable[[int], Model]) -> None:
    first = random.SystemRandom().randrange(2**31)
    print(f"seeds from {first}")
    tables = 0
    for seed in range(first, first + _MODELS):
        model = make(seed)
        for numeric in NUMERICS:
            try:
                table = quantise(model, numeric)
            except CheckFailed:
                continue
            tables += 1
            assert worst_error_dph(model, table, seed) <= table.error_bound_dph, (seed, numeric)
    assert tables >= _MODELS // 2


def _two(overlap: float, *, first: float = 0.0, last: float = 1.0, apart: float = 1.0) -> Model:
    """Two constants `apart` deg/h, whose regions overlap by a part of the envelope; edges as parts of it."""
    model = random_model(3, coverage=None)
    t0, t1 = model.envelope.temperature_c

    def part(low: float, high: float, w0: float) -> Network:
        region = Envelope(
            temperature_c=(t0 + low * (t1 - t0), t1 if high == 1.0 else t0 + high * (t1 - t0)),
            slope_c_per_min=model.envelope.slope_c_per_min,
        )
        return Network(w0=w0, linear=(0.0, 0.0), centers=(), widths=(), weights=(), region=region)

    halves = part(first, 0.5 + overlap / 2, 100.0), part(0.5 - overlap / 2, last, 100.0 + apart)
    return model.model_copy(update={"networks": halves})


@pytest.mark.parametrize("numeric", NUMERICS)
@pytest.mark.parametrize("overlap", [0.3, 1e-2, 1e-3, 2e-4, 1e-5, 1e-7, 1e-9])
def test_a_narrow_hand_over_is_priced_or_refused(numeric: str, overlap: float) -> None:
    model = _two(overlap)
    try:
        table = quantise(model, numeric)
    except CheckFailed as error:
        assert "hand over" in str(error) and overlap < (1e-3 if numeric == "q31" else 1e-5)
        return
    worst = max(worst_error_dph(model, table, seed) for seed in range(4))
    assert worst <= table.error_bound_dph
    # No refuge in a bound that says nothing: it follows the steepness of the hand-over.
    steep = {"f32": 1e-4 + 1e-5 / overlap, "q31": 2e-4 / overlap}[numeric]
    assert table.error_bound_dph < min(steep, 1.1)


@pytest.mark.parametrize("numeric", NUMERICS)
def test_two_networks_that_are_alike_cost_nothing_to_blend(numeric: str) -> None:
    """But for the roundings of the blend itself, which grow with the bias and not with the difference."""
    model = _two(1e-2, apart=0.0)
    table = quantise(model, numeric)
    assert table.bound_parts_dph["hand-over"] == 0.0
    assert worst_error_dph(model, table, 1) <= table.error_bound_dph


@pytest.mark.parametrize("edge", [1e-7, 1e-10])
def test_a_region_that_ends_within_rounding_of_the_envelope_is_refused(edge: float) -> None:
    """In the model its share grows over the whole region, in the table it would be 1."""
    with pytest.raises(CheckFailed, match=r"ends that close|narrower"):
        quantise(_two(0.3, first=edge), "q31")


def test_regions_that_only_touch_or_leave_a_gap_are_refused() -> None:
    for overlap in (0.0, -0.1):
        for numeric in NUMERICS:
            with pytest.raises(CheckFailed, match="gap"):
                quantise(_two(overlap), numeric)


@pytest.mark.parametrize("numeric", NUMERICS)
@pytest.mark.parametrize(
    "changes",
    [
        {"block_s": 1e-300},
        {"scale": Scale(temperature_c=(0.0, 1e-310), slope_c_per_min=1.0)},
        {"scale": Scale(temperature_c=(0.0, 50.0), slope_c_per_min=1e-310)},
        {"max_step_c": 1e6, "block_s": 3600.0, "max_rate_c_per_min": 1e6},
        {"envelope": Envelope(temperature_c=(20.0, 20.0), slope_c_per_min=(0.0, 0.0))},
        {"fallback_dph": 7.5e6},
        {"fallback_dph": 1e-320},
    ],
    ids=["block", "T scale", "slope scale", "steps", "point", "large", "tiny"],
)  # fmt: skip
def test_numbers_at_the_edge_of_what_is_legal_are_held_or_refused(numeric: str, changes: dict) -> None:
    """Never a traceback, an infinite word or a bound that does not hold."""
    for make in (lambda m: m, bank_of):
        model = make(random_model(5).model_copy(update=changes))
        try:
            table = quantise(model, numeric)
        except CheckFailed:
            continue
        assert np.isfinite(table.error_bound_dph)
        assert worst_error_dph(model, table, 1) <= table.error_bound_dph


def test_weights_below_the_smallest_float_are_lost_and_counted() -> None:
    model = random_model(4)
    network = model.networks[0]
    small = network.model_copy(
        update={"w0": 1e-30, "linear": (0.0, 1e-28), "weights": tuple(1e-26 for _ in network.weights)}
    )
    model = model.model_copy(update={"networks": (small,)})
    table = quantise(model, "f32")
    assert 0.0 < worst_error_dph(model, table, 1) <= table.error_bound_dph


def test_a_gaussian_that_no_shift_of_32_bits_can_hold_is_refused() -> None:
    model = random_model(6)
    n = len(model.networks[0].weights)
    network = model.networks[0].model_copy(
        update={"widths": ((1e-3, 1e-3),) * n, "centers": ((400.0, 1000.0),) * n}
    )
    far = network.model_copy(update={"centers": ((model.envelope.temperature_c[0], -1e-3),) * n})
    for one in (network, far):
        try:
            table = quantise(model.model_copy(update={"networks": (one,)}), "q31")
        except CheckFailed:
            continue
        assert 0 <= table.scale[2] <= 32


def test_the_header_never_prints_less_than_the_bound() -> None:
    for seed in (1, 2):
        model = random_model(seed)
        emission = quantise_all(model, None)
        header = emit_texts(model, emission)[f"gtc_{model.id}.h"].decode("ascii")
        for numeric, table in emission.tables.items():
            printed = re.search(rf"{numeric}: .*<= (\S+) deg/h", header)
            assert printed is not None
            assert table.error_bound_dph <= float(printed[1]) <= 1.02 * table.error_bound_dph
