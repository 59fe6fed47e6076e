"""Hand-written models for the tests of tables and runtime."""

from __future__ import annotations

from typing import Any

import numpy as np
from gyrotc.model import Coverage, Envelope, Guard, Model, Network, Rules, Scale, Term, Uncertainty


def random_model(seed: int, **changes: Any) -> Model:
    """A model with random centers, anisotropic widths, coverage and envelope."""
    rng = np.random.default_rng(seed)
    t0 = rng.uniform(-50.0, 20.0)
    t1 = t0 + rng.uniform(2.0, 110.0)
    r = rng.uniform(0.2, 6.0)
    n = int(rng.integers(0, 24))
    cells = int(rng.integers(1, 20)), int(rng.integers(1, 9))
    widths = [tuple(None if rng.random() < 0.1 else float(w) for w in pair) for pair in rng.uniform(0.2, 3.0, (n, 2))]
    values: dict[str, Any] = {
        "serial": f"RLG-{seed}",
        "axis": None,
        "method": "mrbf",
        "block_s": 10.0,
        "slope_blocks": int(rng.integers(2, 12)),
        "lead_blocks": seed % 2,
        "scale": Scale(temperature_c=((t0 + t1) / 2, (t1 - t0) / 2), slope_c_per_min=r),
        "envelope": Envelope(temperature_c=(t0, t1), slope_c_per_min=(-r, r)),
        "coverage": None
        if rng.random() < 0.2
        else Coverage(cells=cells, rows=tuple("".join(row) for row in rng.choice(["0", "1"], (cells[1], cells[0])))),
        "networks": (
            Network(
                w0=float(rng.normal(0.0, 0.01)),
                linear=(float(rng.normal(0.0, 0.01)), float(rng.normal(0.0, 0.01))),
                centers=tuple(zip(rng.uniform(t0, t1, n).tolist(), rng.uniform(-r, r, n).tolist(), strict=True)),
                widths=tuple(widths),
                weights=tuple(rng.normal(0.0, 0.01, n).tolist()),
            ),
        ),
        "fallback_dph": float(rng.normal(0.0, 0.01)),
        "hold_blocks": int(rng.integers(1, 6)),
        "agree_s": float(rng.choice([0.0, 1.0, 2.5, 15.0])),
        "guards": random_guards(seed) if rng.random() < 0.7 else {},
        "stuck_s": float(rng.choice([0.0, 0.0, 6.0, 40.0])),
        "max_step_c": float(rng.uniform(0.05, 1.0)),
        "max_rate_c_per_min": 6.0 * r,
        "noise_floor_dph": None,
        "noise_floor_source": None,
        "data": (),
        "seed": seed,
    }
    return Model(**(values | changes))


def random_guards(seed: int) -> dict[str, Guard]:
    """Guards of the auxiliary channels of `random_terms`, some of them tighter than `random_channels` are."""
    rng = np.random.default_rng([seed, 3])
    return {
        name: Guard(
            low=12.0 - float(rng.uniform(0.05, 3.0)),
            high=12.0 + float(rng.uniform(0.05, 40.0)),
            max_step=float(rng.choice([0.02, 0.5, 1e9])),
            max_rate_per_min=float(rng.choice([0.0, 0.5, 60.0])),
            agree_s=float(rng.choice([0.0, 1.0, 20.0])),
            stuck_s=float(rng.choice([0.0, 30.0])),
            missing_s=float(rng.choice([10.0, 40.0, 1000.0])),
            fallback=12.0,
        )
        for name in ("supply_v", "magnetic_ut")
    }


def random_uncertainty(seed: int, n_terms: int = 0) -> Uncertainty:
    """Grids and rules of the sizes that training gives, spread over decades, some of them 0."""
    rng = np.random.default_rng([seed, 4])
    cells = int(rng.integers(1, 12)), int(rng.integers(1, 8))

    def amounts(n: int) -> list[float]:
        return np.where(rng.random(n) < 0.1, 0.0, 10.0 ** rng.uniform(-6.0, -2.0, n)).tolist()

    def grid() -> tuple[tuple[float, ...], ...]:
        return tuple(tuple(amounts(cells[0])) for _ in range(cells[1]))

    names = [name for name in Rules.model_fields if name not in ("turn_on_freedom", "correlation_s", "terms")]
    rules = Rules(
        **dict(zip(names, amounts(len(names)), strict=True)),
        turn_on_freedom=int(rng.integers(0, 9)),
        correlation_s=float(rng.uniform(1.0, 1e5)),
        terms=tuple(amounts(n_terms)),
    )
    return Uncertainty(cells=cells, rows=grid(), uncovered=grid(), rules=rules)


def random_fallback_model(seed: int, size: float) -> Network:
    """A network of up to four Gaussians anywhere near room temperature."""
    rng = np.random.default_rng([seed, 5])
    n = int(rng.integers(0, 5))
    return Network(
        w0=float(rng.normal(0.0, size)),
        linear=(float(rng.normal(0.0, size)), float(rng.normal(0.0, size))),
        centers=tuple(zip(rng.uniform(-40.0, 60.0, n).tolist(), rng.uniform(-3.0, 3.0, n).tolist(), strict=True)),
        widths=tuple((float(w), None if rng.random() < 0.3 else 1.0) for w in rng.uniform(0.4, 3.0, n)),
        weights=tuple(rng.normal(0.0, size, n).tolist()),
    )


def random_terms(seed: int) -> tuple[Term, ...]:
    """One to four terms of any kind, those of channels with fallback models or without."""
    rng = np.random.default_rng([seed, 1])
    tau, amplitude = float(rng.uniform(15.0, 4000.0)), float(rng.normal(0.0, 0.01))
    every = (
        Term(id="cavity_lag", parameters={"tau_s": tau}),
        Term(
            id="thermal_gradient",
            parameters={"tau_s": float(rng.uniform(5.0, 9000.0)), "amplitude_dph_per_c": amplitude},
        ),
        Term(
            id="hysteresis",
            parameters={"width_c": float(rng.uniform(0.1, 3.0)), "amplitude_dph_per_c": -amplitude},
        ),
        Term(id="warm_up", parameters={"tau_s": tau, "amplitude_dph": 3.0 * amplitude}),
        Term(
            id="path_length_periodicity",
            parameters={
                "period_c": float(rng.uniform(3.0, 30.0)),
                "amplitude_dph": abs(amplitude),
                "phase_rad": float(rng.uniform(-9.0, 9.0)),
            },
        ),
        Term(
            id="auxiliary",
            parameters={"slope_dph_per_unit": amplitude, "reference": float(rng.normal(12.0, 3.0))},
            channel="supply_v",
            fallback_model=random_fallback_model(seed, 0.01) if seed % 4 else None,
        ),
        Term(
            id="auxiliary",
            parameters={"slope_dph_per_unit": 0.1 * amplitude, "reference": 0.0},
            channel="magnetic_ut",
            fallback_model=random_fallback_model(seed + 1, 0.01) if seed % 3 else None,
        ),
    )
    chosen = rng.permutation(len(every))[: int(rng.integers(1, 5))]
    return tuple(_another_form(every[k], np.random.default_rng([seed, 5, k])) for k in chosen)


def _another_form(term: Term, rng: np.random.Generator) -> Term:
    """A term of a channel as a line, a curve or a product, a play with one strength or over T; others as they are."""
    kind = int(rng.integers(0, 3))
    if term.id == "hysteresis" and kind != 0:
        growth = {"amplitude_dph_per_c_per_c": float(rng.normal(0.0, 1e-3))}
        middle = {"reference_c": float(rng.uniform(-40.0, 60.0))} if kind == 1 else {}
        return term.model_copy(update={"parameters": term.parameters | growth | middle})
    if term.channel is None or kind == 0:
        return term
    if kind == 1:
        return Term(
            id="auxiliary_curve",
            parameters=_random_curve(rng),
            channel=term.channel,
            fallback_model=term.fallback_model,
        )
    growth = {"slope_dph_per_unit_per_c": float(rng.normal(0.0, 1e-4))}
    middle = {"reference_c": float(rng.uniform(-40.0, 60.0))}
    parameters = term.parameters | growth | middle
    return term.model_copy(update={"id": "auxiliary_product", "parameters": parameters})


def _random_curve(rng: np.random.Generator) -> dict[str, float]:
    """A bent line about 12, as narrow as two steps of a channel or as wide as all that it shows."""
    return {
        "slope_dph_per_unit": float(rng.normal(0.0, 0.01)),
        "reference": float(rng.normal(12.0, 1.0)),
        "second_center": float(rng.normal(12.0, 1.0)),
        "width": float(10.0 ** rng.uniform(-1.9, 2.0)),
        "first_dph": float(rng.normal(0.0, 0.01)),
        "second_dph": float(rng.normal(0.0, 0.01)),
    }


def bank_of(model: Model) -> Model:
    """The same model with its network thrice: regions that overlap in T, and two of them in the slope."""
    (t0, t1), (r0, r1) = model.envelope.temperature_c, model.envelope.slope_c_per_min
    network = model.networks[0]

    def part(t: tuple[float, float], r: tuple[float, float], factor: float) -> Network:
        region = Envelope(
            temperature_c=(t0 + t[0] * (t1 - t0), t0 + t[1] * (t1 - t0)),
            slope_c_per_min=(r0 + r[0] * (r1 - r0), r0 + r[1] * (r1 - r0)),
        )
        return network.model_copy(update={"region": region, "w0": factor * network.w0 + 0.001 * factor})

    return model.model_copy(
        update={
            "networks": (
                part((0.0, 0.6), (0.0, 1.0), 1.0),
                part((0.4, 1.0), (0.0, 0.7), 1.5),
                part((0.4, 1.0), (0.5, 1.0), -0.5),
            )
        }
    )


def with_memories(model: Model) -> Model:
    """The same network seen through a lag of the cavity, with gradient, hysteresis and warm-up."""
    terms = (
        Term(id="cavity_lag", parameters={"tau_s": 310.0}),
        Term(id="thermal_gradient", parameters={"tau_s": 1800.0, "amplitude_dph_per_c": -0.0004}),
        Term(id="hysteresis", parameters={"width_c": 1.7, "amplitude_dph_per_c": 0.0003}),
        Term(id="warm_up", parameters={"tau_s": 1200.0, "amplitude_dph": 0.004}),
    )
    return model.model_copy(update={"terms": terms})


def bank_with_channels(model: Model) -> Model:
    """The same network thrice with a hand-over, a harmonic, two auxiliary channels, one with a fallback model."""
    wave = {"period_c": 11.0, "amplitude_dph": 0.0007, "phase_rad": 2.0}
    terms = (
        Term(id="path_length_periodicity", parameters=wave),
        Term(id="auxiliary", parameters={"slope_dph_per_unit": 0.002, "reference": 0.25}, channel="supply_v"),
        Term(
            id="auxiliary",
            parameters={"slope_dph_per_unit": -0.001, "reference": 0.0},
            channel="magnetic_ut",
            fallback_model=random_fallback_model(3, 0.001),
        ),
    )
    # Without a noise floor: fixed point costs nearly 1 % of the golden one, more than that with other terms.
    return bank_of(model).model_copy(update={"terms": terms, "noise_floor_dph": None})


def random_channels(model: Model, seed: int, rows: int) -> np.ndarray:
    """Auxiliary channels of a history, with gaps, shape (rows, n)."""
    rng = np.random.default_rng([seed, 2])
    names = {t.channel for t in model.terms if t.channel}
    channels = 12.0 + np.cumsum(rng.normal(0.0, 0.01, (rows, len(names))), axis=0)
    for column in channels.T:
        for _ in range(rows // 60):
            at, length = int(rng.integers(0, rows)), int(rng.integers(1, 60))
            column[at : at + length] = rng.choice([np.nan, 40.0, 12.5, 0.0, 1e20])
    return channels


def random_history(model: Model, seed: int, rows: int, samples_per_block: int) -> tuple[np.ndarray, np.ndarray]:
    """Temperatures with every fault there is, and the samples missed before each: shapes (n,), (n,)."""
    rng = np.random.default_rng(seed)
    low, high = model.envelope.temperature_c
    step = model.max_rate_c_per_min * model.block_s / 60.0 / samples_per_block
    x = (low + high) / 2 + np.cumsum(rng.normal(0.0, 0.3 * (step + model.max_step_c / 5), rows))
    x = low + np.abs((x - low) % (2 * (high - low)) - (high - low))
    missed = np.zeros(rows, dtype=np.int64)
    for _ in range(max(3, rows // 40)):
        at, length = int(rng.integers(0, rows)), int(rng.integers(1, 3 * samples_per_block + 2))
        fault = rng.integers(0, 7)
        if fault == 0:
            x[at : at + length] = np.nan
        elif fault == 1:
            x[at : at + length] = rng.choice([np.inf, -np.inf, 250.0, -91.0, 1e30])
        elif fault == 2:
            x[at : at + int(rng.integers(1, 5))] += rng.choice([-1.0, 1.0]) * rng.uniform(1.0, 30.0)
        elif fault == 3:
            x[at:] = np.clip(x[at:] + rng.normal(0.0, 10.0), -89.0, 199.0)
        elif fault == 4:
            x[at : at + length] = x[at]
        elif fault == 5:
            missed[at] = rng.integers(1, 4 * samples_per_block)
        else:
            missed[at] = rng.integers(1, samples_per_block * (model.hold_blocks + model.slope_blocks + 9))
    return x, missed
