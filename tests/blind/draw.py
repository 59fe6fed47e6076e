"""What is drawn: strata of a blind run, campaigns, recordings. Everything follows from one seed."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from . import effects
from .campaign import Campaign, Hidden, Yardstick, draw_campaign, draw_recording
from .noise import Noise

STRESS = ("outliers", "variance_ramps", "variance_cold", "flicker", "quantum", "walk")
ALONE = tuple(effects.CATALOGUE)
PAIRS = (
    ("hysteresis", "warm_up"),
    ("hysteresis", "path_length_periodicity"),
    ("thermal_gradient", "turn_on_offset"),
    ("thermal_gradient", "warm_up"),
    ("path_length_periodicity", "ageing"),
    ("hysteresis", "auxiliary"),
    ("cavity_lag", "hysteresis"),
    ("turn_on_offset", "hysteresis"),
)


@dataclass(frozen=True)
class Order:
    """One recording to be made: stratum and what is hidden."""

    stratum: str
    wanted: tuple[tuple[str, float], ...]
    stress: str = ""


def orders(total: int, rng: np.random.Generator, weakest: float = 0.5) -> list[Order]:
    """The strata in their shares; of 640, more than 200 are clean, as the limit of false alarms asks.

    Args:
        total: Number of recordings, about.
        rng: Where the draws come from.
        weakest: Smallest k of a cause that is hidden alone.
    """
    out = []
    for _ in range(round(0.34 * total)):
        out.append(Order("clean", ()))
    for k in range(round(0.09 * total)):
        out.append(Order("stress", (), STRESS[k % len(STRESS)]))
    for k in range(round(0.02 * total)):
        del k
        out.append(Order("sensor lag", (), "sensor_lag"))
    for k in range(round(0.37 * total)):
        name = ALONE[k % len(ALONE)]
        out.append(Order("one", ((name, effects.log_uniform(rng, weakest, 6.0)),)))
    for k in range(round(0.07 * total)):
        pair = PAIRS[k % len(PAIRS)]
        out.append(Order("two", tuple((name, float(rng.uniform(2.5, 5.0))) for name in pair)))
    foreign = (*effects.FOREIGN, *effects.FOREIGN_RANDOM)
    for k in range(round(0.11 * total)):
        out.append(Order("foreign", ((foreign[k % len(foreign)], float(effects.log_uniform(rng, 2.0, 7.0))),)))
    return [out[k] for k in rng.permutation(len(out))]


def campaign_of(seed: int, number: int) -> tuple[Campaign, Yardstick]:
    """The number-th campaign of a run; paper-like and separating designs take turns."""
    rng = np.random.default_rng([seed, 1, number])
    design = "paper" if number % 2 == 0 else "separating"
    drop = int(rng.integers(0, 2)) if design == "paper" else 0
    campaign = draw_campaign(rng, design, exam=2, drop=drop)
    return campaign, Yardstick(campaign)


def recording_of(seed: int, number: int, order: Order, campaign: Campaign, yardstick: Yardstick) -> tuple[Hidden, bool]:
    """The number-th recording of a run, and whether its noise is declared."""
    rng = np.random.default_rng([seed, 2, number])
    white = float(np.exp(rng.uniform(np.log(4e-4), np.log(1.2e-3))))
    level = Noise(white, white * float(rng.uniform(0.0, 0.12)))
    stress = order.stress
    if stress == "flicker":
        level = Noise(white, white * float(rng.uniform(0.15, 0.3)))
    elif stress == "quantum":
        level = Noise(0.3 * white, 0.03 * white, 0.0, white * 240.0)
    elif stress == "walk":
        level = Noise(white, 0.0, white * 0.12)
    hidden = draw_recording(campaign, yardstick, list(order.wanted), level, rng, stress=stress)
    # Stress noise is not what the data set declares.
    if stress in ("flicker", "walk"):
        hidden.declared = Noise(white)
    return hidden, order.stratum != "stress" or rng.uniform() < 0.5
