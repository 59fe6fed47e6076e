"""Legal models at the edges of what docs/FORMAT.md allows, and inputs at which an error of a table is largest."""

from __future__ import annotations

from typing import Any

import numpy as np
from gyrotc.mirror import Table, evaluate_map, f32_words
from gyrotc.model import Envelope, Model, Network, Scale
from models import random_model
from numpy.typing import NDArray

_FLAT = 1e-7  # of the span: the narrowest overlap
_MOST_DPH = 7.5e6  # docs/FORMAT.md: no number of a network is larger


def _log(rng: np.random.Generator, low: float, high: float) -> float:
    return float(10.0 ** rng.uniform(np.log10(low), np.log10(high)))


def extreme_model(seed: int) -> Model:
    """One network whose envelope, scale, widths, centers and weights are of any size that is legal."""
    rng = np.random.default_rng([seed, 77])
    t0 = float(rng.uniform(-200.0, 390.0))
    t1 = min(t0 + _log(rng, 1e-6, 500.0), 400.0)
    r1 = _log(rng, 1e-6, 900.0)
    r0 = -r1 if rng.random() < 0.7 else r1 * float(rng.uniform(-1.0, 1.0))
    half_t = (t1 - t0) / 2 * _log(rng, 0.3, 30.0)
    half_r = max(abs(r0), abs(r1)) * _log(rng, 0.3, 30.0)
    n = int(rng.integers(0, 12))
    size = _log(rng, 1e-12, 1e6)

    def width() -> float | None:
        return None if rng.random() < 0.1 else _log(rng, 1e-3, 1e3)

    inside = rng.random() < 0.7

    def legal(value: float) -> float:
        return min(max(float(value), -_MOST_DPH), _MOST_DPH)

    network = Network(
        w0=legal(rng.normal(0.0, 1.0) * size * _log(rng, 1e-3, 5.0)),
        linear=(legal(rng.normal(0.0, size)), legal(rng.normal(0.0, size))),
        centers=tuple(
            (float(rng.uniform(t0, t1)), float(rng.uniform(r0, r1)))
            if inside
            else (float(rng.uniform(-200.0, 400.0)), float(rng.uniform(-1000.0, 1000.0)))
            for _ in range(n)
        ),
        widths=tuple((width(), width()) for _ in range(n)),
        weights=tuple(legal(v) for v in rng.normal(0.0, size, n)),
    )
    return random_model(
        seed,
        block_s=_log(rng, 0.01, 3600.0),
        scale=Scale(temperature_c=((t0 + t1) / 2, half_t), slope_c_per_min=half_r),
        envelope=Envelope(temperature_c=(t0, t1), slope_c_per_min=(r0, r1)),
        coverage=None,
        networks=(network,),
        fallback_dph=network.w0,
    )


def _side(rng: np.random.Generator, low: float, high: float) -> list[tuple[float, float]]:
    """An interval as one to three that overlap, touch, or reach beyond it."""
    n = int(rng.integers(1, 4))
    if n == 1:
        return [(low, high)]
    span = high - low
    cuts = np.sort(rng.uniform(low, high, n - 1))
    overlap = span * _log(rng, _FLAT, 0.5)
    edges = [low, *cuts, high]
    parts = []
    for k in range(n):
        first = edges[k] if k == 0 else edges[k] - overlap / 2
        last = edges[k + 1] if k == n - 1 else edges[k + 1] + overlap / 2
        if rng.random() < 0.1:
            first -= span * float(rng.uniform(0.0, 0.5))
        if rng.random() < 0.1:
            last += span * _log(rng, 1e-9, 0.5)
        parts.append((first, last))
    return parts


def extreme_bank(seed: int) -> Model:
    """A bank of two to nine networks with a hand-over of any width, over an ordinary or an extreme envelope."""
    rng = np.random.default_rng([seed, 78])
    model = random_model(seed) if rng.random() < 0.7 else extreme_model(seed)
    (t0, t1), (r0, r1) = model.envelope.temperature_c, model.envelope.slope_c_per_min
    network = model.networks[0]
    networks = []
    for t in _side(rng, t0, t1):
        for r in _side(rng, r0, r1):
            region = Envelope(
                temperature_c=(max(t[0], -200.0), min(t[1], 400.0)),
                slope_c_per_min=(max(r[0], -1000.0), min(r[1], 1000.0)),
            )
            offset = float(rng.normal(0.0, 1.0)) * _log(rng, 1e-6, 10.0)
            factor = float(rng.normal(1.0, 0.5))
            networks.append(
                network.model_copy(
                    update={
                        "region": region,
                        "w0": min(network.w0 + offset, _MOST_DPH),
                        "weights": tuple(w * factor for w in network.weights),
                    }
                )
            )
    return model.model_copy(update={"networks": tuple(networks)})


def worst_error_dph(model: Model, table: Table, seed: int) -> float:
    """Largest departure of the table from the model over inputs that are sought where it is large."""
    bits = _inputs(model, table, seed)
    status, words = evaluate_map(table, bits)
    inputs = table.decode_inputs(bits)
    usable = (status >= 0) & np.all(np.isfinite(inputs), axis=1)
    t, slope = inputs[usable].T
    exact = model.map_dph(t, slope * 60.0 / model.block_s)
    return float(np.max(np.abs(table.decode_bias(words[usable]) - exact), initial=0.0))


def _inputs(model: Model, table: Table, seed: int) -> NDArray[np.uint32]:
    """Bits of inputs: anywhere, and close to edges of envelope and regions and to centers; shape (n, 2)."""
    rng = np.random.default_rng([seed, 79])
    per_block = model.block_s / 60.0
    columns = []
    for k, unit in ((0, 1.0), (1, per_block)):
        envelope = _pair(model.envelope, k)
        marks = [*envelope]
        for network in model.networks:
            marks += [c[k] for c in network.centers]
            marks += _pair(network.region, k) if network.region is not None else ()
        near = np.repeat(np.array(marks), 40)
        spread = (envelope[1] - envelope[0]) * 10.0 ** rng.uniform(-10.0, -1.0, near.size)
        near = near + spread * rng.choice([-1.0, 0.0, 1.0], near.size)
        points = np.concatenate([near, rng.uniform(*envelope, 2000)]) * unit
        columns.append(_bits(table, points, rng))
    n = 6000
    return np.stack([rng.choice(column, n) for column in columns], axis=1)


def _pair(box: Any, axis: int) -> tuple[float, float]:
    return tuple(box.slope_c_per_min if axis else box.temperature_c)


def _bits(table: Table, points: NDArray[np.float64], rng: np.random.Generator) -> NDArray[np.uint32]:
    if table.numeric == "f32":
        return f32_words(points)
    whole = np.clip(np.rint(points * 65536.0), -(2**31) + 1, 2**31 - 1).astype(np.int64)
    return (whole & 0xFFFFFFFF).astype(np.uint32)
