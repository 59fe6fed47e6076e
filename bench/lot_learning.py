"""What a short run can show of a foreign unit in a lot, and what a lot costs to learn: parts of `python -m bench docs`.

Unrelated units: lots as in `bench.lot_prior` (60 units teach, family 0.93), each with 40 unseen units of its own and 40 gyros
whose physical parameters (`gyrotc.simulate.lot`) share nothing with the lot but the scenario. All are held against the
lot by one run of 2.5 h. Beside the test of `gyrotc.train.prior.learn` stand two that no product can have: one that
knows from what distribution unrelated units are drawn (the likelihood ratio of that against the lot's; the distribution is
taken from the whole calibrations of the foreign units of all other draws), and one that knows each such unit's map.

Cost of `gyrotc lot`, whole: the units are simulated from physics, each for itself: copies of a few with noise of their
own would be as many clusters, and what was measured were the search for these.
"""

from __future__ import annotations

import multiprocessing
import os
import secrets
import tempfile
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from gyrotc.train.prior.learn import FALSE_ALARM, UnitSums, sums_of
from gyrotc.train.prior.use import LotPrior
from gyrotc.model import load_model
from gyrotc.results.base import read_result
from gyrotc.results.fleet import Lot as LearnedLot
from gyrotc.results.training import MapMeans, Training
from gyrotc.simulate.campaign import SimulatedGyro, with_noise
from gyrotc.simulate.lot import LotOrder, draw_lot
from gyrotc.simulate.scenario import read
from gyrotc.results.files import json_text
from gyrotc.train.data import cleaned, scaling_of
from gyrotc.train.result import UnitMeans, unit_means
from numpy.typing import NDArray

from .growth import gyrotc
from .lot_peers import best_power, seen
from .lot_prior import CASES, learnt, ordered, programmes, recordings_of, write_page

Floats = NDArray[np.float64]

_DRAWS = 4
_TAUGHT = 60
_REPORTED = 8  # directions of which 2.5 h tell anything; in the next one signal is 1 % of noise
_SIMULATED = 200_000  # units of the lot, for the quantile of 1 %


@dataclass(frozen=True, slots=True)
class Draw:
    """A lot and the units that are held against it: by a short run, and with all their runs."""

    seed: int
    prior: LotPrior
    own: list[tuple[UnitMeans, UnitMeans]]
    strange: list[tuple[UnitMeans, UnitMeans]]


def drawn(seed: int) -> Draw:
    """One lot."""
    case = CASES[0]
    units = draw_lot(with_noise(read("paper")[1], "paper"), ordered(case), seed)
    own = [u for u in units if u.lot and not u.lot.unrelated]
    strange = [u for u in units if u.lot and u.lot.unrelated]
    taught = [unit_means(cleaned(d), scaling_of(d), None)[0] for d, _ in recordings_of(own[:_TAUGHT], exam=False)]
    found = Draw(seed, learnt(taught), _held(own[_TAUGHT:]), _held(strange))
    print(f"seed {seed}: drawn", flush=True)
    return found


def _held(units: list[SimulatedGyro]) -> list[tuple[UnitMeans, UnitMeans]]:
    return [(seen(programmes(data)[0][1]), seen(data)) for data, _ in recordings_of(units, exam=False)]


def ratio_test(prior: LotPrior, own: list[UnitMeans], strange: list[UnitMeans], known: list[UnitMeans]) -> Any:
    """Shares of own and of unrelated units refused by the likelihood ratio of the latter's distribution to the lot's.

    Args:
        prior: The lot; of clusters the first.
        own, strange: Short runs.
        known: Whole calibrations of other foreign units, which determine the distribution of theirs.
    """
    mean, covariance = prior.means[0], prior.covariances[0]
    short = [_sums(prior, units) for units in (own, strange)]
    factor = np.linalg.cholesky(covariance)
    ratio, vectors = np.linalg.eigh(factor.T @ short[1].precision.mean(axis=0) @ factor)
    ratio, vectors = ratio[-_REPORTED:], vectors[:, -_REPORTED:]
    scored = [_scores(sums, mean, vectors.T @ factor.T) / np.sqrt(ratio * (1.0 + ratio)) for sums in short]
    rng = np.random.default_rng(1)
    maps = np.linalg.solve(factor, (_maps(prior, known) - mean).T).T @ vectors
    noise = rng.standard_normal(maps.shape)
    others = maps * np.sqrt(ratio / (1.0 + ratio)) + noise / np.sqrt(1.0 + ratio)
    center, inverse = others.mean(axis=0), np.linalg.inv(np.cov(others.T))
    of_lot = _ratio(rng.standard_normal((_SIMULATED, _REPORTED)), center, inverse)
    limit = np.quantile(of_lot, 1.0 - FALSE_ALARM)
    return [float(np.mean(_ratio(scores, center, inverse) > limit)) for scores in scored]


def _sums(prior: LotPrior, units: list[UnitMeans]) -> UnitSums:
    return sums_of(units, prior.basis, prior.center_dph, prior.unit_dph)


def _scores(sums: UnitSums, mean: Floats, way: Floats) -> Floats:
    return np.asarray([way @ (b - g @ mean) for g, b in zip(sums.precision, sums.moment, strict=True)])


def _maps(prior: LotPrior, units: list[UnitMeans]) -> Floats:
    """Coefficients of fully calibrated units, under a spread so wide that the lot says nothing of them."""
    wide, mean = np.linalg.inv(100.0 * prior.covariances[0]), prior.means[0]
    sums = _sums(prior, units)
    moved = sums.moment - sums.precision @ mean
    return np.asarray(mean + np.linalg.solve(wide + sums.precision, moved[..., None])[..., 0])


def _ratio(scores: Floats, center: Floats, inverse: Floats) -> Floats:
    """Twice the log likelihood ratio, up to a constant."""
    away = scores - center
    return np.asarray(np.sum(scores**2, axis=1) - np.einsum("ui,ij,uj->u", away, inverse, away))


def figures(draw: Draw, others: list[Draw]) -> dict[str, Any]:
    """What each test refuses of one lot."""
    refused = [
        float(np.mean([draw.prior.with_runs(short).p_value < FALSE_ALARM for short, _ in units]))
        for units in (draw.own, draw.strange)
    ]
    known = [whole for other in others if other.seed != draw.seed for _, whole in other.strange]
    reported = ratio_test(draw.prior, [s for s, _ in draw.own], [s for s, _ in draw.strange], known)
    powers = [best_power(draw.prior, short, whole) for short, whole in draw.strange]
    return {
        "seed": draw.seed,
        "accused": refused[0],
        "refused": refused[1],
        "ratio_accused": reported[0],
        "ratio_refused": reported[1],
        "map_refused": float(np.mean(powers)),
    }


def write_unrelated(docs: Path) -> None:
    """Of lots that are drawn now."""
    seeds = [secrets.randbelow(9000) + 1000 for _ in range(_DRAWS)]
    with multiprocessing.get_context("spawn").Pool(2) as pool:
        draws = pool.map(drawn, seeds, chunksize=1)
    write_page(docs, {"unrelated": [figures(draw, draws) for draw in draws]})


_UNITS = (100, 300, 1000)
_SEED, _FAMILY = 4711, 0.73
_DIGITS = 6  # of a mean, as a fit leaves it


def _taught(folder: Path) -> None:
    """Units of a lot as `gyrotc fleet` leaves them: the files of one fit, with the means of each unit."""
    gyros = draw_lot(with_noise(read("paper")[1], "paper"), LotOrder(max(_UNITS), _FAMILY, 1, 0), _SEED)
    gyrotc(["simulate", "paper", "--out", str(folder / "one")])
    gyrotc(["fit", str(folder / "one"), "--out", str(folder / "fitted")])
    model, training = load_model(folder / "fitted/model.json"), read_result(folder / "fitted/training.json", Training)
    for k, (samples, _) in enumerate(recordings_of(gyros, exam=False)):
        data = cleaned(samples)
        found, mean_s = unit_means(data, scaling_of(data), None)
        lists = {
            name: tuple(float(f"{v:.{_DIGITS}g}") for v in getattr(found, name))
            for name in ("temperature_c", "slope_c_per_min", "bias_dph", "count")
        }
        means = MapMeans(**lists, sigma_dph=found.sigma_dph, mean_s=mean_s)
        unit = folder / "units" / f"LOT-{k:04d}"
        unit.mkdir(parents=True)
        model.model_copy(update={"serial": unit.name}).save(unit / "model.json")
        own = training.model_copy(update={"serial": unit.name, "means": means})
        (unit / "training.json").write_text(json_text(own.content()), "utf-8")


def write_speed(docs: Path) -> None:
    """`gyrotc lot` of 100 to 1,000 units."""
    found = []
    with tempfile.TemporaryDirectory(prefix="gyrotc-lot-") as work:
        folder = Path(work)
        _taught(folder)
        for n in _UNITS:
            some, file = folder / str(n), folder / f"{n}.json"
            some.mkdir()
            for unit in sorted((folder / "units").iterdir())[:n]:
                (some / unit.name).symlink_to(unit)
            load, cost = os.getloadavg()[0], gyrotc(["lot", str(some), "--out", str(file)])
            lot = read_result(file, LearnedLot)
            found.append(
                {
                    "units": n, "cpu_s": cost["seconds"], "memory_mib": cost["peak_mib"], "load": load,
                    "clusters": len(lot.clusters), "directions": len(lot.directions),
                }
            )  # fmt: skip
            print(found[-1], flush=True)
    write_page(docs, {"speed": found})
