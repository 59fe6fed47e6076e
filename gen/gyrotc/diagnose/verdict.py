"""The verdict of a diagnosis, what is said of it in words, and what to do next.

A cause is named where its posterior says so (`holds`) and left-out history does not refute it. It is the explanation
where it has `SURE` in its place; below, what else remains possible is listed with the run that would decide.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from ..causes import CATALOGUE, separate_by
from ..results.diagnosed import (
    NOTHING,
    UNNAMED,
    DiagnosisVerdict,
    ExtendedModel,
    GainOnUnseen,
    NamedCause,
)
from .attribution import Attribution
from .candidates import searched, shape_parameter
from .discrepancy import NoiseFinding
from .single_cycle import Cycle
from .wide_memory import WideMemory

VERDICTS: dict[DiagnosisVerdict, str] = {
    "consistent": "The simulation agrees with the recordings. The detection limits say what could still hide.",
    "explained": "The causes listed account for what the simulation gets wrong.",
    "ambiguous": "These recordings do not decide between the causes listed and what else is listed as possible.",
    "partial": "A cause is named, and structure remains that it does not explain.",
    "noise_differs": "Only the noise is not what the simulation declares.",
    "unexplained": "There is structure that no cause of the catalogue explains: none is named.",
    "not_testable": "These recordings cannot decide.",
}

# p-value of what is left (`Misfit.worst`), and share of the structure below which the causes then explain too little.
# However clear the remainder: where four fifths are a cause and no other shape does better, it is that cause in another
# form than the catalogue's (relays in place of a play), and the remainder is reported beside it.
_MISFITS = ((0.05, 0.5), (0.01, 0.8))
_REMAINDER = 1e-3  # p-value of what is left below which "explained" would claim too much
_SEEN = 0.05  # p-value over the whole search that at least one of the causes has itself


def holds(attribution: Attribution) -> bool:
    """Test whether causes are named at all.

    They are not where most of the structure is none of them, where their families are not likelier than all else, where
    a parameter is one that no gyro has, where they make left-out history worse, and where the search sees none of them:
    something else was detected then.
    """
    left = attribution.left
    little = any(left.worst < p and left.share < share for p, share in _MISFITS)
    plausible = bool(attribution.causes) and all(cause.plausible for cause in attribution.causes)
    seen = min(attribution.p_values, default=1.0) <= _SEEN
    named = all(posterior.is_named for posterior in attribution.posteriors)
    return plausible and seen and not little and not attribution.refuted and named


def verdict_of(attribution: Attribution, noise: Sequence[NoiseFinding], cycle: Cycle | None = None) -> DiagnosisVerdict:
    """Return the verdict; where nothing can be decided before any search it is `not_testable` (`summary`).

    Args:
        attribution: What the search found, with the causes that are named.
        noise: Findings of the family `noise`.
        cycle: What a single chamber cycle tells, which has no posterior; None where there are more.
    """
    if cycle is not None and cycle.causes:
        return "ambiguous" if cycle.rivals else "partial"
    if cycle is not None and cycle.not_testable:
        return "not_testable"
    if holds(attribution):
        if attribution.left.p_value < _REMAINDER:
            return "partial"
        return "ambiguous" if any(posterior.remaining for posterior in attribution.posteriors) else "explained"
    if attribution.detected:
        return "unexplained"
    return "noise_differs" if noise else "consistent"


def meaning_of(verdict: DiagnosisVerdict, *, single_cycle: bool) -> str:
    """Return what a verdict means, in a sentence."""
    if verdict == "partial" and single_cycle:
        return "A memory of the temperature is named by a single cycle; nothing is shipped of it."
    return VERDICTS[verdict]


def looks_like(attribution: Attribution) -> str | None:
    """Return what structure without a name resembles: another shape, or a cause that cannot be, and why."""
    if attribution.other.lead > 0.0:
        return attribution.other.name
    if attribution.refuted:
        ids = " and ".join(cause.candidate.id.replace("_", " ") for cause in attribution.causes)
        return f"{ids}, which makes training history that was left out worse"
    for cause in attribution.causes:
        parameter = shape_parameter(cause.candidate.id)
        if parameter is not None and not cause.plausible:
            value = f"{parameter.name} = {cause.parameters[parameter.name].value:.2g} {parameter.unit}"
            known = f"{parameter.low:g} to {parameter.high:g} {parameter.unit} are known"
            return f"{cause.candidate.id.replace('_', ' ')} with {value}, where {known}"
    return None


_BY_ONE_CYCLE = "by a single cycle, which does not show whether it holds on the next one"

_WITHOUT_NAME = {UNNAMED: "an effect that is in no catalogue", NOTHING: "no effect, but chance"}

_REPEAT = "one profile twice: what repeats is memory or map, what does not is chance or an unrecorded input"

_STEPS: dict[DiagnosisVerdict, str] = {
    "consistent": "Nothing is needed. For lower detection limits record the programme of docs/howto-calibration.md.",
    "partial": f"Record {_REPEAT}. Record supply, discharge current, pressure and magnetic field beside the rate.",
    "noise_differs": "Declare the noise that was measured ([noise] of dataset.toml), or find out why it differs;"
    " then diagnose again: detection limits follow the noise.",
    "unexplained": f"Record {_REPEAT}. Record supply, discharge current, pressure and magnetic field beside the rate.",
    "not_testable": "Record ramps over the product's range of temperature, up and down, at two rates at least.",
}


def deciding_run(cause: str, rival: str) -> str:
    """Return the run to record in order to decide between a cause and what else is possible in its place."""
    return _REPEAT if rival in _WITHOUT_NAME else separate_by(cause, rival)


def next_steps(
    verdict: DiagnosisVerdict,
    causes: Sequence[NamedCause],
    untestable: Sequence[str],
    *,
    gain: GainOnUnseen | None,
    single_cycle: bool = False,
) -> list[str]:
    """Return what to do in sentences, the most telling first.

    Args:
        verdict: One of `VERDICTS`.
        causes: Causes and kinds of noise that were found.
        untestable: Ids of the causes that these recordings cannot test.
        gain: Of the extension that is shipped; None: none is.
        single_cycle: What is named comes from a single chamber cycle.
    """
    steps = [_decided_by(c) for c in causes if c.separate_by]
    if gain is not None and gain.shown == "gain":
        steps.append("Build with the extension (gyrotc build --extend).")
    elif gain is not None:
        steps.append("Build without the extension: runs that were not fitted to show no gain of it.")
    if verdict == "explained" and gain is None:
        remedies = dict.fromkeys(c.remedy for c in causes if c.family != "noise")
        steps.append(f"Against it: {'; '.join(remedies)}.")
    elif verdict == "partial" and single_cycle:
        steps.append("Record the same cycle at another rate: it shows whether what is named holds there.")
    elif verdict in _STEPS:
        steps.append(_STEPS[verdict])
    steps += [f"Paste {c.repair} into dataset.toml and build again." for c in causes if c.repair]
    named = [CATALOGUE[c.id].words for c in causes if c.id in CATALOGUE]
    steps += dict.fromkeys(words.advice for words in named if words.advice)
    missing = [text for i in untestable if (text := CATALOGUE[i].words.recording)]
    if missing and verdict != "not_testable":
        steps.append(f"To test what these recordings cannot: {'; '.join(missing)}.")
    return steps


def _decided_by(cause: NamedCause) -> str:
    """Return the run that separates a cause from its likeliest rival, and what the present runs can do."""
    rival, limits = cause.equivalent[0], cause.separable_from_d or {}
    now = f" The present runs separate them from d = {limits[rival]:.2g} on." if rival in limits else ""
    other = _WITHOUT_NAME.get(rival, rival.replace("_", " "))
    return f"To separate {cause.id.replace('_', ' ')} from {other}, record {cause.separate_by}.{now}"


def sentence_of(
    verdict: DiagnosisVerdict,
    found: Sequence[NamedCause],
    extended: ExtendedModel | None,
    undecided: str,
    wide: WideMemory | None = None,
    *,
    single_cycle: bool = False,
) -> str:
    """Return the finding in one to three sentences.

    Args:
        verdict: One of `VERDICTS`.
        found: Causes and kinds of noise that were found.
        extended: What is shipped.
        undecided: Why a single cycle cannot tell of memory.
        wide: The form of hysteresis that is among the causes, where it is more than one play.
        single_cycle: What is named comes from a single chamber cycle.
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
        "ambiguous": f"{names}; what else remains possible: {'; '.join(dict.fromkeys(_possible(causes)))}.",
        "partial": f"{names}, {_BY_ONE_CYCLE if single_cycle else 'and structure remains that no cause explains'}.",
        "noise_differs": f"{noise}.",
        "unexplained": "There is structure that no cause of the catalogue explains.",
        "not_testable": f"The recordings cannot decide{why}.",
    }[verdict]
    text += f" Here {wide.text}." if wide is not None else ""
    return text if extended is None else f"{text} {extended.gain.text}"


def shows_as(cause: str, wide: WideMemory | None) -> str:
    """Return how a cause shows; for hysteresis of a form beyond one play (`wide`) also the difference."""
    words = CATALOGUE[cause].words
    if wide is None or not searched(cause).loops:
        return words.signature
    return f"{words.signature}; here {wide.text}"


def _possible(causes: Sequence[NamedCause]) -> Iterator[str]:
    """Yield in words what remains possible in the place of each cause, with probabilities and channels."""
    for cause in causes:
        for id in cause.equivalent:
            share = (cause.probabilities or {}).get(id)
            likely = "" if share is None or id == cause.id else f" ({share:.0%})"
            if id in _WITHOUT_NAME:
                yield _WITHOUT_NAME[id] + likely
                continue
            channels = ", ".join(cause.equivalent_channels or ())
            yield CATALOGUE[id].words.name + (f" ({channels})" if CATALOGUE[id].needs.channel else "") + likely
