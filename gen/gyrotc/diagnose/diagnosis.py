"""Run `gyrotc diagnose`: all stages in their order, and the extended model."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from ..causes import CATALOGUE
from ..common.metrics import LEAST_SPAN_C, Averages
from ..common.progress import Progress, Stages, silent
from ..model import Model
from ..quality.event_findings import found_events
from ..quality.judgement import Judged, judge
from ..recordings.records import Dataset, Run
from ..results.base import Finding
from ..results.diagnosed import Diagnosed
from ..results.training import Training
from ..train.channels import FallbackModel
from ..train.data import TrainingData
from ..train.fitting import HOLD_S, FitOptions, fit_dataset, model_of, training_of
from ..train.plausibility import channel_guard, readings_of, stuck_after_s
from ..train.uncertainty import start_sigma
from .blocks import Records, name_of, records_of
from .extension import Extension, extend, fallback_models_of
from .gain import emitted_means, floor_of, gain_of
from .noise import declared_noise
from .pipeline import Analysis, analyse
from .played import Effect, added_range, terms_of
from .refinement import Refined
from .refitting import Refitting, mean_count
from .single_cycle import Cycle, cycle_of, is_single_cycle
from .static_map import fits_exactly
from .summary import not_testable, result_of
from .verdict import holds

__all__ = ["Diagnosis", "diagnose"]


@dataclass(frozen=True)
class Diagnosis:
    """The result of a diagnosis, and what its pictures are made of.

    Attributes:
        result: What `diagnose.json` holds.
        analysis: Search and statistics; None where the recordings cannot decide anything.
        extension: Gain; None without an analysis.
        model: The extended model, None if none is shipped.
        training: What `training.json` says of it.
        cycle: What a single chamber cycle tells; None where there are more.
    """

    result: Diagnosed
    analysis: Analysis | None
    extension: Extension | None
    model: Model | None
    training: Training | None = None
    cycle: Cycle | None = None


# Share of the time of each stage, as `gyrotc diagnose -v` measures it on data of `gyrotc simulate paper`.
_STAGES = {
    "reading": 0.3,
    "screening": 0.01,
    "computing the signatures of all causes": 0.5,
    "searching for causes": 0.07,
    "comparing with the simulation": 0.05,
    "measuring the gain": 0.07,
}


def diagnose(
    dataset: Dataset,
    *,
    options: FitOptions | None = None,
    progress: Progress = silent,
    judged: Judged | None = None,
) -> Diagnosis:
    """Run the whole diagnosis on the training runs; test runs measure the gain only.

    Args:
        dataset: Recordings. `truth.json` beside them is never opened.
        options: As for `fit`, whose defaults are taken where there are none.
        progress: Takes note of every stage.
        judged: Judgement of the rows of the runs; None: they are judged here.

    Raises:
        InputError: No training run, or nothing usable in them.
    """
    say = Stages(progress, _STAGES)
    say("reading")
    judged = judged or judge(dataset)
    events = found_events(dataset, judged)
    stretches = replace(dataset, runs=judged.cut(dataset.runs))
    found = _diagnosed(stretches, judged, options or FitOptions(), say)
    reported = {"events": tuple(events)}
    steps = (*_about(events), *found.result.next)
    return replace(found, result=found.result.model_copy(update=reported | {"next": steps}))


def _about(events: Sequence[Finding]) -> list[str]:
    """Return what to do about events before anything else."""
    if not any(event.leave_out_s or event.whole_run for event in events):
        return []
    return [
        "First look at the events: what is named may stand for them. Paste their exclude lines into dataset.toml and "
        "diagnose again."
    ]


def _diagnosed(dataset: Dataset, judged: Judged, chosen: FitOptions, say: Progress) -> Diagnosis:
    """All stages behind the events."""
    records = records_of(dataset, "train", block_s=chosen.block_s, average_s=chosen.average_s, judged=judged)
    undecidable = _undecidable(records)
    if undecidable:
        return Diagnosis(not_testable(dataset, chosen, undecidable), None, None, None)
    known = {record.name for record in records.runs}
    short = [run for run in dataset.runs if run.role == "train" and name_of(run) not in known]
    long = replace(dataset, runs=tuple(r for r in dataset.runs if r not in short))
    found = _of_long_runs(long, judged, records, chosen, say)
    text = "{} is left out: it has no two blocks of {:g} s"
    missing = (*found.result.missing, *(text.format(_span_of(run), records.block_s) for run in short))
    return replace(found, result=found.result.model_copy(update={"missing": missing}))


def _span_of(run: Run) -> str:
    """Return the name of a run, and where it ends if it is a part of its file."""
    return name_of(run) if run.to_s is None else f"{name_of(run)} up to {run.to_s:g} s"


def _of_long_runs(dataset: Dataset, judged: Judged, records: Records, chosen: FitOptions, say: Progress) -> Diagnosis:
    """All stages behind the choice of runs."""
    # Before the search: the rows of a whole recording and what the search remembers need not fit into memory together.
    refitting = Refitting(dataset, records, chosen, judged=judged, single_cycle=is_single_cycle(records))
    if not any(mean_count(run, chosen.average_s) for run in refitting.train):
        text = f"No training run has a mean over {chosen.average_s:g} s: record longer ones."
        return Diagnosis(not_testable(dataset, chosen, text), None, None, None)
    analysis = analyse(records, declared_noise(dataset), say)
    cycle = cycle_of(records) if refitting.single_cycle else None
    if not refitting.takes(analysis.attribution.causes):
        analysis = replace(analysis, attribution=analysis.attribution.without_causes(), separations=())
    extension = _extension(refitting, analysis, cycle, say)
    if cycle is not None:
        cycle = replace(cycle, refuted=bool(extension.refuted))
        analysis = replace(
            analysis,
            attribution=cycle.attribution(analysis.attribution),
            separations=tuple({} for _ in cycle.causes),
            extended=None,
        )
    elif extension.refuted:
        analysis = replace(analysis, attribution=replace(analysis.attribution, refuted=True))
        extension = _extension(refitting, analysis, None, say)
    causes = cycle.causes if cycle is not None else _named(analysis)
    extended, training = _extended_model(dataset, refitting, extension, chosen)
    extension = _as_emitted(dataset, refitting, extension, extended, chosen, about_means=any(map(_shifts_runs, causes)))
    result = result_of(dataset, analysis, extension, causes, chosen, cycle)
    return Diagnosis(result, analysis, extension, extended, training, cycle)


def _named(analysis: Analysis) -> tuple[Refined, ...]:
    return analysis.attribution.causes if holds(analysis.attribution) else ()


def _extension(refitting: Refitting, analysis: Analysis, cycle: Cycle | None, say: Progress) -> Extension:
    """The model extended with the named causes, or tried with the states of a single cycle."""
    records, average_s = refitting.records, refitting.average_s
    if cycle is not None:
        floor = floor_of(records, cycle.residual - cycle.explained, average_s)
        return extend(refitting, cycle.able, (), floor, say)
    named = _named(analysis)
    likely = [posterior.probability for posterior in analysis.attribution.posteriors] if named else []
    return extend(refitting, named, likely, floor_of(records, analysis.left_dph(named=bool(named)), average_s), say)


def _undecidable(records: Records) -> str:
    """Return the reason why these recordings cannot decide anything; empty if they may."""
    if not records.runs:
        return f"No run has two blocks of {records.block_s:g} s: record longer ones."
    temperature = np.concatenate([r.history.temperature_c[r.usable] for r in records.runs])
    if float(np.ptp(temperature)) < LEAST_SPAN_C:
        return f"Temperature spans only {np.ptp(temperature):.2f} C: nothing can be learnt about temperature here."
    if not any(np.any(run.rate_dph[run.usable]) for run in records.runs):
        return "All rates are the same: connect the gyro, and record again."
    if fits_exactly(records):
        return f"A map of (T, dT/dt) fits {records.size} blocks of {records.block_s:.4g} s exactly: record more."
    return ""


def _extended_model(
    dataset: Dataset, refitting: Refitting, extension: Extension, options: FitOptions
) -> tuple[Model, Training] | tuple[None, None]:
    """The model file of the extension, and what training says of it."""
    if extension.extended is None:
        return None, None
    runs, played = refitting.runs, refitting.train
    front = replace(refitting.front, stuck_s=stuck_after_s(max(run.longest_same_s for run in played)))
    plain = model_of(dataset, runs, extension.samples, extension.extended, front, options, extension.added)
    fallback_models = fallback_models_of(plain, extension.samples, played, extension.shipped)
    entries = model_entries(extension.shipped, fallback_models)
    left_out = extension.after if extension.measured_on == "left out" else ()
    training = training_of(dataset, runs, extension.samples, extension.extended, front, options, left_out)
    recorded = {effect.channel for effect in extension.shipped if effect.channel is not None}
    guards = {name: channel_guard(runs, name, HOLD_S) for name in sorted(recorded)}
    low, high = added_range(played, extension.shipped)
    own = [e for e in extension.shipped if e.channel is None]
    lost = added_range(played, own, sum(s.added for s in fallback_models.values()))
    reported = {"guards": guards, "effects_dph": [min(low, lost[0]), max(high, lost[1])]}
    content = _with_terms(plain, entries, extension.samples, runs, fallback_models)
    return Model.from_dict({**content, **reported}), training


def _as_emitted(
    dataset: Dataset,
    refitting: Refitting,
    extension: Extension,
    extended: Model | None,
    options: FitOptions,
    *,
    about_means: bool,
) -> Extension:
    """Measure the gain of the emitted tables on test runs: without states, as `gyrotc build` makes it, and with.

    Args:
        about_means: The mean of each run is subtracted, because a named cause shifts it.
    """
    exam = [run for run in dataset.runs if run.role == "exam"]
    if extended is None or extension.measured_on != "exam":
        return extension
    plain = fit_dataset(dataset, options, read=refitting.read()).model
    before, after = emitted_means((plain, extended), exam, options.average_s)
    compared = (_less_means(before), _less_means(after)) if about_means else (before, after)
    total = gain_of(*compared, extension.floor, options.average_s).model_copy(update={"about_means": about_means})
    return replace(extension, total=total, before=before, after=after)


def _shifts_runs(cause: Refined) -> bool:
    """Test whether a cause shifts whole runs, which no table corrects, so that a test run has its shift in full."""
    return CATALOGUE[cause.candidate.id].family == "between_runs"


def _less_means(runs: Sequence[Averages]) -> list[Averages]:
    return [replace(run, after_dph=run.after_dph - run.after_dph.mean()) if run.after_dph.size else run for run in runs]


def model_entries(shipped: Sequence[Effect], fallback_models: Mapping[str, FallbackModel]) -> list[dict[str, Any]]:
    """Terms as a model has them, those of channels last: a fallback model is fitted to what all others leave."""
    entries = []
    for effect in sorted(terms_of(shipped), key=lambda e: e.channel is not None):
        if effect.term.table is None:
            continue
        names = [p.name for p in effect.term.parameters if p.name in effect.values]
        entry = {
            "id": effect.id,
            "parameters": {n: effect.values[n] for n in names},
            "channel": effect.channel,
        }
        if effect.channel is not None and effect.channel in fallback_models:
            entry["stand_in"] = fallback_models[effect.channel].network
        entries.append(entry)
    return entries


def _with_terms(
    plain: Model,
    entries: list[dict[str, Any]],
    samples: TrainingData,
    runs: Sequence[Run],
    fallback_models: Mapping[str, FallbackModel],
) -> dict[str, Any]:
    """The model with its terms, and what its uncertainty says of each."""
    content = {**plain.to_dict(), "terms": entries}
    rules = content["uncertainty_dph"]["rules"]
    rules["terms"] = [
        fallback_models[e["channel"]].sigma_dph
        if e["channel"] in fallback_models
        else start_sigma(
            e["id"], e["parameters"], rules, samples, readings_of(runs if e["channel"] else (), e["channel"])
        )
        for e in entries
    ]
    return content
