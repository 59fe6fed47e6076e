"""The method of Ding et al. 2014 (Sensors 14) in plain numpy, from the paper alone: read it beside the paper.

Numbers in brackets are the paper's equations. It imports nothing of gyrotc, which test_paper_reference.py holds
against it. What the paper leaves open is decided in the constants below, as docs/paper.md says in section 1.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

ROWS = 10  # of 10 s in a mean of 100 s, and in the window of dT/dt: section 4.1
NODES = 135  # of the Kohonen network, and the most centers: the largest network of section 4.2
EPOCHS, RATE_FIRST, RATE_LAST, STILL = (
    30,
    0.5,
    0.005,
    1e-4,
)  # passes; eta of (6) falls geometrically; step (6)
WIDTHS = (0.15, 0.22, 0.33, 0.5, 0.75, 1.1, 1.6)  # delta of (2), half ranges of the inputs
DEPENDENT = 1e-7  # a candidate that keeps less of its squared norm beside the chosen ones is passed over
RIDGE = 1e-8  # on the weights, of all samples
EXCESS = 1.02  # rho by rule: so much above the noise


# ---- Section 4.1: averages, dT/dt ----


def inputs(temperature_c: Floats) -> tuple[Floats, Floats]:
    """T in C and dT/dt in C/min that are known in each row of 10 s but the first two, from the rows before it.

    dT/dt is the slope of a line through the last 100 s, 0 until there are as many; T is the last row's, led by it to
    the row that it is for. The first reading counts only once two others agree with it: the third row has its own.
    """
    n = len(temperature_c)
    t, slope = temperature_c[np.r_[2, 2 : n - 1]], np.zeros(n - 2)
    k = np.arange(ROWS) - (ROWS - 1) / 2
    for row in range(ROWS + 2, n):
        slope[row - 2] = k @ temperature_c[row - ROWS : row] / (k @ k)
    return t + slope, slope * 6.0


def means(values: Floats) -> Floats:
    """Averages over 100 s, counted from the first value; the last may be of fewer."""
    first = np.arange(0, len(values), ROWS)
    return np.asarray(np.add.reduceat(values, first) / rows_of(len(values)))


def rows_of(n: int) -> Floats:
    """How many rows are in each mean of n rows: its weight."""
    return np.diff(np.arange(0, n, ROWS), append=n).astype(np.float64)


@dataclass(frozen=True)
class Scale:
    """Inputs as multiples of half their range in training, T about its middle; outside they stay at the edge."""

    low: Floats
    high: Floats

    def __call__(self, t_c: Floats, c_per_min: Floats) -> Floats:
        (t0, r0), (t1, r1) = self.low, self.high
        middle, half = [(t0 + t1) / 2.0, 0.0], [max((t1 - t0) / 2.0, 1.0), max(-r0, r1, 0.05)]
        return np.asarray((np.clip(np.column_stack([t_c, c_per_min]), self.low, self.high) - middle) / half)


# ---- Section 2.1: the network ----


def phi(x: Floats, centers: Floats, delta: float) -> Floats:
    """(2) for every sample and center: exp(-u^2/delta^2), u their distance. Shape (samples, centers)."""
    u2 = np.sum((x[:, None, :] - centers[None, :, :]) ** 2, axis=2)
    return np.asarray(np.exp(-u2 / delta**2))


@dataclass(frozen=True)
class Network:
    """(1): f(x) = w0 + sum of w_i phi(|x - c_i|), with the order in which the centers were chosen and their [err]."""

    scale: Scale
    centers: Floats
    delta: float
    weights: Floats  # w0 first
    reductions: Floats  # [err], that of w0 first
    rho: float

    def __call__(self, t_c: Floats, c_per_min: Floats) -> Floats:
        hidden = phi(self.scale(t_c, c_per_min), self.centers, self.delta)
        return np.asarray(self.weights[0] + hidden @ self.weights[1:])


# ---- Section 2.2 and step 2 of section 3: the Kohonen network ----


class SplitMix64:
    """Random numbers (Steele et al. 2014), so that both programs draw the same."""

    def __init__(self, seed: int) -> None:
        self.state = seed

    def next(self) -> int:
        z = self.state = (self.state + 0x9E3779B97F4A7C15) % 2**64
        z = (z ^ (z >> 30)) * 0xBF58476D1CE4E5B9 % 2**64
        z = (z ^ (z >> 27)) * 0x94D049BB133111EB % 2**64
        return z ^ (z >> 31)

    def order(self, n: int) -> list[int]:
        order = list(range(n))
        for i in range(n, 1, -1):
            j = self.next() % i
            order[i - 1], order[j] = order[j], order[i - 1]
        return order


def winner(nodes: Floats, x: Floats) -> int:
    """(3) by the distances (5): the node that is nearest."""
    return int(np.argmin(np.sum((nodes - x) ** 2, axis=1)))


def kohonen(x: Floats, seed: int) -> Floats:
    """Nodes that have learnt the samples; they start on samples."""
    random = SplitMix64(seed)
    nodes = x[random.order(len(x))[:NODES]].copy()
    rate, decay = RATE_FIRST, (RATE_LAST / RATE_FIRST) ** (1.0 / (len(x) * EPOCHS - 1.0))
    for _ in range(EPOCHS):
        before = nodes.copy()
        for k in random.order(len(x)):
            j = winner(nodes, x[k])
            nodes[j] += rate * (x[k] - nodes[j])  # (4), (6)
            rate *= decay
        if np.abs(nodes - before).max() <= STILL:
            break
    return nodes


# ---- Step 3 of section 3: orthogonal least squares ----


def orthogonal_least_squares(
    p: Floats, y: Floats, rho: float, most: int, *, in_order: bool = False
) -> tuple[list[int], Floats]:
    """(7) to (16): columns of p in the order of choice, column 0 first, and the [err] of each.

    Args:
        p: Hidden layer outputs, shape (samples, 1 + candidates); column 0 is that of w0.
        y: What they shall give, y_d.
        rho: Threshold of (16).
        most: Most columns.
        in_order: Candidates as they come (the traditional network), not by the largest [err].
    """
    b = p.copy()  # (7); later what is left of each column beside the chosen ones, (12)
    norms = np.sum(p**2, axis=0)
    chosen: list[int] = []
    reductions: list[float] = []
    while len(chosen) < most:
        left = np.sum(b**2, axis=0)
        usable = left > DEPENDENT * norms
        usable[chosen] = False
        if not usable.any():
            break
        err = np.where(usable, (b.T @ y) ** 2 / np.where(usable, left, 1.0) / (y @ y), -1.0)  # (8), (13)
        best = int(np.argmax(usable if in_order or not chosen else err))  # (9), (14)
        chosen.append(best)
        reductions.append(float(err[best]))
        b_k = b[:, best].copy()  # (10), (15)
        for _ in range(2):  # twice, so that rounding leaves nothing of it
            a = b_k @ b / (b_k @ b_k)  # (11)
            b = b - np.outer(b_k, a)  # (12)
        if 1.0 - sum(reductions) < rho:  # (16)
            break
    return chosen, np.array(reductions)


# ---- Step 4: training ----


def noise(y: Floats) -> float:
    """Standard deviation of the noise by first differences, which a slow bias hardly changes; outliers left out."""
    d = np.diff(y)
    sigma = np.median(np.abs(d)) / 0.6744897501960817  # a normal distribution has half of itself within it
    return float(np.sqrt(np.mean(d[np.abs(d) <= 4.5 * sigma] ** 2) / 2.0))


def network(
    kind: str,
    t_c: Floats,
    c_per_min: Floats,
    bias_dph: Floats,
    seed: int,
    *,
    neurons: int | None = None,
    rho: float | None = None,
    ridge: float = RIDGE,
) -> Network:
    """The `random` or the `modified` network of rows of 10 s.

    Args:
        neurons: How many centers are asked for; None: as many as rho needs.
        rho: Threshold of (16); None: where the residual is 2 % above the noise.
    """
    scale = Scale(np.array([t_c.min(), c_per_min.min()]), np.array([t_c.max(), c_per_min.max()]))
    weight = rows_of(len(bias_dph))
    x, y = scale(means(t_c), means(c_per_min)), means(bias_dph)
    drawn = np.random.default_rng(seed).permutation(np.unique(x, axis=0))[:NODES]
    candidates = kohonen(x, seed) if kind == "modified" else drawn
    rho = (EXCESS * noise(y)) ** 2 / np.average(y**2, weights=weight) if rho is None else rho
    root = np.sqrt(weight)
    found = []
    for delta in WIDTHS:
        p = root[:, None] * np.column_stack([np.ones(len(y)), phi(x, candidates, delta)])
        most, stop = (NODES, rho) if neurons is None else (neurons, 0.0)
        chosen, reductions = orthogonal_least_squares(p, root * y, stop, 1 + most, in_order=kind == "random")
        left = 1.0 - reductions.sum()
        found.append((len(chosen) if left < stop else 1e6 + left, delta, chosen, reductions))
    _, delta, chosen, reductions = min(found, key=lambda trial: trial[0])
    centers = candidates[np.array(chosen[1:], dtype=int) - 1]
    hidden = root[:, None] * np.column_stack([np.ones(len(y)), phi(x, centers, delta)])
    held = np.sqrt(ridge * weight.sum()) * np.eye(len(chosen))[1:]
    weights = np.linalg.lstsq(np.vstack([hidden, held]), np.r_[root * y, np.zeros(len(held))], rcond=None)[0]
    return Network(scale, centers, delta, weights, reductions, float(rho))


# ---- Section 4.2: multiple linear regression ----


def regression(t_c: Floats, c_per_min: Floats, bias_dph: Floats) -> tuple[list[int], Floats]:
    """Which of T (1) and dT/dt (2) stay beside the constant (0), and their weights, in C and C/min.

    The one without which Schwarz's criterion is least is dropped, as long as the criterion falls.
    """
    y, weight = means(bias_dph), rows_of(len(bias_dph))
    root = np.sqrt(weight / weight.mean())
    columns = np.column_stack([np.ones(len(y)), means(t_c), means(c_per_min)]) * root[:, None]

    def fitted(kept: list[int]) -> tuple[float, Floats]:
        weights = np.linalg.lstsq(columns[:, kept], root * y, rcond=None)[0]
        rest = root * y - columns[:, kept] @ weights
        return len(y) * np.log(rest @ rest / len(y)) + len(kept) * np.log(len(y)), weights

    kept, (least, weights) = [0, 1, 2], fitted([0, 1, 2])
    while len(kept) > 1:
        fewer = min(([k for k in kept if k != out] for out in kept[1:]), key=lambda k: fitted(k)[0])
        if fitted(fewer)[0] >= least:
            break
        kept, (least, weights) = fewer, fitted(fewer)
    return kept, weights
