"""The error bound that a table prints holds for every legal model, or the model is refused.

A bank with a narrow hand-over printed 1.7e-3 deg/h where the table was 0.7 deg/h off the model.
"""

from __future__ import annotations

import random
import re
import secrets
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from extreme import extreme_bank, extreme_model, worst_error_dph
from gyrotc.common import CheckFailed
from gyrotc.mirror import Course, CourseChannel, Recursion, TermOutcome, recursions_of_table
from gyrotc.model import Envelope, Guard, Model, Network, Scale, Term
from gyrotc.results import Numeric
from gyrotc.tables import NUMERICS, channel_error_dph, emit_texts, quantise, quantise_all
from models import bank_of, random_model
from numpy.typing import NDArray

Array = NDArray[np.float64]

_TABLES, _MOST_DRAWN = 12, 500  # many extreme models are refused


@pytest.mark.parametrize("make", [extreme_model, extreme_bank])
def test_the_bound_holds_for_any_legal_model(make: Callable[[int], Model]) -> None:
    first = random.SystemRandom().randrange(2**31)
    print(f"seeds from {first}")
    tables = 0
    for seed in range(first, first + _MOST_DRAWN):
        if tables >= _TABLES:
            break
        model = make(seed)
        for numeric in NUMERICS:
            try:
                table = quantise(model, numeric)
            except CheckFailed:
                continue
            tables += 1
            assert worst_error_dph(model, table, seed) <= table.error_bound_dph, (seed, numeric)
    assert tables >= _TABLES


@pytest.mark.parametrize(
    ("make", "seed"), [(extreme_model, 1100841351), (extreme_model, 1022696059), (extreme_bank, 51000272)]
)
def test_what_is_narrower_than_the_grid_is_within_the_authority(make: Callable[[int], Model], seed: int) -> None:
    """A ridge that crosses another one or is highest at the envelope's edge, a region: 2.6e-6, 0.03, 3 deg/h short."""
    model = make(seed)
    table = quantise(model, "f32")
    assert worst_error_dph(model, table, seed) <= table.error_bound_dph


@pytest.mark.parametrize("width", [0.03, 0.3, 3.0])
def test_the_bound_holds_in_an_envelope_narrower_than_fixed_point_tells(width: float) -> None:
    """Both its ends round to the same 2^-16 C, 6 positions beside the center: fixed point bounds it or refuses it."""
    center = 19.6 / 65536.0
    gaussian = Network(w0=0.0, linear=(0.0, 0.0), centers=((center, 0.0),), widths=((width, None),), weights=(1.0,))
    model = random_model(
        3,
        scale=Scale(temperature_c=(center, 2e-6), slope_c_per_min=1.0),
        envelope=Envelope(temperature_c=(center - 1e-6, center + 1e-6), slope_c_per_min=(-1.0, 1.0)),
        networks=(gaussian,),
        coverage=None,
        fallback_dph=0.0,
    )
    try:
        table = quantise(model, "q31")
    except CheckFailed:
        return
    assert worst_error_dph(model, table, 3) <= table.error_bound_dph


@pytest.mark.parametrize("numeric", NUMERICS)
@pytest.mark.parametrize("id", ["auxiliary_curve", "auxiliary_product"])
def test_the_bound_of_curves_and_products_holds(id: str, numeric: Numeric) -> None:
    """Against float64, for readings all over the guard and temperatures all over the envelope."""
    seed = secrets.randbits(32)
    print(f"seed {seed}")
    rng, close = np.random.default_rng(seed), 0
    for k in range(20):
        model = _with_channel(id, rng)
        try:
            table = quantise(model, numeric)
        except CheckFailed:  # a reading, or a width of less than 2^-6 units, that fixed point does not hold
            continue
        recursion, guard = recursions_of_table(table)[0], model.guards["supply_v"]
        reading = np.concatenate([rng.uniform(guard.low, guard.high, 1000), [guard.low, guard.high]])
        t = rng.uniform(*model.envelope.temperature_c, len(reading))
        numbers = [_as_seen(x, numeric) for x in (reading, t)]
        exact = [x / 65536.0 if numeric == "q31" else x.astype(np.float64) for x in numbers]
        term = model.terms[0]
        want = term.table.recursion(term.parameters, model.block_s)
        found = _added(recursion, *numbers) * (2.0**-table.bias_frac_bits if numeric == "q31" else 1.0)
        worst = float(np.abs(found - _added(want, *exact)).max())
        bound = channel_error_dph(model, numeric, table.bias_frac_bits)
        assert worst <= bound, (k, model.terms)
        close += worst > bound / 20.0
    assert close > 3, "a bound that is never met says nothing"


def _with_channel(id: str, rng: np.random.Generator) -> Model:
    """A model with one term of a channel, of any unit and sign."""
    scale = float(10.0 ** rng.uniform(-1.0, 3.0))
    middle, size = float(rng.normal(0.0, 3.0 * scale)), float(10.0 ** rng.uniform(-4.0, -1.0))
    draw = rng.normal(0.0, 1.0, 3)
    shape: dict[str, float] = {"reference": middle, "slope_dph_per_unit": size * draw[0] / scale}
    if id == "auxiliary_curve":
        shape |= {"second_center": middle + scale * draw[1], "width": scale * float(rng.uniform(0.2, 3.0))}
        shape |= {"first_dph": size * draw[2], "second_dph": size * draw[1]}
    else:
        shape |= {"slope_dph_per_unit_per_c": 0.02 * size * draw[1] / scale, "reference_c": 10.0 * draw[2]}
    guard = Guard(
        low=middle - 3.0 * scale, high=middle + 2.0 * scale, fallback=middle, max_step=1e9,
        max_rate_per_min=0.0, agree_s=0.0, stuck_s=0.0, missing_s=100.0,
    )  # fmt: skip
    term = Term(id=id, parameters=shape, channel="supply_v")
    return random_model(3, terms=(term,), guards={"supply_v": guard})


def _as_seen(x: Array, numeric: str) -> NDArray[Any]:
    return np.rint(x * 65536.0).astype(np.int64) if numeric == "q31" else x.astype(np.float32)


def _added(recursion: Recursion, mean: NDArray[Any], t: NDArray[Any]) -> Array:
    course = Course(t, np.ones(len(t), dtype=bool), np.arange(len(t)))
    none = np.zeros(len(t), dtype=np.int32)
    outcome = TermOutcome(t, np.zeros_like(t), np.zeros_like(t), none)
    recursion.apply(course, CourseChannel(mean, none, none.astype(bool)), outcome)
    return np.asarray(outcome.added, dtype=np.float64)


def _two(overlap: float, *, first: float = 0.0, last: float = 1.0, step: float = 1.0) -> Model:
    """Two constants `step` deg/h, whose regions overlap by a part of the envelope; edges as parts of it."""
    model = random_model(3, coverage=None, q31_bias_frac_bits=20)
    t0, t1 = model.envelope.temperature_c

    def part(low: float, high: float, w0: float) -> Network:
        region = Envelope(
            temperature_c=(t0 + low * (t1 - t0), t1 if high == 1.0 else t0 + high * (t1 - t0)),
            slope_c_per_min=model.envelope.slope_c_per_min,
        )
        return Network(w0=w0, linear=(0.0, 0.0), centers=(), widths=(), weights=(), region=region)

    halves = part(first, 0.5 + overlap / 2, 100.0), part(0.5 - overlap / 2, last, 100.0 + step)
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
    model = _two(1e-2, step=0.0)
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
    network = model.networks[0].model_copy(update={"widths": ((1e-3, 1e-3),) * n, "centers": ((400.0, 1000.0),) * n})
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
