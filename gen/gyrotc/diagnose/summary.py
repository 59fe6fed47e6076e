"""The result of a diagnosis, as `diagnose.json` holds it."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

import numpy as np

from .. import __version__
from ..causes import CATALOGUE
from ..recordings.records import Dataset
from ..results.base import Estimate
from ..results.diagnosed import (
    Baseline,
    ComparedStatistic,
    ConsideredCause,
    CycleResult,
    DetectionLimit,
    Diagnosed,
    ExtendedModel,
    NamedCause,
    StaticRate,
    Statistic,
    TriedMemories,
    Unexplained,
    WithoutRate,
)
from ..train.fitting import FitOptions, front_end
from .candidates import diagnosable_causes
from .detection import CauseLimit
from .discrepancy import NoiseFinding
from .extension import Extension, rms_of
from .noise import NOISE_WORDS
from .pipeline import Analysis
from .played import terms_of
from .refinement import Interval, Refined
from .single_cycle import Cycle, memories
from .verdict import VERDICTS, deciding_run, looks_like, meaning_of, next_steps, sentence_of, shows_as, verdict_of

_MOST_EQUIVALENT = 3  # of what remains possible; the page has the probabilities of all


def _block_s(dataset: Dataset, options: FitOptions) -> float:
    return front_end([r for r in dataset.runs if r.role == "train"], options.block_s).block_s


def not_testable(dataset: Dataset, options: FitOptions, text: str) -> Diagnosed:
    """The result where nothing can be decided, and why: before any search."""
    return Diagnosed(
        gyrotc_version=__version__,
        serial=dataset.serial,
        axis=dataset.axis,
        verdict="not_testable",
        block_s=_block_s(dataset, options),
        average_s=options.average_s,
        noise_floor_dph=None,
        discrepancies=(),
        causes=(),
        estimated_noise=None,
        baseline=None,
        extended=None,
        considered=tuple(_untested(i, text) for i in diagnosable_causes()),
        missing=(text,),
        measured_on=None,
        single_cycle=None,
        shipping=None,
        unexplained=None,
        text=text,
        meaning=VERDICTS["not_testable"],
        next=tuple(next_steps("not_testable", [], [], gain=None)),
    )


def result_of(
    dataset: Dataset,
    analysis: Analysis,
    extension: Extension,
    causes: Sequence[Refined],
    options: FitOptions,
    cycle: Cycle | None,
) -> Diagnosed:
    """The result of a diagnosis.

    Args:
        causes: Those that are named, as the extension took them.
        cycle: What a single chamber cycle tells; None where there are more.
    """
    verdict = verdict_of(analysis.attribution, analysis.noise, cycle)
    listed = tuple(_cause(analysis, extension, k, cycle) for k in range(len(causes)))
    listed += tuple(_noise_cause(n) for n in analysis.noise)
    untestable = _untestable(analysis, cycle)
    extended = _extended(extension)
    undecided = cycle.not_testable if cycle is not None else ""
    return Diagnosed(
        gyrotc_version=__version__,
        serial=dataset.serial,
        axis=dataset.axis,
        verdict=verdict,
        block_s=_block_s(dataset, options),
        average_s=options.average_s,
        noise_floor_dph=extension.floor,
        discrepancies=tuple(_statistics(analysis)),
        causes=listed,
        baseline=Baseline(exam_rms_dph=extension.baseline_rms, centers=extension.baseline_centers),
        extended=extended,
        considered=tuple(_considered(analysis, untestable)),
        missing=tuple(f"{CATALOGUE[i].words.name}: {why}" for i, why in untestable.items()),
        estimated_noise=_estimated_noise(analysis),
        measured_on=extension.measured_on,
        single_cycle=None if cycle is None else _single_cycle(cycle, extension),
        shipping=extension.crossed.result(),
        unexplained=_unexplained(analysis)
        if verdict == "unexplained" or (verdict == "partial" and not cycle)
        else None,
        text=sentence_of(
            verdict,
            listed,
            extended,
            undecided,
            analysis.attribution.wide if causes else None,
            single_cycle=cycle is not None,
        ),
        meaning=meaning_of(verdict, single_cycle=cycle is not None),
        lot=_of_lot(extension, options, single_cycle=cycle is not None),
        next=tuple(
            next_steps(
                verdict,
                listed,
                list(untestable),
                gain=None if extended is None else extended.gain,
                single_cycle=cycle is not None,
            )
        ),
    )


def _of_lot(extension: Extension, options: FitOptions, *, single_cycle: bool) -> str | None:
    """Return the use of the lot, in words."""
    if options.prior is None:
        return None
    if single_cycle or extension.lot is None:
        return "not used: beside an effect the map of a single cycle is one of T alone, which a lot does not know"
    text = extension.lot.text
    return f"the map beside the causes was fitted with {text}" if extension.lot.accepted else text


def _untestable(analysis: Analysis, cycle: Cycle | None) -> dict[str, str]:
    """Causes that these recordings cannot test, and why."""
    found = dict(analysis.untestable)
    if cycle is not None and cycle.not_testable:
        found |= dict.fromkeys(memories(), cycle.not_testable)
    return found


def _single_cycle(cycle: Cycle, extension: Extension) -> CycleResult:
    """Every memory and every static dT/dt that was tried beside a map of T, best first."""
    tried = (
        TriedMemories(
            states=tuple(
                {"id": m.id, **{n: _estimate(i) for n in m.values}} for m, i in zip(t.members, t.intervals, strict=True)
            ),
            rms_dph=t.rms_dph,
            criterion=t.criterion,
            resolved=t.resolved,
        )
        for t in cycle.tried
    )
    static = (StaticRate(powers=s.powers, rms_dph=s.rms_dph, criterion=s.criterion) for s in cycle.static)
    return CycleResult(
        map_rms_dph=cycle.rms_dph,
        turns=cycle.turns,
        not_testable=cycle.not_testable or None,
        gain=extension.steps[-1] if extension.steps else None,
        static=tuple(static),
        tried=tuple(tried),
    )


def _statistics(analysis: Analysis) -> Iterator[Statistic]:
    """Statistics against the plain simulation and against the extended one."""
    after = analysis.extended.discrepancies if analysis.extended is not None else ()
    extended = {d.statistic: ComparedStatistic(**vars(d)) for d in after}
    for d in analysis.ensemble.discrepancies:
        yield Statistic(**vars(d), extended=extended.get(d.statistic))


def _cause(analysis: Analysis, extension: Extension, k: int, cycle: Cycle | None) -> NamedCause:
    attribution = analysis.attribution
    cause = attribution.causes[k]
    id = cause.candidate.id
    if cycle is None:
        posterior = attribution.posteriors[k]
        near, probabilities = posterior.remaining, posterior.probabilities
    else:
        near, probabilities = (cycle.rivals if k == 0 else ()), None
    rivals = tuple(dict.fromkeys(r.id for r in near))[:_MOST_EQUIVALENT]
    words = CATALOGUE[id].words
    named = NamedCause(
        id=id,
        family=CATALOGUE[id].family,
        name=words.name,
        p_value=attribution.p_values[k],
        parameters={n: _estimate(v) for n, v in cause.parameters.items() if np.isfinite(v.value)},
        equivalent=rivals,
        separate_by=deciding_run(id, rivals[0]) if rivals else None,
        gain=extension.steps[k],
        signature=shows_as(id, attribution.wide),
        remedy=words.remedy,
        separable_from_d=analysis.separations[k],
    )
    channels = tuple(r.channel for r in near if r.channel is not None)
    repair = CATALOGUE[id].repair
    values = {name: interval.value for name, interval in cause.parameters.items()}
    reported: dict[str, str | tuple[str, ...] | dict[str, float] | None] = {
        "probabilities": probabilities,
        "repair": None if repair is None else repair(cause.candidate.values | values),
        "channel": cause.candidate.channel,
        "equivalent_channels": channels or None,
    }
    return named.model_copy(update={name: value for name, value in reported.items() if value is not None})


def _estimate(interval: Interval) -> Estimate:
    return Estimate(value=interval.value, low=interval.low, high=interval.high)


def _noise_cause(finding: NoiseFinding) -> NamedCause:
    return NamedCause(
        id=finding.id,
        family="noise",
        name=NOISE_WORDS[finding.id],
        p_value=finding.p_value,
        parameters={n: Estimate(value=v, low=None, high=None) for n, v in finding.parameters.items()},
        equivalent=(),
        separate_by=None,
        gain=None,
        signature=finding.text,
        remedy="declare what was measured, or mend the instrument",
    )


def _extended(extension: Extension) -> ExtendedModel | None:
    if extension.extended is None or extension.total is None:
        return None
    left = extension.rate_left_out
    return ExtendedModel(
        exam_rms_dph=rms_of(extension.after) if extension.total.about_means else extension.total.exam_rms_after_dph,
        centers=extension.centers,
        terms=tuple(e.id for e in terms_of(extension.shipped) if CATALOGUE[e.id].table is not None),
        model=None,
        gain=extension.total,
        rate_left_out=None if left is None else WithoutRate(environment=left[0], **dict(left[1])),
        forward_in_time=extension.forward,
    )


def _estimated_noise(analysis: Analysis) -> dict[str, float]:
    """Noise at the likeliest colour in the terms of a scenario; a Markov part has no such term."""
    colour, block_s = analysis.colour, analysis.records.block_s
    flicker = colour.slow if colour.tau_s == 0.0 else 0.0
    levels = {
        "arw_deg_per_sqrt_h": np.sqrt(colour.white * block_s / 3600.0),
        "bias_instability_dph": np.sqrt(flicker * np.pi / np.log(4.0)),
        "rate_random_walk_dph_per_sqrt_h": np.sqrt(colour.walk),
        "quantum_arcsec": block_s * np.sqrt(12.0 * colour.quantum),
    }
    return {name: float(analysis.scale * value) for name, value in levels.items() if value > 0.0}


def _considered(analysis: Analysis, untestable: Mapping[str, str]) -> list[ConsideredCause]:
    """Every cause of the catalogue with its adjusted p-value and its detection limit."""
    best: dict[tuple[str, str | None], float] = {}
    for found in analysis.attribution.first:
        key = found.candidate.id, found.candidate.channel
        best[key] = min(found.p_value, best.get(key, np.inf))
    out = {"structure", *untestable}
    every = [_tested(analysis, *key, p_value) for key, p_value in best.items() if key[0] not in out]
    every += [_untested(id, why) for id, why in untestable.items()]
    order = list(diagnosable_causes())
    return sorted(every, key=lambda cause: order.index(cause.id))


def _tested(analysis: Analysis, id: str, channel: str | None, p_value: float) -> ConsideredCause:
    limit = analysis.limits.get(id if channel is None else f"{id}:{channel}")
    cause = ConsideredCause(
        id=id,
        family=CATALOGUE[id].family,
        p_value=p_value,
        detection_limit=None if limit is None else _limit(limit),
    )
    return cause if channel is None else cause.model_copy(update={"channel": channel})


def _untested(id: str, why: str) -> ConsideredCause:
    return ConsideredCause(id=id, family=CATALOGUE[id].family, p_value=None, detection_limit=None, not_testable=why)


def _limit(limit: CauseLimit) -> DetectionLimit:
    return DetectionLimit(value=limit.value, unit=limit.unit, parameter=limit.parameter, over=limit.at)


def _unexplained(analysis: Analysis) -> Unexplained:
    """Return the share of the structure that the best causes explain, and what the rest looks like."""
    attribution = analysis.attribution
    return Unexplained(
        share_explained=attribution.left.share,
        p_value=attribution.left.worst,
        best_partial_match=tuple(c.candidate.id for c in attribution.causes),
        looks_like=looks_like(attribution),
    )
