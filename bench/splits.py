"""Judge what is emitted for measured gyros on parts of their history that training has not seen.

Every axis of every set in a folder, with each of its parts left out in turn: a run of several; of a single chamber
cycle its branches, its hot and its cold end; of a single ramp its ends and its middle. The ratio is the RMS over means
of 100 s on the part left out, over that of the best of a constant, a cubic, and a cubic with a slope in dT/dt: the best
in hindsight, which no choice can know. Each split is diagnosed, too: what `gyrotc build --extend` would emit is judged
beside what it would emit without states, and an internal fault is kept as the split's verdict.
"""

from __future__ import annotations

import tempfile
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import islice, pairwise
from pathlib import Path
from typing import Any

import numpy as np
from gyrotc.common import GyrotcError
from gyrotc.diagnose import diagnose
from gyrotc.recordings import Dataset, axes_of, load
from gyrotc.train import (
    FitOptions,
    TrainingData,
    average_samples,
    design,
    fit_dataset,
    front_end,
    joined,
    samples_of,
    scaling_of,
    solve_least_squares,
    turning_points,
)
from numpy.typing import NDArray

from .campaigns import Settings, say
from .page import Figure, ResultsTable, figures_table
from .records import Record

TRIVIAL = ("constant", "cubic", "cubic_slope")
AVERAGE_S = 100.0
_GOOD, _FAIR = (
    1.03,
    1.10,
)  # times the best trivial correction: what no worse means, and what little worse means
_HARM = 1.05  # times what would be emitted without states: more is harm
_END = 0.25  # of a ramp, left out at either end; of the range of a cycle's temperature
_MIDDLE = (0.4, 0.65)  # shares of the time of a ramp
_HALVES = (0.33, 0.67)  # shares of the time of a recording at one temperature
_STILL_C = 2.0  # spans less: nothing is said about temperature
Span = tuple[Path, float, float, bool]  # file, from, to, whether it is the exam


@dataclass(frozen=True)
class Split:
    """A set with a part left out.

    Attributes:
        name: Of the set.
        left_out: The part, in words.
        folder: Its recordings with a `dataset.toml` in which that part is the exam.
    """

    name: str
    left_out: str
    folder: Path


@dataclass(frozen=True)
class Judged:
    """Result for an axis of a split: what was emitted, and what it leaves.

    Attributes:
        split: Which.
        axis: Of its sensor.
        method: What was emitted.
        rms_dph: What it leaves on the part left out, deg/h.
        trivial_dph: What the trivial corrections leave there, deg/h.
        verdict: Of the diagnosis; the name of an exception where it ended in one.
        emitted_dph: What the emitted tables leave there without and with states, deg/h; None where none are shipped.
    """

    split: Split
    axis: str
    method: str
    rms_dph: float
    trivial_dph: dict[str, float]
    verdict: str
    emitted_dph: tuple[float, float] | None

    @property
    def ratio(self) -> float:
        return self.rms_dph / min(self.trivial_dph.values())

    @property
    def of_constant(self) -> float:
        return self.rms_dph / self.trivial_dph["constant"]


def splits(sets: Path, work: Path) -> Iterator[Split]:
    """Every set of a folder with each part left out.

    Args:
        sets: A folder with a folder of recordings for each set.
        work: Where the split sets are written.
    """
    for source in sorted(path for path in sets.iterdir() if path.is_dir()):
        files = sorted(source.glob("*.csv"))
        if len(files) == 1:
            parts = _spans(files[0])
        else:
            parts = {held.stem: [(file, -np.inf, np.inf, file == held) for file in files] for held in files}
        for left_out, runs in parts.items():
            folder = work / f"{source.name}-{left_out.replace(' ', '-')}"
            yield Split(source.name, left_out, _described(folder, source.name, runs))


def _spans(file: Path) -> dict[str, list[Span]]:
    """The only recording of a set cut into spans, once for each part that is left out."""
    rows = np.genfromtxt(file, delimiter=",", names=True)
    time, t = rows["time_s"], rows["temperature_c"]
    step = float(np.median(np.diff(time)))
    start, end = float(time[0]), float(time[-1]) + step
    turns = turning_points(time, t)

    def cut(*edges: float, held: int) -> list[Span]:
        return [(file, a, b, k == held) for k, (a, b) in enumerate(pairwise(edges)) if b > a]

    def share(x: float) -> float:
        return start + x * (end - start)

    if np.ptp(t) < _STILL_C:
        return {
            "the end": cut(start, share(_HALVES[1]), end, held=1),
            "the start": cut(start, share(_HALVES[0]), end, held=0),
        }
    if not turns:
        return {
            "the first quarter": cut(start, share(_END), end, held=0),
            "the last quarter": cut(start, share(1.0 - _END), end, held=1),
            "the middle": cut(start, share(_MIDDLE[0]), share(_MIDDLE[1]), end, held=1),
        }
    edges = [start, *turns, end]
    found = {f"branch {k + 1}": cut(*edges, held=k) for k in range(len(edges) - 1)}
    low, high = np.quantile(t, [0.0, 1.0])
    inside = (time > turns[0] - 0.5 * (turns[0] - start)) & (time < turns[-1] + 0.5 * (end - turns[-1]))
    for name, there in (
        ("the hot end", t > high - _END * (high - low)),
        ("the cold end", t < low + _END * (high - low)),
    ):
        own = time[there & inside]
        if len(own):
            found[name] = cut(start, float(own[0]), float(own[-1]), end, held=1)
    return found


def _described(folder: Path, serial: str, runs: Sequence[Span]) -> Path:
    """A data set of copies of files, and what of them is the exam."""
    folder.mkdir(parents=True, exist_ok=True)
    text = [f'schema = 1\nserial = "{serial}"\n']
    for file, low, high, held in runs:
        (folder / file.name).write_bytes(file.read_bytes())
        lines = [f'[[run]]\nfile = "{file.name}"\npower_on_s = "unknown"']
        lines += [f"{name} = {float(x)!r}" for name, x in (("from_s", low), ("to_s", high)) if np.isfinite(x)]
        text.append("\n".join([*lines, f'role = "{"exam" if held else "train"}"\n']))
    (folder / "dataset.toml").write_text("\n".join(text), "utf-8")
    return folder


def judged(split: Split) -> Iterator[Judged]:
    """Every axis of a split, as `gyrotc fit` fits it."""
    for axis in axes_of(split.folder):
        dataset = load(split.folder, axis=axis)
        train, exam = samples(dataset)
        fitted = fit_dataset(dataset, FitOptions(average_s=AVERAGE_S))
        trivial = {}
        for name in TRIVIAL:
            trivial[name] = _rms(exam, of_trivial(train, name, exam))
        model = fitted.model
        left = _rms(exam, model.map_dph(exam.temperature_c, exam.slope_c_per_min))
        yield Judged(split, axis, model.method, left, trivial, *extended(dataset))


def extended(dataset: Dataset) -> tuple[str, tuple[float, float] | None]:
    """The verdict, and what the emitted tables leave on the exam without and with states where any are shipped."""
    try:
        found = diagnose(dataset, options=FitOptions(average_s=AVERAGE_S)).result
    except GyrotcError as refused:
        return f"refused: {refused}", None
    except Exception as fault:  # each is an exit 70 of the command
        return f"fault: {type(fault).__name__}", None
    if found.extended is None:
        return found.verdict, None
    gain = found.extended.gain
    return found.verdict, (gain.exam_rms_before_dph, gain.exam_rms_after_dph)


def of_trivial(train: TrainingData, name: str, exam: TrainingData) -> NDArray[np.float64]:
    """A trivial correction fitted to training samples, at those of the exam, held at the ends of what it saw, deg/h."""
    scaling = scaling_of(train)
    z = scaling.normalise(train.temperature_c, train.slope_c_per_min)
    weights = solve_least_squares(design(name, *z), train.bias_dph, train.weight)
    t = np.clip(exam.temperature_c, *scaling.temperature_c)
    r = np.clip(exam.slope_c_per_min, *scaling.slope_c_per_min)
    return np.asarray(design(name, *scaling.normalise(t, r)) @ weights)


def samples(dataset: Dataset) -> tuple[TrainingData, TrainingData]:
    """Training samples and those of the exam, as the front end makes them."""
    runs = [run for run in dataset.runs if run.role == "train"]
    front = front_end(runs, FitOptions().block_s)
    parts: dict[str, list[TrainingData]] = {"train": [], "exam": []}
    for k, run in enumerate(dataset.runs):
        parts[run.role].append(samples_of(front.blocks(run), front.block_s, k))
    return joined(parts["train"]), joined(parts["exam"])


def _rms(exam: TrainingData, correction: NDArray[np.float64]) -> float:
    left = average_samples(replace(exam, bias_dph=exam.bias_dph - correction), AVERAGE_S)
    return float(np.sqrt(np.average(left.bias_dph**2, weights=left.weight)))


def counts(rows: Sequence[Judged]) -> dict[str, Any]:
    """Count how often what is emitted is about as good as the best trivial correction, and how often it harms."""
    ratio = np.array([row.ratio for row in rows])
    of_constant = np.array([row.of_constant for row in rows])
    constant = np.array([row.method == "constant" for row in rows])
    good = ratio <= _GOOD
    shipped = np.array([row.emitted_dph[1] / row.emitted_dph[0] for row in rows if row.emitted_dph is not None])
    return {
        "splits": len(rows),
        "good": int(good.sum()),
        "constant": int((~good & constant).sum()),
        "neither": int((~good & ~constant).sum()),
        "bad_through_richer": int(((ratio > _FAIR) & ~constant).sum()),
        "worse_than_constant": int((of_constant > _GOOD).sum()),
        "worst_through_richer": float(ratio[~constant].max(initial=1.0)),
        "geometric_mean": float(np.exp(np.log(ratio).mean())),
        "faults": sum(row.verdict.startswith("fault") for row in rows),
        "with_states": int(shipped.size),
        "states_at_not_testable": sum(r.emitted_dph is not None and r.verdict == "not_testable" for r in rows),
        "states_harm": int((shipped > _HARM).sum()),
        "states_worst": float(shipped.max(initial=0.0)),
    }


def measure(settings: Settings) -> Record:
    """Judge and diagnose every split of the measured sets."""
    rows = []
    with tempfile.TemporaryDirectory() as work:
        for split in islice(splits(settings.real, Path(work)), 1 if settings.quick else None):
            say(f"{split.name} without {split.left_out}")
            try:
                rows += list(judged(split))
            except GyrotcError as refused:
                say(str(refused))
    named = [
        {
            "set": row.split.name,
            "left_out": row.split.left_out,
            "axis": row.axis,
            "method": row.method,
            "rms_dph": row.rms_dph,
            "trivial_dph": row.trivial_dph,
            "verdict": row.verdict,
            "emitted_dph": row.emitted_dph,
        }
        for row in rows
    ]
    return {"counts": counts(rows), "rows": named}


_TEXT = """
Each run, branch or end of every axis of four public data sets ([real.md](real.md)) is left out in turn, and the
correction of `gyrotc build` is judged on it. The best trivial correction is the best of a constant, a cubic and a cubic
with dT/dt on the held-out part, which is known only in hindsight.
"""


def table(record: Record) -> ResultsTable:
    """Return how often what is emitted is as good as the best trivial correction, and how often it harms."""
    count = record["counts"]
    return figures_table(
        _TEXT,
        [
            ("splits", Figure(count["splits"])),
            ("splits with at most 1.03 times the best trivial RMS", Figure(count["good"])),
            ("splits above that, with a constant that is reported", Figure(count["constant"])),
            ("splits above that, without", Figure(count["neither"], at_most=5)),
            ("splits above 1.10 times with more than a constant", Figure(count["bad_through_richer"], at_most=4)),
            ("splits worse than a constant by more than 3 %", Figure(count["worse_than_constant"], at_most=4)),
            ("RMS over the best trivial RMS, geometric mean", Figure(count["geometric_mean"], ".3f")),
            ("diagnoses that end with an internal error", Figure(count["faults"], at_most=0)),
            (
                f"splits that `--extend` makes more than 1.05 times worse, of {count['with_states']} that it changes",
                Figure(count["states_harm"], at_most=0),
            ),
        ],
    )
