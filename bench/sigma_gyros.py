"""Simulated gyros with their tables, and recordings of them whose true bias is known."""

from __future__ import annotations

import tempfile
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from gyrotc.model import Model, Term
from gyrotc.recordings.load import load
from gyrotc.simulate.campaign import campaign, simulate, with_noise
from gyrotc.simulate.scenario import read
from gyrotc.tables.quantise import quantise
from gyrotc.target.arithmetic import FLOAT64
from gyrotc.target.recursions import TermOutcome, recursion_of
from gyrotc.target.table import Table
from gyrotc.train.data import TrainingData, joined
from gyrotc.train.fitting import FitOptions, front_end, model_of, samples_of
from gyrotc.train.methods import fit
from gyrotc.train.uncertainty import start_sigma
from numpy.typing import NDArray

__all__ = ["BLOCK_S", "Gyro", "Recording", "exam_of", "gyro"]

Floats = NDArray[np.float64]

BLOCK_S = 10.0


@dataclass(frozen=True, slots=True)
class Recording:
    """One run, a mean for every block of 10 s: temperature as it is read, C; true bias and measured rate, deg/h."""

    environment: str
    temperature_c: Floats
    bias_dph: Floats
    rate_dph: Floats


@dataclass(frozen=True, slots=True)
class Gyro:
    """A gyro's table, and recordings that it was not made from."""

    seed: int
    model: Model
    table: Table
    exam: tuple[Recording, ...]


def gyro(scenario: str, seed: int, *, terms: Sequence[Term] = (), numeric: str = "f32") -> Gyro:
    """The gyro that a seed draws; `scenario` is a name or TOML, `terms` are in the model as they were planted."""
    with tempfile.TemporaryDirectory() as place:
        plan: str | Path = scenario
        if "\n" in scenario:
            plan = Path(place) / "scenario.toml"
            plan.write_text(scenario, "utf-8")
        simulate(plan, seed=seed, out=Path(place) / "data", format="parquet")
        model = _model(Path(place) / "data", terms)
        exam = tuple(exam_of(plan, seed))
    return Gyro(seed, model, quantise(model, numeric), exam)


def exam_of(plan: str | Path, seed: int) -> Iterator[Recording]:
    """The exam runs of a simulated gyro, with their true bias."""
    content = with_noise(read(plan)[1], "paper")
    runs = [(s.role, name) for s in content.set for name in s.profiles]
    n = round(BLOCK_S)
    for (role, name), record in zip(runs, campaign(content, seed), strict=True):
        whole = len(record.reading_c) // n * n
        if role == "exam":
            yield Recording(
                environment=name,
                temperature_c=record.reading_c[:whole].reshape(-1, n).mean(axis=1),
                bias_dph=np.diff(record.true_arcsec[: whole + 1 : n]) / BLOCK_S,
                rate_dph=np.diff(record.angle_arcsec[: whole + 1 : n]) / BLOCK_S,
            )


def _model(folder: Path, terms: Sequence[Term]) -> Model:
    """As `gyrotc fit` makes it, without the refits that only say how it was chosen."""
    dataset = load(folder)
    runs = [run for run in dataset.runs if run.role == "train"]
    options = FitOptions()
    front = front_end(runs, options.block_s)
    parts, raw = [], []
    for k, run in enumerate(runs):
        blocks = front.blocks(run)
        part = samples_of(blocks, front.block_s, k)
        raw.append(part.bias_dph)
        parts.append(_beside(terms, blocks, part, front.block_s) if terms else part)
    data = joined(parts)
    found = fit(data, method="mrbf" if terms else "auto")
    plain = model_of(dataset, runs, data, found, front, options, np.concatenate(raw) - data.bias_dph)
    content = plain.to_dict()
    rules = content["uncertainty_dph"]["rules"]
    rules["terms"] = [start_sigma(t.id, t.parameters, rules, data, None) for t in terms]
    return Model.from_dict({**content, "terms": [t.model_dump() for t in terms]})


def _beside(terms: Sequence[Term], blocks: Any, part: TrainingData, block_s: float) -> TrainingData:
    """The samples as the map sees them beside the terms."""
    steps, n = blocks.steps, blocks.settings.samples_per_block
    slope, none = steps.slope.astype(np.float64), np.zeros(steps.slope.size)
    seen = TermOutcome(steps.temperature.astype(np.float64), slope, none, steps.remarks)
    for term in terms:
        parameters = term.table.parameters(term.parameters, block_s)
        recursion = recursion_of(term.table.kind, FLOAT64, parameters)
        recursion.apply(blocks.stream.course(steps, n), None, seen)
    k = blocks.in_force[blocks.used]
    columns = {name: getattr(part, name) for name in TrainingData.__slots__}
    columns["temperature_c"] = np.asarray(seen.temperature, dtype=np.float64)[k]
    columns["slope_c_per_min"] = np.asarray(seen.slope, dtype=np.float64)[k] * (60.0 / block_s)
    columns["bias_dph"] = part.bias_dph - np.asarray(seen.added, dtype=np.float64)[k]
    return TrainingData(**columns)
