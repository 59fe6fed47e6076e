"""Measure what a lot is worth for units that it has not seen, beside simple ways.

Lots are simulated from physics (`gyrotc.simulate.lot`); 60 fully calibrated units teach, 40 others are calibrated from
a single run of 2.5 h (0 C → 60 C, two hours there, → −40 C at 5 C/min), the first of them from longer programmes, too.
Judged on the full exam of six environments: RMS over the floor of the noise that was really added, and the map's own
error, RMS of (map − truth), over the same. Nothing is tuned on these lots: a fresh seed is drawn unless one is given.
"""

from __future__ import annotations

import multiprocessing
import tempfile
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from gyrotc.recordings import load
from gyrotc.results import Lot
from gyrotc.simulate import LotOrder, RowForm, SimulatedGyro, draw_lot, read, read_truth, with_noise, write_gyro
from gyrotc.train import (
    Fit,
    TrainingData,
    cleaned_samples,
    fit,
    front_end,
    joined,
    predict,
    samples_of,
    scaling_of,
    uncertainty_of,
)
from gyrotc.train.prior import LotPrior, UnitMeans, learn_prior, means_of_unit
from numpy.typing import NDArray

from ..campaigns import say
from .peers import best_power, peers, seen

Floats = NDArray[np.float64]

_UNITS, _UNSEEN, _WITH_MORE = 60, 40, 8
_SHORT_S, _STEP_S, _AVERAGE_S = 9000.0, 10.0, 100.0
_LAST_RUN = 5  # of training: 5 C/min


@dataclass(frozen=True, slots=True)
class Case:
    """A kind of lot."""

    name: str
    family: float
    clusters: int = 1
    unrelated: int = 0


CASES = (
    Case("units differ by 25 %", 0.93, unrelated=_UNSEEN),
    Case("units differ by 50 %", 0.73),
    Case("nothing shared", 0.0),
    Case("two clusters", 0.93, clusters=2),
)
"""The family strengths are those of docs/simulation.md, section 5."""


@dataclass(frozen=True, slots=True)
class Exam:
    """Six runs of a unit: inputs, measured bias, truth, number of the 100-s mean."""

    temperature_c: Floats
    slope_c_per_min: Floats
    bias_dph: Floats
    truth_dph: Floats
    mean: NDArray[np.int64]

    def means(self, values: Floats) -> Floats:
        return np.asarray(np.bincount(self.mean, values) / np.bincount(self.mean))

    def judged(self, predicted: Floats) -> tuple[float, float]:
        """RMS of what is left over the floor, and the map's own error over it."""
        floor = _rms(self.means(self.bias_dph - self.truth_dph))
        return (
            _rms(self.means(self.bias_dph - predicted)) / floor,
            _rms(self.means(self.truth_dph - predicted)) / floor,
        )


def _rms(values: Floats) -> float:
    return float(np.sqrt(np.mean(values**2)))


def measured(case: Case, seed: int, unseen: int) -> dict[str, Any]:
    """Return the figures of one case and of so many unseen units."""
    started = time.process_time()
    units = draw_lot(with_noise(read("paper")[1], "paper"), ordered(case), seed)
    own = [u for u in units if u.lot and not u.lot.unrelated]
    strange = [u for u in units if u.lot and u.lot.unrelated]
    taught = [
        means_of_unit(cleaned_samples(data), scaling_of(data), None)[0]
        for data, _ in recordings_of(own[:_UNITS], exam=False)
    ]
    before = time.process_time()
    prior = learnt(taught)
    learnt_s = time.process_time() - before
    rows = []
    for k, (data, exam) in enumerate(recordings_of(own[_UNITS : _UNITS + unseen], exam=True)):
        assert exam is not None
        rows.append(_unit(data, exam, prior, taught, longer=k < _WITH_MORE))
        say(f"{case.name}: unit {k + 1} of {unseen}, {time.process_time() - started:.0f} s")
    refused: dict[str, list[bool]] = {"2.5 h": [], "8 h": [], "six runs": []}
    powers = []
    for data, _ in recordings_of(strange[:unseen], exam=False):
        powers.append(best_power(prior, seen(programmes(data)[0][1]), seen(data)))
        for name, part in programmes(data):
            use = fit(part, method="auto", prior=prior).lot if name != "six runs" else None
            p = (
                use.p_value
                if use
                else prior.with_runs(means_of_unit(cleaned_samples(part), scaling_of(part), None)[0]).p_value
            )
            refused[name].append(p < 0.01)
    lot = prior.lot
    return {
        "case": case.name,
        "family": case.family,
        "text": lot.text,
        "learnt_s": learnt_s,
        "units": rows,
        "unrelated_refused": {name: float(np.mean(r)) for name, r in refused.items() if r},
        "best_power": float(np.mean(powers)) if powers else None,
        "cpu_s": time.process_time() - started,
    }


def ordered(case: Case) -> LotOrder:
    """The lot of a case."""
    return LotOrder(_UNITS + _UNSEEN + case.unrelated, case.family, case.clusters, case.unrelated)


def learnt(units: list[UnitMeans]) -> LotPrior:
    """A lot as `gyrotc lot` makes it, without the way over files."""
    from gyrotc.jobs import lot_from
    from gyrotc.train.prior import prior_of

    t = [float(f(u.temperature_c)) for u in units for f in (np.min, np.max)]
    r = [float(f(u.slope_c_per_min)) for u in units for f in (np.min, np.max)]
    envelope = (min(t), max(t)), (min(r), max(r))
    found = learn_prior(units, envelope, lambda *_: None)
    lot: Lot = lot_from([(f"U{k:03d}", "") for k in range(len(units))], units, found, envelope)
    return prior_of(lot)


def recordings_of(units: list[SimulatedGyro], *, exam: bool) -> Iterator[tuple[TrainingData, Exam | None]]:
    """Training samples and the exam of each unit, through data sets and the front end."""
    for drawn in units:
        kept = [s for s in drawn.plan.set if exam or s.role == "train"]
        unit = replace(drawn, plan=drawn.plan.model_copy(update={"set": kept}))
        with tempfile.TemporaryDirectory(prefix="gyrotc-lot-") as work:
            write_gyro(Path(work), unit, RowForm.of(10.0, None, False, "parquet"), lambda *_: None)
            dataset, truth = load(Path(work)), read_truth(Path(work))
            assert truth is not None
            front = front_end(dataset.runs, _STEP_S)
            parts = [samples_of(front.blocks(run), _STEP_S, k) for k, run in enumerate(dataset.runs)]
            trained = [p for p, run in zip(parts, dataset.runs, strict=True) if run.role == "train"]
            graded = [(p, run.file) for p, run in zip(parts, dataset.runs, strict=True) if run.role == "exam"]
            noise = [
                truth.noise_dph(file)[1][np.floor(p.time_s / truth.noise_dph(file)[0] + 1e-6).astype(int)]
                for p, file in graded
            ]
        yield (
            joined(trained),
            _exam(joined([p for p, _ in graded]), np.concatenate(noise)) if graded else None,
        )


def _exam(data: TrainingData, noise: Floats) -> Exam:
    number = data.run * 1_000_000 + np.floor(data.time_s / _AVERAGE_S + 1e-9).astype(np.int64)
    _, index = np.unique(number, return_inverse=True)
    return Exam(data.temperature_c, data.slope_c_per_min, data.bias_dph, data.bias_dph - noise, index)


def programmes(data: TrainingData) -> list[tuple[str, TrainingData]]:
    """Return what is recorded of a new unit, by the name of the programme."""
    last = data.run == _LAST_RUN
    first = float(data.time_s[last].min())
    return [
        ("2.5 h", data.select(last & (data.time_s < first + _SHORT_S))),
        ("8 h", data.select(last)),
        ("six runs", data),
    ]


def _unit(data: TrainingData, exam: Exam, prior: LotPrior, taught: list[UnitMeans], *, longer: bool) -> dict[str, Any]:
    """Figures of one unseen unit: ratio and error of every way, coverage of sigma, p-value."""
    row: dict[str, Any] = {}
    for name, part in programmes(data)[: 3 if longer else 1]:
        with_lot = fit(part, method="auto", prior=prior)
        ways: dict[str, Callable[[], Floats]] = {
            "lot": lambda f=with_lot: predict(f, exam.temperature_c, exam.slope_c_per_min),
            "mrbf": lambda p=part: predict(fit(p, method="mrbf"), exam.temperature_c, exam.slope_c_per_min),
        }
        if name == "2.5 h":
            ways["auto"] = lambda p=part: predict(fit(p, method="auto"), exam.temperature_c, exam.slope_c_per_min)
            ways |= peers(taught, means_of_unit(cleaned_samples(part), scaling_of(part), None)[0], exam)
        assert with_lot.lot is not None
        row[name] = {way: exam.judged(run()) for way, run in ways.items()}
        row[name] |= {"p_value": with_lot.lot.p_value, "accepted": with_lot.lot.accepted}
        row[name]["coverage"] = _covered(part, with_lot, exam)
    return row


def _covered(data: TrainingData, found: Fit, exam: Exam) -> tuple[float, float]:
    """Share of the exam at which the truth lies within 1 and 1.96 sigma of the table's cell."""
    known = uncertainty_of(data, found)
    s = found.scaling
    spans = ((exam.temperature_c, s.temperature_c), (exam.slope_c_per_min, s.slope_c_per_min))
    i, j = (
        np.clip(((x - low) / (high - low) * n).astype(int), 0, n - 1)
        for (x, (low, high)), n in zip(spans, known["cells"], strict=True)
    )
    sigma = np.array(known["rows"])[j, i]
    away = np.abs(exam.truth_dph - predict(found, exam.temperature_c, exam.slope_c_per_min)) / sigma
    return float(np.mean(away <= 1.0)), float(np.mean(away <= 1.96))


def _one(job: tuple[Case, int, int]) -> dict[str, Any]:
    return measured(*job)


_WAYS = ("lot", "auto", "mrbf", "mean curve + offset", "PCA regression", "pooled GPR")


def quoted(case: dict[str, Any]) -> dict[str, Any]:
    """Return the figures of a lot from those of its units."""
    units = case["units"]
    short = [u["2.5 h"] for u in units]
    longer = [name for name in ("8 h", "six runs") if any(name in u for u in units)]
    reported = {name: case[name] for name in ("case", "family", "text", "learnt_s", "unrelated_refused")}
    return reported | {
        "best_power": case.get("best_power"),
        "ways": {way: found for way in _WAYS if (found := _spread([row[way] for row in short if way in row]))},
        "better": float(np.mean([row["lot"][0] <= row["auto"][0] for row in short])),
        "coverage": np.mean([row["coverage"] for row in short], axis=0).tolist(),
        "refused": float(np.mean([not row["accepted"] for row in short])),
        "longer": {name: _medians([u[name] for u in units if name in u]) for name in longer},
    }


def _spread(found: Sequence[Sequence[float]]) -> list[float]:
    """Median and worst of RMS ÷ floor and of the error."""
    return [float(f(column)) for column in zip(*found, strict=True) for f in (np.median, np.max)]


def _medians(rows: Sequence[dict[str, Any]]) -> dict[str, Any]:
    return {"units": len(rows)} | {
        way: np.median([row[way] for row in rows], axis=0).tolist() for way in ("lot", "mrbf")
    }


def new_units(seed: int, workers: int, *, quick: bool = False) -> list[dict[str, Any]]:
    """Return the figures of every kind of lot.

    Args:
        seed: Of the draw.
        workers: Processes.
        quick: The first kind alone, two units of it.
    """
    jobs = [(case, seed, 2 if quick else _UNSEEN) for case in (CASES[:1] if quick else CASES)]
    with multiprocessing.get_context("spawn").Pool(workers) as pool:
        return [quoted(case) for case in pool.map(_one, jobs, chunksize=1)]
