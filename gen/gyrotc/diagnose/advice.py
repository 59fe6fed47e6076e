"""The finding in words, what the verdict means, and what to do next: the experiment that would tell more."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from ..causes import CATALOGUE
from ..results.diagnosed import DiagnosisVerdict, ExtendedModel, NamedCause
from .candidates import searched
from .wide_memory import WideMemory

__all__ = ["VERDICTS", "next_steps", "sentence_of", "shows_as"]

_WHOLE = 0.995  # a share of the removable error that shows as 100 %

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
    "consistent": "Nothing is needed. For lower detection limits see what gyrotc plan says of a longer or livelier"
    " profile.",
    "explained": "Build with the extension (gyrotc build --extend), or mend the cause and record again.",
    "partial": "Run one profile twice: what repeats is memory or map, what does not is noise or an unrecorded input."
    " Record supply, discharge current, pressure and magnetic field beside the rate.",
    "noise_differs": "Declare the noise that was measured ([noise] of dataset.toml), or find out why it differs;"
    " then diagnose again: detection limits follow the noise.",
    "unexplained": "Run one profile twice: what repeats is memory or map, what does not is noise or an unrecorded"
    " input. Record supply, discharge current, pressure and magnetic field beside the rate.",
    "not_testable": "Record ramps over the product's range of temperature, up and down, at two rates at least.",
}


def next_steps(
    verdict: DiagnosisVerdict, causes: Sequence[NamedCause], untestable: Sequence[str], *, shipped: bool
) -> list[str]:
    """Sentences, the most telling first.

    Args:
        verdict: One of `VERDICTS`.
        causes: Causes and kinds of noise that were found.
        untestable: Ids of the causes that these recordings cannot test.
        shipped: Whether an extension is.
    """
    steps = [f"To tell them apart: {c.separate_by}." for c in causes if c.separate_by]
    if verdict == "explained" and not shipped:
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


def sentence_of(
    verdict: DiagnosisVerdict,
    found: Sequence[NamedCause],
    extended: ExtendedModel | None,
    undecided: str,
    wide: WideMemory | None = None,
) -> str:
    """The finding in one to three sentences.

    Args:
        undecided: Why a single cycle cannot tell of memory.
        wide: The form of hysteresis that is among the causes, where it is more than one play.
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
        "ambiguous": f"{names}, or equally well: {', '.join(_rivals(causes))}.",
        "partial": f"{names}, and structure remains that no cause explains.",
        "noise_differs": f"{noise}.",
        "unexplained": "There is structure that no cause of the catalogue explains.",
        "not_testable": f"The recordings cannot decide{why}.",
    }[verdict]
    text += f" Here {wide.text}." if wide is not None else ""
    share = extended.gain.share_of_excess_removed if extended is not None else None
    if share is None:
        return text
    amount = "all" if share >= _WHOLE else f"{share:.0%}"
    return f"{text} On unseen runs the extension removes {amount} of the removable error."


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
