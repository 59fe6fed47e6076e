"""What a diagnosis found, as `diagnose.json` holds it: verdict, figures, words, and what to do next."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

import numpy as np

from .. import __version__
from ..causes import CATALOGUE, separate_by
from ..recordings.records import Dataset
from ..results.base import Estimate
from ..results.diagnosed import (
    LIKELIER_THAN_ALL_ELSE,
    Baseline,
    ComparedStatistic,
    ConsideredCause,
    CycleResult,
    DetectionLimit,
    Diagnosed,
    DiagnosisVerdict,
    ExtendedModel,
    GainOnUnseen,
    NamedCause,
    StaticRate,
    Statistic,
    TriedMemories,
    Unexplained,
    WithoutRate,
)
from ..train.fitting import FitOptions, front_end
from .attribution import Attribution
from .candidates import diagnosable_causes, searched, shape_parameter
from .detection import CauseLimit
from .discrepancy import NoiseFinding
from .extension import Extension
from .gain import Gain
from .noise import NOISE_WORDS
from .pipeline import Analysis
from .refinement import Interval, Refined
from .refit import terms_of
from .rivals import UNNAMED
from .single_cycle import Cycle, memories
from .wide_memory import WideMemory

VERDICTS: dict[DiagnosisVerdict, str] = {
    "consistent": "The simulation agrees with the recordings. The detection limits say what could still hide.",
    "explained": "The causes listed account for what the simulation gets wrong.",
    "ambiguous": "Two or more causes explain these recordings equally well.",
    "partial": "A cause is named, and structure remains that it does not explain.",
    "noise_differs": "Only the noise is not what the simulation declares.",
    "unexplained": "There is structure that no cause of the catalogue explains: none is named.",
    "not_testable": "These recordings cannot decide.",
}

_STEPS: dict[DiagnosisVerdict, str] = {
    "consistent": "Nothing is needed. For lower detection limits record the programme of docs/howto-calibration.md.",
    "explained": "Mend the cause and record again.",
    "partial": "Run one profile twice: what repeats is memory or map, what does not is noise or an unrecorded input."
    " Record supply, discharge current, pressure and magnetic field beside the rate.",
    "noise_differs": "Declare the noise that was measured ([noise] of dataset.toml), or find out why it differs;"
    " then diagnose again: detection limits follow the noise.",
    "unexplained": "Run one profile twice: what repeats is memory or map, what does not is noise or an unrecorded"
    " input. Record supply, discharge current, pressure and magnetic field beside the rate.",
    "not_testable": "Record ramps over the product's range of temperature, up and down, at two rates at least.",
}


def next_steps(
    verdict: DiagnosisVerdict,
    causes: Sequence[NamedCause],
    untestable: Sequence[str],
    *,
    gain: GainOnUnseen | None,
) -> list[str]:
    """Sentences, the most telling first.

    Args:
        verdict: One of `VERDICTS`.
        causes: Causes and kinds of noise that were found.
        untestable: Ids of the causes that these recordings cannot test.
        gain: Of the extension that is shipped; None: none is.
    """
    steps = [_deciding_run(c) for c in causes if c.separate_by]
    if gain is not None and gain.shown == "gain":
        steps.append("Build with the extension (gyrotc build --extend).")
    elif gain is not None:
        steps.append("Build without the extension: runs that were not fitted to show no gain of it.")
    if verdict == "explained" and gain is None:
        remedies = dict.fromkeys(c.remedy for c in causes if c.family != "noise")
        steps.append(f"Against it: {'; '.join(remedies)}.")
    elif verdict != "ambiguous":
        steps.append(_STEPS[verdict])
    steps += [f"Paste {c.repair} into dataset.toml and build again." for c in causes if c.repair]
    named = [CATALOGUE[c.id].words for c in causes if c.id in CATALOGUE]
    steps += dict.fromkeys(words.advice for words in named if words.advice)
    missing = [text for i in untestable if (text := CATALOGUE[i].words.recording)]
    if missing and verdict != "not_testable":
        steps.append(f"To test what these recordings cannot: {'; '.join(missing)}.")
    return steps


def _deciding_run(cause: NamedCause) -> str:
    """The run to record in order to separate a cause from its likeliest rival, and what the present runs can do."""
    rival, limits = cause.equivalent[0], cause.separable_from_d or {}
    now = f" The present runs separate them from d = {limits[rival]:.2g} on." if rival in limits else ""
    pair = f"{cause.id} from {rival}".replace("_", " ")
    return f"To separate {pair}, record {cause.separate_by}.{now}"


def sentence_of(
    verdict: DiagnosisVerdict,
    found: Sequence[NamedCause],
    extended: ExtendedModel | None,
    undecided: str,
    wide: WideMemory | None = None,
    rivals: Sequence[str] = (),
) -> str:
    """The finding in one to three sentences.

    Args:
        undecided: Why a single cycle cannot tell of memory.
        wide: The form of hysteresis that is among the causes, where it is more than one play.
        rivals: What explains the recordings as well and is no cause.
    """
    why = f" about memory of the temperature: {undecided}" if undecided else ""
    causes = [c for c in found if c.family != "noise"]
    names = "; ".join(
        f"{name} (twice)" if sum(c.name == name for c in causes) > 1 else name
        for name in dict.fromkeys(c.name for c in causes)
    )
    noise = "; ".join(c.name for c in found if c.family == "noise")
    text = {
        "consistent": "Nothing was found beyond the static map and the declared noise.",
        "explained": f"{names}.",
        "ambiguous": f"{names}, or equally well: {', '.join([*_rivals(causes), *rivals])}.",
        "partial": f"{names}, and structure remains that no cause explains.",
        "noise_differs": f"{noise}.",
        "unexplained": "There is structure that no cause of the catalogue explains.",
        "not_testable": f"The recordings cannot decide{why}.",
    }[verdict]
    text += f" Here {wide.text}." if wide is not None else ""
    return text if extended is None else f"{text} {extended.gain.text}"


def shows_as(cause: str, wide: WideMemory | None) -> str:
    """How a cause shows; of hysteresis (`wide`: of a form that is more than one play) also how it differs from that."""
    words = CATALOGUE[cause].words
    if wide is None or not searched(cause).loops:
        return words.signature
    return f"{words.signature}; here {wide.text}"


def _rivals(causes: Sequence[NamedCause]) -> Iterator[str]:
    """Names of causes that explain the runs as well, with their channels."""
    for cause in causes:
        for id in cause.equivalent:
            channels = ", ".join(cause.equivalent_channels or ())
            yield CATALOGUE[id].words.name + (f" ({channels})" if CATALOGUE[id].needs.channel else "")


_MISFITS = ((0.05, 0.5), (0.01, 0.8))
"""p-value of what is left (`Misfit.worst`), and share of the structure below which the causes then explain too little.

However clear the remainder: where four fifths are a cause and no other shape does better, it is that cause in another
form than the catalogue's (relays in place of a play), and the remainder is reported beside it.
"""

_REMAINDER = 1e-3  # p-value of what is left below which "explained" would claim too much
_SEEN = 0.05  # p-value over the whole search that at least one of the causes has itself


def holds(attribution: Attribution) -> bool:
    """Whether causes are given at all.

    Not where most of the structure is none of them, where their families are not likelier than all else, where a
    parameter is one that no gyro has, and not where the search sees none of them: something else was detected then.
    """
    left = attribution.left
    little = any(left.worst < p and left.share < share for p, share in _MISFITS)
    plausible = bool(attribution.causes) and all(cause.plausible for cause in attribution.causes)
    seen = min(attribution.p_values, default=1.0) <= _SEEN
    return plausible and seen and not little and all(map(_likely, attribution.probabilities))


def _likely(probabilities: Mapping[str, float]) -> bool:
    """Whether a cause is likelier than something unnamed, and its family likelier than all else together."""
    named, *others = probabilities
    family = [id for id in others if id in CATALOGUE and CATALOGUE[id].family == CATALOGUE[named].family]
    share = sum(probabilities[id] for id in (named, *family))
    return probabilities[named] > probabilities[UNNAMED] and share > LIKELIER_THAN_ALL_ELSE


def verdict_of(attribution: Attribution, noise: Sequence[NoiseFinding]) -> DiagnosisVerdict:
    """One of the verdicts of the interface; `not_testable` is given before any search.

    Args:
        attribution: What the search found.
        noise: Findings of the family `noise`.
    """
    if attribution.detected and not holds(attribution):
        return "unexplained"
    if holds(attribution):
        if attribution.left.p_value < _REMAINDER:
            return "partial"
        return "ambiguous" if any(attribution.rivals) else "explained"
    return "noise_differs" if noise else "consistent"


def looks_like(attribution: Attribution) -> str | None:
    """What structure without a name resembles: another shape, or a cause with a parameter that no gyro has."""
    if attribution.other.lead > 0.0:
        return attribution.other.name
    for cause in attribution.causes:
        parameter = shape_parameter(cause.candidate.id)
        if parameter is not None and not cause.plausible:
            value = f"{parameter.name} = {cause.parameters[parameter.name].value:.2g} {parameter.unit}"
            known = f"{parameter.low:g} to {parameter.high:g} {parameter.unit} are known"
            return f"{cause.candidate.id.replace('_', ' ')} with {value}, where {known}"
    return None


_MOST_EQUIVALENT = 2  # rivals that are named; the page lists every cause with its p-value besides


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
    verdict = verdict_of(analysis.attribution, analysis.noise)
    if cycle is not None and causes:
        verdict = "ambiguous" if cycle.rivals or cycle.rate_would_do else "partial"
    elif cycle is not None and cycle.not_testable:
        verdict = "not_testable"
    listed = tuple(_cause(analysis, extension, k) for k in range(len(causes)))
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
        unexplained=_unexplained(analysis) if verdict in ("unexplained", "partial") else None,
        text=sentence_of(
            verdict,
            listed,
            extended,
            undecided,
            analysis.attribution.wide if causes else None,
            ["a static dependence on dT/dt"] if cycle is not None and cycle.rate_would_do else [],
        ),
        meaning=VERDICTS[verdict],
        lot=_of_lot(extension, options, single_cycle=cycle is not None),
        next=tuple(next_steps(verdict, listed, list(untestable), gain=None if extended is None else extended.gain)),
    )


def _of_lot(extension: Extension, options: FitOptions, *, single_cycle: bool) -> str | None:
    """What became of the lot, in words."""
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
        gain=_result(extension.steps[-1]) if extension.steps else None,
        static=tuple(static),
        tried=tuple(tried),
    )


def _result(gain: Gain | None) -> GainOnUnseen | None:
    return None if gain is None else gain.result()


def _statistics(analysis: Analysis) -> Iterator[Statistic]:
    """Statistics against the plain simulation and against the extended one."""
    after = analysis.extended.discrepancies if analysis.extended is not None else ()
    extended = {d.statistic: ComparedStatistic(**vars(d)) for d in after}
    for d in analysis.ensemble.discrepancies:
        yield Statistic(**vars(d), extended=extended.get(d.statistic))


def _cause(analysis: Analysis, extension: Extension, k: int) -> NamedCause:
    attribution = analysis.attribution
    cause = attribution.causes[k]
    id = cause.candidate.id
    near = attribution.rivals[k]
    rivals = tuple(dict.fromkeys(r.id for r in near))[:_MOST_EQUIVALENT]
    words = CATALOGUE[id].words
    named = NamedCause(
        id=id,
        family=CATALOGUE[id].family,
        name=words.name,
        p_value=attribution.p_values[k],
        parameters={n: _estimate(v) for n, v in cause.parameters.items() if np.isfinite(v.value)},
        equivalent=rivals,
        separate_by=separate_by(id, rivals[0]) if rivals else None,
        gain=_result(extension.steps[k]),
        signature=shows_as(id, attribution.wide),
        remedy=words.remedy,
        separable_from_d=analysis.separations[k],
    )
    channels = tuple(r.channel for r in near if r.channel is not None)
    repair = CATALOGUE[id].repair
    values = {name: interval.value for name, interval in cause.parameters.items()}
    reported: dict[str, str | tuple[str, ...] | dict[str, float] | None] = {
        "probabilities": attribution.probabilities[k] if k < len(attribution.probabilities) else None,
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
        exam_rms_dph=extension.total.rms_after,
        centers=extension.centers,
        terms=tuple(e.id for e in terms_of(extension.shipped) if CATALOGUE[e.id].table is not None),
        model=None,
        gain=extension.total.result(),
        rate_left_out=None if left is None else WithoutRate(environment=left[0], **dict(left[1].result())),
        forward_in_time=None if extension.forward is None else extension.forward.result(),
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
    """What is left: how much of the structure the best cause holds, and where the rest lies."""
    attribution = analysis.attribution
    return Unexplained(
        share_explained=attribution.left.share,
        p_value=attribution.left.worst,
        best_partial_match=tuple(c.candidate.id for c in attribution.causes),
        looks_like=looks_like(attribution),
    )
