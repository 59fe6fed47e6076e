"""From the ladder's choice to networks: trains the rung, refuses what must not be used, and says why it was chosen."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .data import Scaling, TrainingData
from .evidence import Process, TrainingFailed, fit_process
from .guard import objection
from .ladder import MAPS, RUNGS, YARDSTICKS, Ladder, climb
from .mrbf import fit_mrbf, fit_mrbf_t
from .result import Outcome
from .simple import fit_simple

__all__ = ["Chosen", "chosen_by_ladder"]

_STRUCTURE = 1.5  # a constant that leaves no more than this many times the noise has nothing to miss
NAMES = {
    "nothing": "no correction",
    "constant": "a constant",
    "linear": "a line in T",
    "cubic": "a cubic in T",
    "cubic_slope": "a cubic in T with a slope in dT/dt",
    "mrbf_t": "a map of T",
    "mrbf": "a map of T and dT/dt",
}


@dataclass(frozen=True, slots=True)
class Chosen:
    """The rung that is emitted: its name, networks, the table of all rungs, why, and what a user should know."""

    method: str
    outcome: Outcome
    rows: list[dict[str, Any]]
    reason: str
    findings: list[dict[str, Any]]


def chosen_by_ladder(
    samples: TrainingData,
    scaling: Scaling,
    power_on: NDArray[np.int64] | None,
    *,
    seed: int,
    average_s: float,
) -> Chosen:
    """Trains the rung that the ladder chooses; one that fails or must not be used makes way for the next choice.

    Args:
        samples: As `cleaned` returns them; their temperature spans at least 2 C.
        scaling: Scaling of these samples.
        power_on: Number of the power-on of each run, by its index; None: each run is one.
        seed: Seed of the Kohonen network.
        average_s: Averaging of RMS figures, s.
    """
    refused: dict[str, str] = {}
    process = None
    try:
        process = fit_process(samples, scaling)
    except TrainingFailed as failure:
        refused |= dict.fromkeys(MAPS, str(failure))
    ladder = climb(samples, scaling, process, power_on, average_s)
    while True:
        name = ladder.chosen(tuple(refused))
        try:
            outcome = _trained(name, samples, scaling, process, seed, average_s)
            against = objection(outcome, samples, scaling, average_s) if name != "constant" else ""
        except TrainingFailed as failure:
            against = str(failure)
        if not against:
            break
        refused[name] = against
    rows = [
        row | ({"refused": refused[row["id"]]} if row["id"] in refused else {}) for row in ladder.rows(name)
    ]
    findings = [_refusal(one, text) for one, text in refused.items()]
    misses = name == "constant" and _misses(samples, ladder)
    if misses:
        findings.insert(0, _does_not_generalise(ladder))
    return Chosen(name, outcome, rows, _reason(ladder, name, misses), findings)


def _trained(
    name: str, samples: TrainingData, scaling: Scaling, process: Process | None, seed: int, average_s: float
) -> Outcome:
    if name == "mrbf":
        return fit_mrbf(samples, scaling, seed=seed, centers=None, average_s=average_s, process=process)
    if name == "mrbf_t":
        return fit_mrbf_t(samples, scaling, seed=seed, centers=None, average_s=average_s)
    return fit_simple(name, samples, scaling, average_s)


def _misses(samples: TrainingData, ladder: Ladder) -> bool:
    """Whether a constant leaves more than noise on what it has not seen."""
    rms = ladder.rms_dph[:, RUNGS.index("constant")]
    return len(rms) == 0 or bool(np.sqrt(np.mean(rms**2)) > _STRUCTURE * ladder.noise_dph)


def _reason(ladder: Ladder, name: str, misses: bool) -> str:
    """Why this rung, in words."""
    tried = f"left out in turn: {', '.join(ladder.stretches()) or 'nothing, there is too little'}"
    if misses:
        return f"nothing is shown to be better than a constant on history that was not seen ({tried})"
    if name == "constant":
        return f"what varies is hardly more than noise ({tried})"
    if name in YARDSTICKS:
        text = "the best of a constant and cubics, than which nothing else is better by a standard error"
    else:
        text = "better than a constant and cubics by more than a standard error, or simpler where only noise is left"
    return f"{text} ({tried})"


def _does_not_generalise(ladder: Ladder) -> dict[str, Any]:
    """The finding, with its reason and what would help."""
    rms = (
        dict(zip(RUNGS, np.sqrt(np.mean(ladder.rms_dph**2, axis=0)), strict=True))
        if len(ladder.folds)
        else {}
    )
    able = {n: float(v) for n, v in rms.items() if n not in ("nothing", "constant") and np.isfinite(v)}
    text = (
        "No correction is shown to hold on thermal history that it has not seen, so the model is a constant."
    )
    evidence: dict[str, Any] = {"noise_dph": ladder.noise_dph, "stretches": ladder.stretches()}
    if able:
        best = min(able, key=lambda n: able[n])
        t, freedom = ladder.gain(best)
        text += (
            f" Left out in turn ({', '.join(ladder.stretches())}), a constant leaves {rms['constant']:.4g} deg/h and "
            f"{NAMES[best]} {able[best]:.4g}; t = {t:.2g} with {freedom} degrees of freedom is what chance gives, too."
        )
        evidence |= {"best": best, "best_rms_dph": able[best], "constant_rms_dph": float(rms["constant"])}
        evidence |= {"t": t, "degrees_of_freedom": freedom}
    return {"id": "does_not_generalise", "text": f"{text} {_advice(ladder)}", "evidence": evidence}


def _advice(ladder: Ladder) -> str:
    """Which recordings would help."""
    runs = len({fold.run for fold in ladder.folds if fold.kind == "run"})
    branches = sum(fold.kind == "branch" for fold in ladder.folds)
    if runs == 0 and branches == 0:
        return (
            "Record a cycle of temperature, up and down, at least three times, with a power-on before each."
        )
    if runs == 0:
        return "One run says nothing about another: record the same cycle at least twice more, after a power-on each."
    if branches == 0:
        return (
            "In each run temperature goes one way, so that it, its rate and time cannot be told apart: record runs "
            "that come back, and repeat them."
        )
    return "Repeat the runs with the same programme, after a power-on each: what repeats can be corrected."


def _refusal(name: str, text: str) -> dict[str, Any]:
    return {
        "id": "map_refused",
        "text": f"The ladder goes on without {NAMES[name]} ({name}): {text}.",
        "evidence": {"method": name, "reason": text},
    }
