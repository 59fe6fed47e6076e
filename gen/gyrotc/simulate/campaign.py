"""The runs of a scenario, simulated one after the other with a gyro that a seed draws."""

from __future__ import annotations

from collections.abc import Iterator
from datetime import timedelta
from typing import Any, Literal

import numpy as np

from ..common.errors import InputError
from .bias_map import BiasMap, draw_map
from .record import SimulatedRecord, record
from .scenario import NoiseLevels, Scenario

NoiseName = Literal["paper", "class"]

NOISE: dict[str, NoiseLevels] = {
    # 7e-4 deg/h of 100-s means, what Ding et al. 2014 report after compensation
    "paper": NoiseLevels(arw_deg_per_sqrt_h=7e-4 * (100.0 / 3600.0) ** 0.5),
    # a dithered unit of the 0.008 deg/h class: 0.012 deg/h of 100-s means
    "class": NoiseLevels(
        arw_deg_per_sqrt_h=2e-3, bias_instability_dph=1e-3, rate_random_walk_dph_per_sqrt_h=2e-4, quantum_arcsec=0.5
    ),
}
"""Levels of the noise by name, for what a scenario does not give itself."""


def with_noise(plan: Scenario, noise: NoiseName) -> Scenario:
    """Return the scenario with the named levels wherever it does not give its own.

    Raises:
        InputError: no levels have this name.
    """
    if noise not in NOISE:
        raise InputError("noise", str(noise), ", ".join(NOISE))
    own = {key: getattr(plan.noise, key) for key in plan.noise.model_fields_set}
    return plan.model_copy(update={"noise": NOISE[noise].model_copy(update=own)})


def simulate_campaign(plan: Scenario, seed: int) -> Iterator[SimulatedRecord]:
    """Simulate the runs of a scenario with the gyro that a seed draws, one after the other.

    Raises:
        InputError: the seed is negative.
    """
    return records(plan, gyro_map(plan, seed), noise_seeds(seed))


def records(plan: Scenario, bias_map: BiasMap, seeds: np.random.SeedSequence) -> Iterator[SimulatedRecord]:
    """Simulate the runs of a scenario with a given map, one after the other."""
    runs = planned_runs(plan)
    first = min(run["started"] for run in runs)
    for run, child in zip(runs, seeds.spawn(len(runs)), strict=True):
        day = (run["started"] - first) / timedelta(days=1)
        yield record(plan, plan.profile[run["environment"]], bias_map, day, child)


def planned_runs(plan: Scenario) -> list[dict[str, Any]]:
    """List the runs of a scenario in order: role, environment and start of each."""
    return [
        {
            "role": run_set.role,
            "environment": name,
            "started": run_set.started + timedelta(hours=index * run_set.every_h),
        }
        for run_set in plan.set
        for index, name in enumerate(run_set.profiles)
    ]


def gyro_map(plan: Scenario, seed: int) -> BiasMap:
    """Draw the static map of a gyro; a seed gives the same one in every scenario of the same bias range."""
    return draw_map(np.random.default_rng(_seeds(seed)[0]), plan.gyro.bias_dph)


def noise_seeds(seed: int) -> np.random.SeedSequence:
    """Return the seeds of the noise of all runs of a gyro."""
    return _seeds(seed)[1]


def _seeds(seed: int) -> list[np.random.SeedSequence]:
    if seed < 0:
        raise InputError("seed", str(seed), "0 or more")
    return np.random.SeedSequence(seed).spawn(2)
