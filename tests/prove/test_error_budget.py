"""Block means and slopes in both arithmetics against float64: never beyond the bounds of docs/proof.md, section 3."""

from __future__ import annotations

import numpy as np
import pytest
from emitted import GOLDEN
from gyrotc.mirror import F32, Q31, Guarded, Settings, follow
from gyrotc.model import Model, load_model
from gyrotc.tables import quantise
from numpy.typing import NDArray
from results import Results

U = 2.0**-24
UNIT = 2.0**-16
BLOCKS = 400
ARITHMETICS = {"f32": F32, "q31": Q31}
Floats = NDArray[np.float64]


def _history(rng: np.random.Generator, n: int) -> Floats:
    """Sensor words of 2^-7 C, n to a block: ramps of any steepness; every tenth block is missing."""
    samples = n * BLOCKS
    period = samples / rng.uniform(1.0, 40.0)
    swing = rng.uniform(1.0, 140.0)
    t = 55.0 + swing * (2.0 / np.pi) * np.arcsin(np.sin(2.0 * np.pi * np.arange(samples) / period))
    words = np.rint((t + rng.normal(0.0, rng.choice([0.0, 0.01, 0.3]), samples)) * 128.0) / 128.0
    missing = rng.random(BLOCKS) < 0.1
    missing[0] = False
    words[np.repeat(missing, n)] = np.nan
    return words


def _followed(numeric: str, words: Floats, n: int, blocks: int) -> tuple[Floats, Floats, NDArray[np.bool_]]:
    """Means, slopes and whether there is a slope, for every closed block, in C."""
    arithmetic = ARITHMETICS[numeric]
    unit = 1.0 if numeric == "f32" else UNIT
    x = arithmetic.missing(words.size)
    there = np.isfinite(words)
    x[there] = arithmetic.numbers(words[there] / unit)
    limit = arithmetic.numbers(np.array([1000.0 / unit]))[0]
    guard = Guarded(-limit, limit, limit, limit, 0, 0, BLOCKS)
    steps = follow(arithmetic, x, Settings(n, 1, n, blocks, guard, BLOCKS))
    closed = ~steps.is_restart
    n_closed = int(closed.sum())
    slope = steps.slope[closed] * unit
    return steps.mean[:n_closed] * unit, slope, (steps.remarks[closed] == 0) & steps.valid[:n_closed]


def _exact(words: Floats, n: int, blocks: int) -> tuple[Floats, Floats, Floats, Floats, Floats]:
    """Mean, spread about the base, slope, spread of the window's means and number of them, of every block."""
    rows = words.reshape(BLOCKS, n)
    valid = np.isfinite(rows[:, 0])
    mean = np.where(valid, rows.mean(axis=1), np.nan)
    spread = np.where(valid, np.max(np.abs(rows - rows[:, :1]), axis=1), 0.0)
    slope, width, count = np.zeros(BLOCKS), np.zeros(BLOCKS), np.full(BLOCKS, 2.0)
    for k in np.flatnonzero(valid):
        if k >= blocks - 1:
            window = mean[k - blocks + 1 : k + 1]
            at = np.flatnonzero(np.isfinite(window))
            d = window[at] - window[-1]
            away = at - at.mean()
            if at.size >= 2:
                slope[k] = float(np.sum(away * d) / np.sum(away * away))
            width[k], count[k] = np.max(np.abs(d)), max(at.size, 2)
    return mean, spread, slope, width, count


def _bounds(numeric: str, n: int, exact: tuple[Floats, ...], blocks: int) -> tuple[Floats, Floats]:
    """The bounds of docs/proof.md on mean and slope of every block, C."""
    mean, spread, _, width, count = exact
    if numeric == "f32":
        of_mean = U * (spread * (n / 2 + 3) + np.abs(np.nan_to_num(mean))) * 1.07
        own = 60.0 * U * width
    else:
        of_mean, own = np.full(BLOCKS, 0.5 * UNIT), np.full(BLOCKS, 0.5 * UNIT)
    worst = np.array([of_mean[max(0, k - blocks + 1) : k + 1].max() for k in range(BLOCKS)])
    return of_mean, worst * 4.0 * count / (count**2 - 1.0) + own


@pytest.mark.parametrize("numeric", ARITHMETICS)
def test_means_and_slopes_stay_within_their_bounds(numeric: str, results: Results) -> None:
    seed = 20140801
    rng = np.random.default_rng(seed)
    model = load_model(GOLDEN)
    found = {"block mean": 0.0, "slope": 0.0}
    for n in (1, 3, 10, 100, 1000):
        for blocks in (2, 3, model.slope_blocks, 20):
            words = _history(rng, n)
            mean, slope, has_slope = _followed(numeric, words, n, blocks)
            exact = _exact(words, n, blocks)
            of_mean, of_slope = _bounds(numeric, n, exact, blocks)
            here = np.isfinite(exact[0])[: mean.size]
            mean_error = np.abs(mean - exact[0][: mean.size])[here]
            slope_error = np.abs(slope - exact[2][: slope.size])[has_slope]
            assert has_slope.sum() > BLOCKS // 4
            assert np.all(mean_error <= of_mean[: mean.size][here]), (seed, n, blocks)
            assert np.all(slope_error <= of_slope[: slope.size][has_slope]), (seed, n, blocks)
            if blocks == model.slope_blocks:
                found["block mean"] = max(found["block mean"], float(mean_error.max()))
                found["slope"] = max(found["slope"], float(slope_error.max()))
    _enter(results, numeric, model, found)


def _steepest(model: Model) -> tuple[float, float]:
    """Largest slopes of the map on a grid, deg/h per C and per (C per block)."""
    t, r = (np.linspace(*limits, 801) for limits in (model.envelope.temperature_c, model.envelope.slope_c_per_min))
    bias = model.map_dph(*np.meshgrid(t, r, indexing="ij"))
    per_block = model.block_s / 60.0
    return (
        float(np.max(np.abs(np.diff(bias, axis=0)))) / (t[1] - t[0]),
        float(np.max(np.abs(np.diff(bias, axis=1)))) / ((r[1] - r[0]) * per_block),
    )


def _enter(results: Results, numeric: str, model: Model, found: dict[str, float]) -> None:
    """The budget of the golden model: a block of 1000 samples that spread by 0.1 C, at 80 C and 0.4 C a block."""
    b_t, b_r = _steepest(model)
    m = model.slope_blocks
    of_mean = U * (0.1 * 503 + 80.0) * 1.07 if numeric == "f32" else 0.5 * UNIT
    own = 60.0 * U * 0.4 * m if numeric == "f32" else 0.5 * UNIT
    bounds = {"block mean": of_mean, "slope": of_mean * 4.0 * m / (m * m - 1.0) + own}
    steepness = {"block mean": b_t, "slope": b_r}
    for part, bound in bounds.items():
        results.add(
            "error_budget",
            {"numeric": numeric, "part": part, "bound_dph": bound * steepness[part], "found_c": found[part]},
        )
    bound = quantise(model, numeric).error_bound_dph
    results.add("error_budget", {"numeric": numeric, "part": "map, printed bound", "bound_dph": bound})
