"""Does the uncertainty of a correction hold? True bias less correction, in units of the sigma of its snapshot.

Gyros that nothing was tuned on; the table's answers are those of the reference, which are those of the compiled code
bit for bit (tests/py/target/test_sigma.py).
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from typing import Any

import numpy as np
from gyrotc.model import Term
from gyrotc.target.history import replay
from gyrotc.target.status import CLAMPED, FALLBACK, HELD, UNCOVERED, WARMING
from numpy.typing import NDArray
from scipy.special import ndtr

from .sigma_gyros import Gyro, gyro

__all__ = ["CAMPAIGNS", "STATES", "Campaign", "coverage", "departures", "pooled"]

Floats = NDArray[np.float64]
Say = Callable[[str], None]

STATES = ("all", "plain", "held", "clamped", "clamped near the edge", "uncovered", "warming", "fallen back")
_NEAR_C = 1.0  # beyond the envelope, where what a gradient adds is small beside the map's own error
FIRST_SEED = 100_000  # of gyros that nothing was tuned on
_LONGEST_GAP = 30  # blocks; a table's correction is held for so long
_STARTS = 8  # in each run
_SHORT = 24  # blocks that are looked at after a start

_NARROW = """
extends = "paper"
title = "Calibrated over a part of the range only"
[profile."inner"]
start_c = 10.0
power_on_min = 60
record_from_min = 60
record_min = 480
steps = [{hold_min = 60}, {repeat = [
  {ramp_to_c = 45.0, c_per_min = 3.0}, {hold_min = 60}, {ramp_to_c = -25.0, c_per_min = 3.0}, {hold_min = 60},
]}]
[profile."inner slow"]
start_c = 10.0
power_on_min = 60
record_from_min = 60
record_min = 480
steps = [{hold_min = 60}, {repeat = [
  {ramp_to_c = 45.0, c_per_min = 1.0}, {hold_min = 60}, {ramp_to_c = -25.0, c_per_min = 1.0}, {hold_min = 60},
]}]
[[set]]
role = "train"
started = 2026-03-02T08:00:00Z
profiles = ["20 C", "inner", "inner slow"]
[[set]]
role = "exam"
started = 2026-03-16T08:00:00Z
profiles = ["20 C", "1 C/min", "3 C/min", "5 C/min"]
"""
_GAPS = """
extends = "paper"
title = "Calibrated without one rate and without the warm hold"
[[set]]
role = "train"
started = 2026-03-02T08:00:00Z
profiles = ["20 C", "-40 C", "1 C/min", "5 C/min"]
[[set]]
role = "exam"
started = 2026-03-16T08:00:00Z
profiles = ["20 C", "-40 C", "60 C", "1 C/min", "3 C/min", "5 C/min"]
"""
_MEMORY = """
extends = "separating"
title = "With a gradient"
[[cause]]
id = "thermal_gradient"
tau_s = 900.0
amplitude_dph_per_c = 1e-4
"""
_PLAY = """
extends = "separating"
title = "With hysteresis"
[[cause]]
id = "hysteresis"
width_c = 6.0
amplitude_dph_per_c = 1e-4
"""


@dataclass(frozen=True, slots=True)
class Campaign:
    """A scenario, terms that are in the table as they were planted, and how many gyros of it are looked at."""

    name: str
    scenario: str
    terms: tuple[Term, ...] = ()
    gyros: int = 24


CAMPAIGNS = (
    Campaign("the paper's environments", "paper", gyros=60),
    Campaign("holds from both sides, loops, cold starts", "separating"),
    Campaign("calibrated over a part of the range", _NARROW),
    Campaign("calibrated without one rate and one hold", _GAPS),
    Campaign(
        "with a gradient",
        _MEMORY,
        (Term(id="thermal_gradient", parameters={"tau_s": 900.0, "amplitude_dph_per_c": 1e-4}),),
    ),
    Campaign(
        "with hysteresis",
        _PLAY,
        (Term(id="hysteresis", parameters={"width_c": 6.0, "amplitude_dph_per_c": 1e-4}),),
    ),
)


def departures(unit: Gyro, seed: int) -> dict[str, tuple[Floats, Floats]]:
    """Error and 1 sigma, deg/h, of every block of a gyro's exam, by state.

    Each run is replayed whole, then with outages of random length, and started anew at random places.
    """
    rng = np.random.default_rng(seed)
    found: dict[str, list[tuple[Floats, Floats]]] = {state: [] for state in STATES}
    for run in unit.exam:
        n = len(run.temperature_c)
        _add(found, unit, run.temperature_c, run.bias_dph)
        _add(found, unit, _with_outages(run.temperature_c, rng), run.bias_dph, ("held", "fallen back"))
        for start in rng.integers(0, n - _SHORT, _STARTS).tolist():
            part = slice(start, start + _SHORT)
            _add(found, unit, run.temperature_c[part], run.bias_dph[part], ("warming",))
    return {
        state: (np.concatenate([e for e, _ in parts]), np.concatenate([s for _, s in parts]))
        for state, parts in found.items()
        if parts
    }


def _with_outages(temperature: Floats, rng: np.random.Generator) -> Floats:
    """Blocks of missing temperatures, one to twice as many as are held, then as many again and more that are there."""
    outages = temperature.copy()
    at = 15
    while at < len(temperature):
        length = int(rng.integers(1, _LONGEST_GAP + 1)) * (2 if rng.random() < 0.1 else 1)
        outages[at : at + length] = np.nan
        at += length + int(rng.integers(20, 60))
    return outages


def _add(
    found: dict[str, list[tuple[Floats, Floats]]],
    unit: Gyro,
    temperature: Floats,
    truth: Floats,
    only: Sequence[str] = STATES,
) -> None:
    """The blocks of one replay, by the state of their correction; `all` has those of whole runs."""
    table = unit.table
    words = table.encode_inputs(temperature[:, None])
    steps = replay(table, words, missed=np.zeros(len(words), dtype=np.int64), samples_per_block=1)
    assert steps.sigma is not None
    error = truth - table.decode_bias(steps.bits)
    sigma = table.decode_bias(steps.sigma)
    held = (steps.status & HELD) != 0
    fallen = (steps.status & FALLBACK) != 0
    warming = (steps.status & WARMING) != 0
    clamped = (steps.status & CLAMPED) != 0
    uncovered = (steps.status & UNCOVERED) != 0
    low, high = unit.model.envelope.temperature_c
    near = (temperature > low - _NEAR_C) & (temperature < high + _NEAR_C)
    masks = {
        "all": np.ones(len(error), dtype=bool),
        "plain": steps.status == 0,
        "held": held & ~fallen & (steps.age > 0),
        "clamped": clamped & ~held & ~warming,
        "clamped near the edge": clamped & ~held & ~warming & near,
        "uncovered": uncovered & ~clamped & ~held & ~warming,
        "warming": warming & ~held,
        "fallen back": fallen,
    }
    for state in only:
        if masks[state].any():
            found[state].append((error[masks[state]], sigma[masks[state]]))


def coverage(say: Say, gyros: float = 1.0, workers: int | None = None) -> dict[str, Any]:
    """Figures of every campaign and of all together.

    Args:
        gyros: Scales their numbers.
        workers: Processes; None: as many as there are processors.
    """
    rows, every = [], {state: [] for state in STATES}
    with ProcessPoolExecutor(workers) as pool:
        for number, campaign in enumerate(CAMPAIGNS):
            parts: list[dict[str, tuple[Floats, Floats]]] = []
            count = max(1, round(gyros * campaign.gyros))
            seeds = range(FIRST_SEED + 1000 * number, FIRST_SEED + 1000 * number + count)
            for seed, part in zip(seeds, pool.map(_looked_at, [campaign] * count, seeds), strict=True):
                say(f"{campaign.name}, gyro {seed}")
                parts.append(part)
            rows.append({"campaign": campaign.name, "gyros": count, "states": pooled(parts)})
            for part in parts:
                for state, pair in part.items():
                    every[state].append({state: pair})
    total = {state: pooled(parts)[state] for state, parts in every.items() if parts}
    return {"campaigns": rows, "together": {"gyros": sum(r["gyros"] for r in rows), "states": total}}


def _looked_at(campaign: Campaign, seed: int) -> dict[str, tuple[Floats, Floats]]:
    return departures(gyro(campaign.scenario, seed, terms=campaign.terms), seed)


def pooled(parts: Sequence[dict[str, tuple[Floats, Floats]]]) -> dict[str, dict[str, float]]:
    """By state: gyros, blocks, share within 1 and 2 sigma, normalised squared error with its standard error.

    `normal_1`, `normal_2`: the shares that normal errors would have, of which each gyro's have its own squared error;
    `low`, `high`: what RMS errors over 1 sigma 10 and 90 % of the gyros stay below.
    """
    return dict(_pooled(parts))


def _pooled(parts: Sequence[dict[str, tuple[Floats, Floats]]]) -> Iterator[tuple[str, dict[str, float]]]:
    for state in STATES:
        ratios = [error / sigma for error, sigma in (p[state] for p in parts if state in p)]
        if not ratios:
            continue
        z = np.concatenate(ratios)
        weight = np.array([len(r) for r in ratios]) / len(z)
        spread = {
            "within_1": np.array([np.mean(np.abs(r) < 1.0) for r in ratios]),
            "within_2": np.array([np.mean(np.abs(r) < 2.0) for r in ratios]),
            "squared": np.array([np.mean(r**2) for r in ratios]),
        }
        level = np.sqrt(spread["squared"])
        row: dict[str, float] = {"gyros": len(ratios), "blocks": len(z)}
        row |= {f"normal_{k}": float(weight @ (2.0 * ndtr(k / level) - 1.0)) for k in (1, 2)}
        row |= dict(zip(("low", "high"), np.quantile(level, (0.1, 0.9)).tolist(), strict=True))
        for name, values in spread.items():
            mean = float(weight @ values)
            row[name] = mean
            row[f"{name}_se"] = float(np.sqrt(np.sum(weight**2 * (values - mean) ** 2)))
        yield state, row
