"""A programmed profile as recordings without rates: what temperatures the runs will show, before they are run."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ..causes.base import History
from ..common.arrays import FloatArray
from ..common.errors import InputError
from ..diagnose.blocks import Record, Records, block_length
from ..diagnose.noise import Declared
from ..simulate.campaign import Noise, campaign, with_noise
from ..simulate.scenario import RunSet, Scenario, Thermometer, read

__all__ = ["NodeTemperatures", "Programme", "library", "node_temperatures", "programme_of"]


_BARE: dict[str, object] = {"cause": [], "channel": [], "thermometer": [], "difference": [], "laser": None}
"""What of a scenario is left out where the map alone is asked about."""
_ROW_CELLS = 10  # simulated seconds in a row
_AVERAGE_S = 100.0  # the paper's means, as `fit` has it where nothing else is asked for
_LIBRARY = "separating"  # its profiles are what is proposed besides a scenario's own


@dataclass(frozen=True)
class Programme:
    """Runs that are planned.

    Attributes:
        name: What the scenario is called.
        records: Temperatures as the sensor will show them; rates are the simulated bias without noise, deg/h.
        declared: Noise that the gyro is taken to have.
        hours: Length of every run, h.
        bias_range_dph: Lowest and highest bias of the simulated gyro, deg/h.
    """

    name: str
    records: Records
    declared: Declared
    hours: tuple[float, ...]
    bias_range_dph: tuple[float, float]


def programme_of(scenario: str | Path, *, noise: Noise, seed: int, added: Sequence[str] = ()) -> Programme:
    """The training runs of a scenario (all runs where none is for training), and further ones from the library.

    Args:
        scenario: Name of a scenario that comes with gyrotc, or a TOML file; its causes are left out.
        noise: Levels where the scenario gives none.
        seed: Draws the gyro's static map and the chamber's errors.
        added: Names of profiles that are run after the others, one a day.

    Raises:
        InputError: The scenario or a profile does not exist, or nothing is declared of the noise.
    """
    name, plan = read(scenario)
    plan = with_noise(plan, noise)
    if not plan.noise.arw_deg_per_sqrt_h:
        raise InputError(f"{scenario}, noise", "no angle random walk", "arw_deg_per_sqrt_h above 0")
    plan = _with_added(_training_only(plan), added)
    found = list(_records(plan, seed))
    bias = np.concatenate([r.rate_dph for r in found])
    levels = plan.noise
    return Programme(
        name=name,
        records=Records(tuple(found), block_length(found, _AVERAGE_S, _AVERAGE_S)),
        declared=Declared(
            levels.arw_deg_per_sqrt_h,
            levels.bias_instability_dph,
            levels.rate_random_walk_dph_per_sqrt_h,
            levels.quantum_arcsec,
        ),
        hours=tuple(r.history.time_s.size * r.row_s / 3600.0 for r in found),
        bias_range_dph=(float(bias.min()), float(bias.max())),
    )


@dataclass(frozen=True)
class NodeTemperatures:
    """True temperatures inside the gyro over the planned runs.

    Attributes:
        runs: Of every run the temperatures by node, C, as rows of `Programme.records`.
        sensor: The node of the gyro's own thermometer.
        there: Nodes that have a further thermometer.
    """

    runs: tuple[dict[str, FloatArray], ...]
    sensor: str
    there: frozenset[str]


def node_temperatures(scenario: str | Path, *, noise: Noise, seed: int) -> NodeTemperatures:
    """The nodes of the gyro over the runs of `programme_of`. Raises as that."""
    _, plan = read(scenario)
    there = frozenset(one.node for one in plan.thermometer)
    bare = _training_only(with_noise(plan, noise))
    asked = [Thermometer(name=f"at_{k}", node=node) for k, node in enumerate(plan.gyro.node)]
    runs = []
    for made in campaign(bare.model_copy(update={"thermometer": asked}), seed):
        n = made.reading_c.size // _ROW_CELLS * _ROW_CELLS
        runs.append({node: _rows(made.states[f"{node}_c"][:n]) for node in plan.gyro.node})
    return NodeTemperatures(tuple(runs), plan.sensor.node, there)


def library(scenario: str | Path) -> list[str]:
    """Profiles that can be added: the scenario's own, and those that are made to separate causes."""
    own, made = read(scenario)[1].profile, read(_LIBRARY)[1].profile
    return [*own, *(name for name in made if name not in own)]


def _training_only(plan: Scenario) -> Scenario:
    chosen = [s for s in plan.set if s.role == "train"] or list(plan.set)
    return plan.model_copy(update={"set": chosen, **_BARE})


def _with_added(plan: Scenario, added: Sequence[str]) -> Scenario:
    if not added:
        return plan
    profiles = {**read(_LIBRARY)[1].profile, **plan.profile}
    for name in added:
        if name not in profiles:
            raise InputError("profile", repr(name), ", ".join(profiles))
    last = plan.set[-1]
    further = RunSet(role=last.role, started=last.started, every_h=last.every_h, profiles=list(added))
    return plan.model_copy(update={"profile": profiles, "set": [*plan.set, further]})


def _records(plan: Scenario, seed: int) -> Iterator[Record]:
    names = [(name, s, k) for s in plan.set for k, name in enumerate(s.profiles)]
    first = min(s.started for s in plan.set)
    for number, ((name, run_set, k), made) in enumerate(zip(names, campaign(plan, seed), strict=True)):
        n = made.reading_c.size // _ROW_CELLS * _ROW_CELLS
        time_s = np.arange(0.0, n, _ROW_CELLS)
        history = History(
            time_s=time_s,
            temperature_c=_rows(made.reading_c[:n]),
            on_s=time_s - made.power_on_s,
            run=number,
            runs=len(names),
            day=(run_set.started - first).total_seconds() / 86400.0 + k * run_set.every_h / 24.0,
        )
        yield Record(name, history, _rows(made.bias_dph[:n]), np.ones(time_s.size, dtype=bool), name)


def _rows(values: FloatArray) -> FloatArray:
    return np.asarray(values.reshape(-1, _ROW_CELLS).mean(axis=1))
