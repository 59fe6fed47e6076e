"""`python -m bench.lot_prior docs [SEED]`: what a lot is worth for units that it has not seen, beside simple ways.

Lots are simulated from physics (`gyrotc.simulate.lot`); 60 fully calibrated units teach, 40 others are calibrated from
a single run of 2.5 h (0 C → 60 C, two hours there, → −40 C at 5 C/min), the first of them from longer programmes, too.
Judged on the full exam of six environments: RMS over the floor of the noise that was really added, and the map's own
error, RMS of (map − truth), over the same. Nothing is tuned on these lots: without a SEED a new one is drawn, and
every draw stays on the page.
"""

from __future__ import annotations

import multiprocessing
import secrets
import sys
import tempfile
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from gyrotc.train.prior.learn import learn
from gyrotc.train.prior.use import LotPrior
from gyrotc.recordings.load import load
from gyrotc.results.fleet import Lot
from gyrotc.simulate.campaign import RowForm, SimulatedGyro, with_noise, write_gyro
from gyrotc.simulate.lot import LotOrder, draw_lot
from gyrotc.simulate.scenario import read
from gyrotc.simulate.scenario import read_truth
from gyrotc.train.data import TrainingData, cleaned, joined, scaling_of
from gyrotc.train.fitting import front_end, samples_of
from gyrotc.train.result import UnitMeans, unit_means
from gyrotc.train.methods import fit
from gyrotc.train.result import Fit, predict
from gyrotc.train.uncertainty import uncertainty
from numpy.typing import NDArray
from results import recorded, write

from .lot_peers import best_power, peers, seen

ROOT = Path(__file__).resolve().parents[1]
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
"""The family strengths are those of docs/simulation.md, section 6."""


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


def measured(case: Case, seed: int) -> dict[str, Any]:
    """All figures of one case."""
    started = time.process_time()
    units = draw_lot(with_noise(read("paper")[1], "paper"), ordered(case), seed)
    own = [u for u in units if u.lot and not u.lot.unrelated]
    strange = [u for u in units if u.lot and u.lot.unrelated]
    taught = [
        unit_means(cleaned(data), scaling_of(data), None)[0]
        for data, _ in recordings_of(own[:_UNITS], exam=False)
    ]
    before = time.process_time()
    prior = learnt(taught)
    learnt_s = time.process_time() - before
    rows = []
    for k, (data, exam) in enumerate(recordings_of(own[_UNITS:], exam=True)):
        assert exam is not None
        rows.append(_unit(data, exam, prior, taught, longer=k < _WITH_MORE))
        print(f"{case.name}: unit {k + 1} of {_UNSEEN}, {time.process_time() - started:.0f} s", flush=True)
    refused: dict[str, list[bool]] = {"2.5 h": [], "8 h": [], "six runs": []}
    powers = []
    for data, _ in recordings_of(strange, exam=False):
        powers.append(best_power(prior, seen(programmes(data)[0][1]), seen(data)))
        for name, part in programmes(data):
            use = fit(part, method="auto", prior=prior).lot if name != "six runs" else None
            p = (
                use.p_value
                if use
                else prior.with_runs(unit_means(cleaned(part), scaling_of(part), None)[0]).p_value
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
    from gyrotc.jobs.lot import lot_from
    from gyrotc.train.prior.use import prior_of

    t = [float(f(u.temperature_c)) for u in units for f in (np.min, np.max)]
    r = [float(f(u.slope_c_per_min)) for u in units for f in (np.min, np.max)]
    envelope = (min(t), max(t)), (min(r), max(r))
    found = learn(units, envelope, lambda _: None)
    lot: Lot = lot_from([(f"U{k:03d}", "") for k in range(len(units))], units, found, envelope)
    return prior_of(lot)


def recordings_of(units: list[SimulatedGyro], *, exam: bool) -> Iterator[tuple[TrainingData, Exam | None]]:
    """Training samples and the exam of each unit, through data sets and the front end."""
    for drawn in units:
        kept = [s for s in drawn.plan.set if exam or s.role == "train"]
        unit = replace(drawn, plan=drawn.plan.model_copy(update={"set": kept}))
        with tempfile.TemporaryDirectory(prefix="gyrotc-lot-") as work:
            write_gyro(Path(work), unit, RowForm.of(10.0, None, False, "parquet"), lambda _: None)
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
    """What is recorded of a new unit."""
    last = data.run == _LAST_RUN
    first = float(data.time_s[last].min())
    return [
        ("2.5 h", data.select(last & (data.time_s < first + _SHORT_S))),
        ("8 h", data.select(last)),
        ("six runs", data),
    ]


def _unit(
    data: TrainingData, exam: Exam, prior: LotPrior, taught: list[UnitMeans], *, longer: bool
) -> dict[str, Any]:
    """Figures of one unseen unit: ratio and error of every way, coverage of sigma, p-value."""
    row: dict[str, Any] = {}
    for name, part in programmes(data)[: 3 if longer else 1]:
        with_lot = fit(part, method="auto", prior=prior)
        ways: dict[str, Callable[[], Floats]] = {
            "lot": lambda f=with_lot: predict(f, exam.temperature_c, exam.slope_c_per_min),
            "mrbf": lambda p=part: predict(fit(p, method="mrbf"), exam.temperature_c, exam.slope_c_per_min),
        }
        if name == "2.5 h":
            ways["auto"] = lambda p=part: predict(
                fit(p, method="auto"), exam.temperature_c, exam.slope_c_per_min
            )
            ways |= peers(taught, unit_means(cleaned(part), scaling_of(part), None)[0], exam)
        assert with_lot.lot is not None
        row[name] = {way: exam.judged(run()) for way, run in ways.items()}
        row[name] |= {"p_value": with_lot.lot.p_value, "accepted": with_lot.lot.accepted}
        row[name]["coverage"] = _covered(part, with_lot, exam)
    return row


def _covered(data: TrainingData, found: Fit, exam: Exam) -> tuple[float, float]:
    """Share of the exam at which the truth lies within 1 and 1.96 sigma of the table's cell."""
    known = uncertainty(data, found)
    s = found.scaling
    spans = ((exam.temperature_c, s.temperature_c), (exam.slope_c_per_min, s.slope_c_per_min))
    i, j = (
        np.clip(((x - low) / (high - low) * n).astype(int), 0, n - 1)
        for (x, (low, high)), n in zip(spans, known["cells"], strict=True)
    )
    sigma = np.array(known["rows"])[j, i]
    away = np.abs(exam.truth_dph - predict(found, exam.temperature_c, exam.slope_c_per_min)) / sigma
    return float(np.mean(away <= 1.0)), float(np.mean(away <= 1.96))


def _one(job: tuple[Case, int]) -> dict[str, Any]:
    return measured(*job)


_WAYS = {
    "lot": "**with the lot**",
    "auto": "without: model selection (`build`)",
    "mrbf": "without: a map (`--method mrbf`)",
    "mean curve + offset": "mean curve + offset",
    "PCA regression": "PCA regression",
    "pooled GPR": "pooled GPR (scikit-learn)",
}
_HEAD = " ".join(
    (
        "## A new unit from one run and its lot (`make lot-prior`)\n\n60 fully calibrated units teach ([lot.md](lot.md)),",
        "40 others are calibrated from one run of 2.5 h (5 C/min, 0 → 60 → −40 C) and judged on the full exam of six",
        "environments. Lots are simulated from physics ([simulation.md](simulation.md), section 6); nothing was tuned on",
        "these seeds, and every draw is kept. RMS is over the floor of the noise that was really added; the error is the",
        "map's own, RMS of (map − truth), over the same. Median / worst of the units.\n",
    )
)
_UNRELATED = " ".join(
    (
        "60 units teach a lot (family 0.93); 40 others of it and 40 unrelated, gyros whose physical parameters share nothing",
        "with the lot but the scenario, are held against it by one run of 2.5 h, 1 % false alarms. Beside the test that is",
        "built stand two that cannot be: the likelihood ratio of the distribution that unrelated units are drawn from (known from",
        "the whole calibrations of those of all other draws) to the lot's, and the most powerful test of a map that is known",
        "beforehand. What these miss, the run does not show: the unrelated unit's map lies within the lot's spread where the",
        "run has been.",
    )
)


def quoted(case: dict[str, Any]) -> dict[str, Any]:
    """What the page says of a lot, from what was found for each of its units."""
    units = case["units"]
    short = [u["2.5 h"] for u in units]
    longer = [name for name in ("8 h", "six runs") if any(name in u for u in units)]
    reported = {name: case[name] for name in ("case", "family", "text", "learnt_s", "unrelated_refused")}
    return reported | {
        "best_power": case.get("best_power"),
        "ways": {
            way: found for way in _WAYS if (found := _spread([row[way] for row in short if way in row]))
        },
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


def _case(case: dict[str, Any]) -> str:
    rows = [
        f"| {_WAYS[way]} | {rms:.3f} / {worst:.3f} | {error:.2f} / {most:.2f} |"
        for way, (rms, worst, error, most) in case["ways"].items()
    ]
    longer = [
        f"{name}: {row['lot'][0]:.3f} ({row['lot'][1]:.2f}) with the lot, {row['mrbf'][0]:.3f} "
        f"({row['mrbf'][1]:.2f}) without"
        for name, row in case["longer"].items()
    ]
    units = next(iter(case["longer"].values()))["units"]
    lines = [
        f"#### {case['case'][0].upper()}{case['case'][1:]} (family {case['family']:g})",
        "",
        f"`gyrotc lot`: {case['text']}. {case['learnt_s']:.1f} s of processor time.",
        "",
        "| way | RMS ÷ floor | error |",
        "| --- | --- | --- |",
        *rows,
        "",
        f"Better with the lot than with model selection alone: {case['better']:.0%} of units. The truth lies within 1 / 1.96 "
        f"sigma of the table at {case['coverage'][0]:.1%} / {case['coverage'][1]:.1%} of the exam. Own units refused: "
        f"{case['refused']:.1%}.",
        f"Longer programmes, {units} units, medians of RMS ÷ floor (error): {'; '.join(longer)}.",
    ]
    if refused := case["unrelated_refused"]:
        reported = ", ".join(f"{share:.1%} from {name}" for name, share in refused.items())
        most = case["best_power"]
        beside = f" A test that knew each unrelated unit's map would refuse {most:.1%} from 2.5 h." if most else ""
        lines.append(f"Unrelated units (another lot's) refused: {reported}.{beside}")
    return "\n".join(lines)


def _coverage(draws: dict[str, list[dict[str, Any]]]) -> str:
    """Over all draws; units of a lot share how well it is known, so lots count, not units."""
    lots = [case["coverage"] for cases in draws.values() for case in cases]
    mean, error = np.mean(lots, axis=0), np.std(lots, axis=0, ddof=1) / np.sqrt(len(lots))
    return (
        f"Over all {len(lots)} lots of all draws the truth lies within 1 / 1.96 sigma of the table at {mean[0]:.1%} ± "
        f"{error[0]:.1%} / {mean[1]:.1%} ± {error[1]:.1%} of the exam (± one standard error; 68 and 95 were to be reached). "
        "One lot scatters by more than three points, for 60 units tell its spread to 9 %, and after a run of 2.5 h an "
        "unseen unit's error has two or three degrees of freedom left.\n"
    )


def _speed(rows: Sequence[dict[str, Any]]) -> str:
    lines = ["### `gyrotc lot` of 100 to 1,000 units (`python -m bench docs --only lot-speed`)", ""]
    lines += [
        "| units | processor time, s | memory, MiB | clusters, directions | load of the machine |",
        "| --- | --- | --- | --- | --- |",
    ]
    for row in rows:
        found = f"{row['clusters']}, {row['directions']}"
        lines.append(f"| {row['units']} | {row['cpu_s']:.1f} | {row['memory_mib']:.0f} | {found} | {row['load']:.1f} |")
    return "\n".join(lines) + "\n"


def _unrelated(rows: Sequence[dict[str, Any]]) -> str:
    """Of each draw, and over all: a unit is a trial, draws differ in how many of them agree with the lot."""
    names = ("refused", "ratio_refused", "map_refused", "accused", "ratio_accused")
    lines = [
        "### What a run of 2.5 h can show of an unrelated unit (`python -m bench docs --only lot-unrelated`)",
        "",
        _UNRELATED,
        "",
    ]
    lines += [
        "| seed | refused | if their distribution were known | if each one's map were known | own units accused | by the second test |",
        "| --- | --- | --- | --- | --- | --- |",
    ]
    lines += [f"| {row['seed']} | " + " | ".join(f"{row[n]:.1%}" for n in names) + " |" for row in rows]
    values = np.array([[row[n] for n in names] for row in rows])
    error = values.std(axis=0, ddof=1) / np.sqrt(len(rows))
    reported = [f"{mean:.1%} ± {off:.1%}" for mean, off in zip(values.mean(axis=0), error, strict=True)]
    return "\n".join([*lines, "| mean ± one standard error | " + " | ".join(reported) + " |"]) + "\n\n"


def section(record: dict[str, Any]) -> str:
    """The section: every draw, what a run shows of a foreign unit, and what learning costs."""
    draws = record["draws"]
    parts = [_HEAD, _coverage(draws)]
    for seed, cases in draws.items():
        parts.append(f"### Seed {seed}\n\n" + "\n\n".join(_case(case) for case in cases) + "\n")
    unrelated, speed = record.get("unrelated"), record.get("speed")
    return "\n".join(parts) + (_unrelated(unrelated) if unrelated else "") + (_speed(speed) if speed else "")


def write_page(docs: Path, part: dict[str, Any]) -> None:
    """Adds a draw, or replaces what is known of foreign units or of speed, and makes the section anew."""
    record = recorded(docs, "lot-prior") or {"draws": {}}
    draws = dict(sorted({**record["draws"], **part.pop("draws", {})}.items()))
    write(docs, "lot-prior", record | part | {"draws": draws}, section)


def main(arguments: list[str]) -> int:
    docs = ROOT / arguments[0]
    seed = int(arguments[1]) if len(arguments) > 1 else secrets.randbelow(9000) + 1000
    print(f"seed {seed}", flush=True)
    with multiprocessing.get_context("spawn").Pool(2) as pool:
        cases = pool.map(_one, [(case, seed) for case in CASES], chunksize=1)
    write_page(docs, {"draws": {str(seed): [quoted(case) for case in cases]}})
    return 0


if __name__ == "__main__":
    raise SystemExit(main(sys.argv[1:]))
