"""`gyrotc diagnose`: all stages, and their result as the JSON object of the interface."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from .. import __version__
from ..dataset import Dataset, joined_runs
from ..metrics import LEAST_SPAN_C
from ..model import Model
from ..results.training import Training
from ..terms import CATALOGUE, separate_by
from ..train.fitting import FitOptions, front_end, map_method, model_of, training_of
from ..train.spans import training_spans
from .advice import VERDICTS, next_steps
from .attribute.cycle_fits import memories
from .attribute.intervals import Interval
from .attribute.refine import Refined
from .attribute.single_cycle import Cycle, cycle_of, is_single_cycle
from .detect.detection_limits import Limit
from .discrepancy.declared_noise import NoiseFinding
from .extend.extension import Extension, extend
from .extend.gain import Gain
from .noise_colour.colours import declared_noise
from .pipeline import Analysis, analyse
from .screen.gather import records_of
from .signatures.candidates import diagnosed
from .verdict import holds, verdict_of
from .words import NOISE_WORDS

__all__ = ["Diagnosis", "diagnose"]

Progress = Callable[[str], None]

_MOST_EQUIVALENT = 2


@dataclass(frozen=True)
class Diagnosis:
    """Result, and what the pictures are made of.

    Attributes:
        result: The JSON object.
        analysis: Search and statistics; None where the recordings cannot decide anything.
        extension: Gain; None without an analysis.
        model: The extended model, None if none is shipped.
        training: What `training.json` says of it.
        cycle: What a single chamber cycle tells; None where there are more.
    """

    result: dict[str, Any]
    analysis: Analysis | None
    extension: Extension | None
    model: Model | None
    training: Training | None = None
    cycle: Cycle | None = None


def diagnose(
    dataset: Dataset,
    *,
    model: Model | None = None,
    options: FitOptions | None = None,
    progress: Progress | None = None,
) -> Diagnosis:
    """Runs the whole diagnosis on the training runs; exam runs measure the gain only.

    Args:
        dataset: Recordings. `truth.json` beside them is never opened.
        model: A model made before: its method, block and number of centers are those of the refit.
        options: As for `fit`; default: those of `model`, else of `fit`.
        progress: Called with what is being done.

    Raises:
        InputError: No training run, or nothing usable in them.
    """
    say = progress or (lambda _: None)
    chosen = options or _options_of(model)
    say("reading")
    dataset = replace(dataset, runs=joined_runs(dataset.runs))
    records = records_of(dataset, "train", block_s=chosen.block_s, average_s=chosen.average_s)
    temperature = np.concatenate([r.history.temperature_c[r.usable] for r in records.runs])
    if float(np.ptp(temperature)) < LEAST_SPAN_C:
        return Diagnosis(_not_testable(dataset, chosen, float(np.ptp(temperature))), None, None, None)
    analysis = analyse(records, declared_noise(dataset), say)
    cycle = cycle_of(records) if is_single_cycle(records) else None
    if cycle is not None:
        analysis = replace(
            analysis,
            attribution=cycle.attribution(analysis.attribution),
            separations=tuple({} for _ in cycle.causes),
            extended=None,
        )
        causes = cycle.causes
    else:
        causes = analysis.attribution.causes if holds(analysis.attribution) else ()
    states = causes if cycle is None else cycle.states
    extension = extend(dataset, records, states, chosen, say, single_cycle=cycle is not None)
    extended, training = _extended_model(dataset, extension, chosen)
    result = _result(dataset, analysis, extension, causes, chosen, cycle)
    return Diagnosis(result, analysis, extension, extended, training, cycle)


def _options_of(model: Model | None) -> FitOptions:
    if model is None:
        return FitOptions()
    centers = model.n_centers if map_method(model.method) == model.method else None
    method = map_method(model.method)
    return FitOptions(method, model.seed, centers, None, model.block_s, model.average_s)


def _head(dataset: Dataset, verdict: str, options: FitOptions) -> dict[str, Any]:
    block = front_end([r for r in dataset.runs if r.role == "train"], options.block_s).block_s
    return {
        "schema": "gyrotc.diagnose/1",
        "gyrotc_version": __version__,
        "serial": dataset.serial,
        "axis": dataset.axis,
        "verdict": verdict,
        "block_s": block,
        "average_s": options.average_s,
    }


def _not_testable(dataset: Dataset, options: FitOptions, span_c: float) -> dict[str, Any]:
    text = f"Temperature spans only {span_c:.2f} C: nothing can be learnt about temperature here."
    return _head(dataset, "not_testable", options) | {
        "noise_floor_dph": None,
        "discrepancies": [],
        "causes": [],
        "estimated_noise": None,
        "baseline": None,
        "extended": None,
        "considered": [
            {"id": i, "family": t.family, "p_value": None, "detection_limit": None, "not_testable": text}
            for i, t in diagnosed().items()
        ],
        "missing": [text],
        "measured_on": None,
        "single_cycle": None,
        "shipping": None,
        "unexplained": None,
        "text": text,
        "meaning": VERDICTS["not_testable"],
        "next": next_steps("not_testable", [], [], shipped=False),
    }


def _result(
    dataset: Dataset,
    analysis: Analysis,
    extension: Extension,
    causes: tuple[Refined, ...],
    options: FitOptions,
    cycle: Cycle | None,
) -> dict[str, Any]:
    attribution = analysis.attribution
    verdict = verdict_of(attribution, analysis.noise)
    if cycle is not None and causes:
        verdict = "ambiguous" if cycle.rivals else "partial"
    elif cycle is not None and cycle.not_testable:
        verdict = "not_testable"
    listed = [_cause(analysis, extension, k) for k in range(len(causes))]
    listed += [_noise_cause(n) for n in analysis.noise]
    untestable = _untestable(analysis, cycle)
    missing = [f"{CATALOGUE[i].words.name}: {why}" for i, why in untestable.items()]
    result = _head(dataset, verdict, options) | {
        "noise_floor_dph": extension.floor,
        "discrepancies": _discrepancies(analysis),
        "causes": listed,
        "baseline": {"exam_rms_dph": extension.baseline_rms, "centers": extension.baseline_centers},
        "extended": _extended(extension),
        "considered": _considered(analysis, untestable),
        "missing": missing,
        "estimated_noise": _estimated_noise(analysis),
        "measured_on": extension.measured_on,
        "single_cycle": None if cycle is None else _tried(cycle, extension),
        "shipping": extension.crossed.content(),
        "unexplained": _unexplained(analysis) if verdict in ("unexplained", "partial") else None,
    }
    result["text"] = _sentence(result)
    result["meaning"] = VERDICTS[verdict]
    shipped = result["extended"] is not None
    result["next"] = next_steps(verdict, result["causes"], list(untestable), shipped=shipped)
    return result


def _untestable(analysis: Analysis, cycle: Cycle | None) -> dict[str, str]:
    """Causes that these recordings cannot test, and why."""
    found = dict(analysis.search.bank.untestable)
    if cycle is not None and cycle.not_testable:
        found |= dict.fromkeys(memories(), cycle.not_testable)
    return found


def _tried(cycle: Cycle, extension: Extension) -> dict[str, Any]:
    """Every memory and every static dT/dt that was tried beside a map of T, best first."""
    return {
        "map_rms_dph": cycle.rms_dph,
        "turns": cycle.turns,
        "not_testable": cycle.not_testable or None,
        "gain": _gain(extension.steps[-1]) if extension.steps else None,
        "static": [
            {"powers": [list(p) for p in s.powers], "rms_dph": s.rms_dph, "criterion": s.criterion}
            for s in cycle.static
        ],
        "tried": [
            {
                "states": [
                    {"id": m.id, **{n: _interval(i) for n in m.values}}
                    for m, i in zip(t.members, t.intervals, strict=True)
                ],
                "rms_dph": t.rms_dph,
                "criterion": t.criterion,
                "resolved": t.resolved,
            }
            for t in cycle.tried
        ],
    }


def _discrepancies(analysis: Analysis) -> list[dict[str, Any]]:
    """Statistics against the plain simulation and against the extended one."""
    after = analysis.extended
    extended = {d.statistic: vars(d) for d in after.discrepancies} if after is not None else {}
    return [vars(d) | {"extended": extended.get(d.statistic)} for d in analysis.ensemble.discrepancies]


def _cause(analysis: Analysis, extension: Extension, k: int) -> dict[str, Any]:
    attribution = analysis.attribution
    cause = attribution.causes[k]
    id = cause.candidate.id
    near = attribution.rivals[k]
    rivals = list(dict.fromkeys(r.id for r in near))[:_MOST_EQUIVALENT]
    channels = [r.channel for r in near if r.channel is not None]
    entry: dict[str, Any] = {
        "id": id,
        "family": CATALOGUE[id].family,
        "name": CATALOGUE[id].words.name,
        "p_value": attribution.p_values[k],
        "parameters": {n: _interval(v) for n, v in cause.parameters.items() if np.isfinite(v.value)},
        "equivalent": rivals,
        "separate_by": separate_by(id, rivals[0]) if rivals else None,
        "gain": _gain(extension.steps[k]),
        "signature": CATALOGUE[id].words.signature,
        "remedy": CATALOGUE[id].words.remedy,
        "separable_from_d": analysis.separations[k],
    }
    if cause.candidate.channel is not None:
        entry["channel"] = cause.candidate.channel
    if channels:
        entry["equivalent_channels"] = channels
    return entry


def _interval(value: Interval) -> dict[str, float]:
    return {"value": value.value, "low": value.low, "high": value.high}


def _gain(gain: Gain) -> dict[str, Any]:
    return gain.to_dict()


def _noise_cause(finding: NoiseFinding) -> dict[str, Any]:
    return {
        "id": finding.id,
        "family": "noise",
        "name": NOISE_WORDS[finding.id],
        "p_value": finding.p_value,
        "parameters": {n: {"value": v, "low": None, "high": None} for n, v in finding.parameters.items()},
        "equivalent": [],
        "separate_by": None,
        "gain": None,
        "signature": finding.text,
        "remedy": "declare what was measured, or mend the instrument",
    }


def _extended(extension: Extension) -> dict[str, Any] | None:
    if extension.extended is None or extension.total is None:
        return None
    left = extension.rate_left_out
    return {
        "exam_rms_dph": extension.total.rms_after,
        "centers": extension.extended.n_centers,
        "terms": [e.id for e in extension.shipped if CATALOGUE[e.id].table is not None],
        "model": None,
        "gain": _gain(extension.total),
        "rate_left_out": None if left is None else {"environment": left[0], **_gain(left[1])},
        "forward_in_time": None if extension.forward is None else _gain(extension.forward),
    }


def _estimated_noise(analysis: Analysis) -> dict[str, float]:
    """Noise at the likeliest colour in the terms of a scenario; a Markov part has no such term."""
    view, block_s = analysis.after.likeliest, analysis.records.block_s
    colour = view.colour
    flicker = colour.slow if colour.tau_s == 0.0 else 0.0
    levels = {
        "arw_deg_per_sqrt_h": np.sqrt(colour.white * block_s / 3600.0),
        "bias_instability_dph": np.sqrt(flicker * np.pi / np.log(4.0)),
        "rate_random_walk_dph_per_sqrt_h": np.sqrt(colour.walk),
        "quantum_arcsec": block_s * np.sqrt(12.0 * colour.quantum),
    }
    return {name: float(view.scale * value) for name, value in levels.items() if value > 0.0}


def _considered(analysis: Analysis, untestable: Mapping[str, str]) -> list[dict[str, Any]]:
    """Every cause of the catalogue with its adjusted p-value and its detection limit."""
    best: dict[str, tuple[float, float | None]] = {}
    for found in analysis.attribution.first:
        candidate = found.candidate
        key = candidate.id if candidate.channel is None else f"{candidate.id}:{candidate.channel}"
        if key not in best or found.p_value < best[key][0]:
            best[key] = (found.p_value, None)
    out = []
    for key, (p_value, _) in best.items():
        id, _, channel = key.partition(":")
        if id == "structure":
            continue
        limit = analysis.limits.get(key)
        entry: dict[str, Any] = {
            "id": id,
            "family": CATALOGUE[id].family,
            "p_value": p_value,
            "detection_limit": _limit(limit),
        }
        if channel:
            entry["channel"] = channel
        out.append(entry)
    out = [entry for entry in out if entry["id"] not in untestable]
    for id, why in untestable.items():
        out.append(
            {
                "id": id,
                "family": CATALOGUE[id].family,
                "p_value": None,
                "detection_limit": None,
                "not_testable": why,
            }
        )
    order = list(diagnosed())
    return sorted(out, key=lambda e: order.index(e["id"]))


def _limit(limit: Limit | None) -> dict[str, Any] | None:
    if limit is None:
        return None
    return {
        "value": limit.value,
        "unit": limit.unit,
        "parameter": limit.parameter,
        "over": [list(p) for p in limit.at],
    }


def _unexplained(analysis: Analysis) -> dict[str, Any]:
    """What is left: how much of the structure the best cause holds, and where the rest lies."""
    attribution = analysis.attribution
    return {
        "share_explained": attribution.share,
        "p_value": attribution.misfit_p,
        "best_partial_match": [c.candidate.id for c in attribution.causes],
        "looks_like": attribution.other.name if attribution.other.lead > 0.0 else None,
    }


def _sentence(result: dict[str, Any]) -> str:
    """The finding in one or two sentences."""
    causes = [c for c in result["causes"] if c["family"] != "noise"]
    names = "; ".join(
        f"{name} (twice)" if sum(c["name"] == name for c in causes) > 1 else name
        for name in dict.fromkeys(c["name"] for c in causes)
    )
    noise = "; ".join(c["name"] for c in result["causes"] if c["family"] == "noise")
    text = {
        "consistent": "Nothing was found beyond the static map and the declared noise.",
        "explained": f"{names}.",
        "ambiguous": f"{names}, or equally well: "
        + ", ".join(
            CATALOGUE[i].words.name
            + (f" ({', '.join(c['equivalent_channels'])})" if CATALOGUE[i].needs.channel else "")
            for c in causes
            for i in c["equivalent"]
        )
        + ".",
        "partial": f"{names}, and structure remains that no cause explains.",
        "noise_differs": f"{noise}.",
        "unexplained": "There is structure that no cause of the catalogue explains.",
        "not_testable": _undecided(result),
    }[result["verdict"]]
    extended = result["extended"]
    if extended is None:
        return str(text)
    share = extended["gain"]["share_of_excess_removed"]
    if share is None:
        return str(text)
    amount = "all" if share >= 0.995 else f"{share:.0%}"
    return f"{text} On unseen runs the extension removes {amount} of the removable error."


def _undecided(result: dict[str, Any]) -> str:
    cycle = result["single_cycle"]
    why = f" about memory of the temperature: {cycle['not_testable']}" if cycle else ""
    return f"The recordings cannot decide{why}."


def _extended_model(
    dataset: Dataset, extension: Extension, options: FitOptions
) -> tuple[Model, Training] | tuple[None, None]:
    """The model file of the extension, and what training says of it."""
    if extension.extended is None:
        return None, None
    runs = [r for r in dataset.runs if r.role == "train"]
    front = front_end(runs, options.block_s)
    plain = model_of(dataset, runs, extension.samples, extension.extended, front, options)
    entries = []
    for effect in extension.shipped:
        if CATALOGUE[effect.id].table is None:
            continue
        names = [p.name for p in CATALOGUE[effect.id].parameters]
        entries.append(
            {
                "id": effect.id,
                "parameters": {n: effect.values[n] for n in names},
                "channel": effect.channel,
            }
        )
    left_out = extension.after if extension.measured_on == "left out" else None
    spans = training_spans(runs, extension.samples)
    training = training_of(dataset, extension.samples, extension.extended, front, options, spans, left_out)
    return Model.from_dict({**plain.to_dict(), "terms": entries}), training
