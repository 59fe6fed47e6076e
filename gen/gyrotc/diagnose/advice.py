"""What the verdict means, and what to do next: the experiment that would tell more."""

from __future__ import annotations

from collections.abc import Sequence

from ..results.diagnosed import DiagnosisVerdict, NamedCause
from ..terms import CATALOGUE

__all__ = ["VERDICTS", "next_steps"]

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
    named = [CATALOGUE[c.id].words for c in causes if c.id in CATALOGUE]
    steps += dict.fromkeys(words.advice for words in named if words.advice)
    missing = [text for i in untestable if (text := CATALOGUE[i].words.recording)]
    if missing and verdict != "not_testable":
        steps.append(f"To test what these recordings cannot: {'; '.join(missing)}.")
    return steps
