"""Planned runs: detection limits, accuracy of the map, and which causes can be distinguished.

Everything follows from whitened inner products of map and signatures, one matrix for each run: those of a
choice of runs are their sum.

d from which A can be distinguished from B: √(10/(1 − R²)), R² the share of A's signature that B can mimic beside the
map (docs/diagnosis.md).
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from ..causes.base import History
from ..common.arrays import FloatArray
from ..common.errors import InputError
from ..common.statistics import orthonormal
from ..diagnose.blocks import Records, RunRecord, block_length, singled_out
from ..diagnose.candidates import Candidate, columns_of, planned, searched, shape_parameter
from ..diagnose.detection import CauseLimit, amplitude_energy, limit_of
from ..diagnose.noise import NOISE_COLOURS, Declared, Whitener
from ..diagnose.profile_likelihood import Gains
from ..diagnose.search import Search, open_search
from ..diagnose.signature_bank import SignatureBank, bank_of
from ..simulate.campaign import NoiseName, simulate_campaign, with_noise
from ..simulate.scenario import RunSet, Scenario, Thermometer, read

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


def programme_of(scenario: str | Path, *, noise: NoiseName, seed: int, added: Sequence[str] = ()) -> Programme:
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


def node_temperatures(scenario: str | Path, *, noise: NoiseName, seed: int) -> NodeTemperatures:
    """The nodes of the gyro over the runs of `programme_of`. Raises as that."""
    _, plan = read(scenario)
    there = frozenset(one.node for one in plan.thermometer)
    bare = _training_only(with_noise(plan, noise))
    asked = [Thermometer(name=f"at_{k}", node=node) for k, node in enumerate(plan.gyro.node)]
    runs = []
    for made in simulate_campaign(bare.model_copy(update={"thermometer": asked}), seed):
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


def _records(plan: Scenario, seed: int) -> Iterator[RunRecord]:
    names = [(name, s, k) for s in plan.set for k, name in enumerate(s.profiles)]
    first = min(s.started for s in plan.set)
    for number, ((name, run_set, k), made) in enumerate(zip(names, simulate_campaign(plan, seed), strict=True)):
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
        yield RunRecord(name, history, _rows(made.bias_dph[:n]), np.ones(time_s.size, dtype=bool), name)


def _rows(values: FloatArray) -> FloatArray:
    return np.asarray(values.reshape(-1, _ROW_CELLS).mean(axis=1))


_RIDGE = 1e-9  # of the strongest map function: what a choice of runs does not visit stays undetermined


class Sensitivity:
    """Inner products of everything for every run of a programme.

    Attributes:
        search: The search that these runs will have, without noise in its data; its noise scale is the declared.
        sigma: Standard deviation of the white part of block means, deg/h.
    """

    def __init__(self, programme: Programme) -> None:
        self.programme = programme
        records = programme.records
        colour = programme.declared.colour(records.block_s)
        self.sigma = float(np.sqrt(colour.white))
        factor = 1.0 / colour.white
        relative = replace(
            colour,
            white=colour.white * factor,
            slow=colour.slow * factor,
            walk=colour.walk * factor,
            quantum=colour.quantum * factor,
        )
        self.bank: SignatureBank = bank_of(records, 0)
        search = open_search(records, self.bank, records.target(), declared=relative, colours=(len(NOISE_COLOURS),))
        self.search = replace(search, views={search.best: replace(search.likeliest, scale=self.sigma)})
        self.candidates, columns, self.at = _columns(self.search)
        whiten = Whitener(relative, records.kept, records.block_s)
        white = whiten(np.column_stack([self.bank.map, columns])) / self.sigma
        self.grams = np.array([white[s].T @ white[s] for s in records.spans()])

    def limits(self, runs: Sequence[int] | None = None) -> dict[str, CauseLimit]:
        """Detection limits of every cause for a choice of runs (with repetitions; None: all, once)."""
        energy = self._energies(range(len(self.grams)) if runs is None else runs)
        points: dict[str, list[tuple[Candidate, float]]] = {}
        for candidate, at in zip(self.candidates, self.at, strict=True):
            part = energy[at]
            amount = amplitude_energy(candidate.id, part)
            points.setdefault(candidate.id, []).append((candidate, max(amount, 0.0)))
        return {id: limit_of(id, p) for id, p in points.items()}

    def _energies(self, runs: Sequence[int]) -> FloatArray:
        """d² of every column at unit amplitude after the map is taken out, shape (K,)."""
        gram = self.grams[list(runs)].sum(axis=0)
        m = self.bank.map.shape[1]
        inner, cross = gram[:m, :m], gram[:m, m:]
        held = np.linalg.solve(inner + _RIDGE * np.diag(inner).max() * np.eye(m), cross)
        return np.asarray(np.diag(gram)[m:] - (cross * held).sum(axis=0))

    def map_error(self, runs: Sequence[int]) -> float:
        """RMS error of the map over all planned temperatures and rates, fitted to a choice of runs, deg/h.

        What these do not determine is as uncertain as the simulated bias is wide.
        """
        m = self.bank.map.shape[1]
        y = self.search.y
        prior = y.size * float(np.var(y)) / m
        spread = np.linalg.inv(self.grams[list(runs)].sum(axis=0)[:m, :m] + np.eye(m) / prior)
        return float(np.sqrt(np.trace(spread) / y.size))


def _columns(search: Search) -> tuple[list[Candidate], FloatArray, list[slice]]:
    """Signatures at unit amplitude (for changed inputs: the change of the map), and where each candidate's lie."""
    bank = search.bank
    raw = bank.signatures * bank.scale + bank.map @ (bank.on_map * bank.scale)
    candidates, blocks, at = [], [], []
    start = 0
    for group in bank.groups:
        if group.candidate.id not in planned():
            continue
        block = raw[:, group.columns]
        candidates.append(group.candidate)
        blocks.append(block)
        at.append(slice(start, start + block.shape[1]))
        start += block.shape[1]
    weights = search.map_weights()
    for candidate, replaced, known in zip(bank.inputs, bank.replaced, bank.known, strict=True):
        candidates.append(candidate)
        blocks.append(np.where(known, (replaced - bank.map) @ weights, 0.0)[:, None])
        at.append(slice(start, start + 1))
        start += 1
    return candidates, np.column_stack(blocks), at


_D_LIMIT = 6.0  # about where most causes are found (`causes.base.SearchRule.needed_d`)
_LEAST = 1e-3  # 1 − R² below which nothing distinguishes the two


@dataclass(frozen=True)
class Row:
    """A cause at one value of its parameter, and d from which it can be distinguished from every other cause."""

    id: str
    parameter: str | None
    value: float | None
    d: dict[str, float]


def separability(sensitivity: Sensitivity, only: Sequence[str] | None = None) -> list[Row]:
    """A row for every cause that these runs can test (`only`: for these)."""
    gains = Gains(sensitivity.search)
    shown = [c for c in _shown(sensitivity) if only is None or c.id in only]
    total = gains.whiten(np.column_stack([_fitted(sensitivity, c, gains) for c in shown]))
    static = gains.whiten(_static(sensitivity))[:, None]
    added = total - static
    own = added - gains.map_q @ (gains.map_q.T @ added)
    energy = (own**2).sum(axis=0)
    best: list[dict[str, float]] = [{} for _ in shown]
    for id, share in (*_by_columns(gains, own, energy), *_by_inputs(gains, total, energy)):
        for k in range(len(shown)):
            best[k][id] = max(best[k].get(id, 0.0), float(share[k]))
    rows = []
    for candidate, shares in zip(shown, best, strict=True):
        parameter = shape_parameter(candidate.id)
        rows.append(
            Row(
                candidate.id,
                parameter.name if parameter else None,
                candidate.values[parameter.name] if parameter else None,
                {i: float(np.sqrt(10.0 / max(1.0 - s, _LEAST))) for i, s in shares.items() if i != candidate.id},
            )
        )
    return rows


def _shown(sensitivity: Sensitivity) -> Iterator[Candidate]:
    """Candidates of the search nearest to the values shown."""
    for id in planned():
        same = [c for c in sensitivity.candidates if c.id == id]
        parameter = shape_parameter(id)
        if parameter is None:
            yield from same[:1]
            continue
        for value in searched(id).shown if same else ():
            yield min(same, key=lambda c: abs(c.values[parameter.name] - value))


def _fitted(sensitivity: Sensitivity, candidate: Candidate, gains: Gains) -> FloatArray:
    """Map of the simulated gyro with the cause at d = 6, shape (N,); a changed input as it is."""
    search = sensitivity.search
    if candidate.role == "input":
        replaced = search.bank.replaced[search.bank.inputs.index(candidate)]
        return np.asarray(replaced @ search.map_weights())
    columns = columns_of(search.records, candidate.id, candidate.values)
    signature = columns @ np.random.default_rng(1).standard_normal(columns.shape[1])
    white = gains.whiten(signature)
    own = white - gains.map_q @ (gains.map_q.T @ white)
    return np.asarray(_static(sensitivity) + signature * (_D_LIMIT * gains.scale / np.linalg.norm(own)))


def _static(sensitivity: Sensitivity) -> FloatArray:
    """The simulated gyro's map as the search's own map holds it, shape (N,)."""
    search = sensitivity.search
    return np.asarray(search.bank.map @ search.map_weights())


def _by_columns(gains: Gains, own: FloatArray, energy: FloatArray) -> Iterator[tuple[str, FloatArray]]:
    """Share of each signature that every candidate with columns of its own holds."""
    for candidate, at in (*gains.plain, *gains.random):
        q = orthonormal(gains.plain_columns(at))
        yield candidate.id, ((q.T @ own) ** 2).sum(axis=0) / energy


def _by_inputs(gains: Gains, total: FloatArray, energy: FloatArray) -> Iterator[tuple[str, FloatArray]]:
    """The same for the map of other inputs."""
    bank = gains.search.bank
    seen: Counter[str] = Counter()
    for candidate, replaced, known in zip(bank.inputs, bank.replaced, bank.known, strict=True):
        seen[candidate.id] += 1
        if seen[candidate.id] % searched(candidate.id).rival_every:
            continue
        unknown = [] if known.all() else [gains.whiten(singled_out(~known))]
        q = orthonormal(gains.whiten(replaced), *unknown)
        rest = (total**2).sum(axis=0) - ((q.T @ total) ** 2).sum(axis=0)
        yield candidate.id, np.maximum(1.0 - rest / energy, 0.0)


def additions(
    scenario: str | Path, pair: tuple[str, str], *, noise: NoiseName, seed: int
) -> list[tuple[str, float, float]]:
    """Profiles by how far one run more of them brings the d at which two causes part, best first.

    Returns:
        Name, hours of the run, and the larger d of the two directions; the first entry is the programme as it
        is, named "".

    Raises:
        InputError: A cause has no row in the table of separability.
    """
    for id in pair:
        if id not in planned():
            raise InputError("--separate", repr(id), ", ".join(planned()))
    found = []
    for name in ("", *library(scenario)):
        programme = programme_of(scenario, noise=noise, seed=seed, added=[name] if name else [])
        rows = separability(Sensitivity(programme), only=pair)
        d = [r.d[o] for r in rows for o in pair if o != r.id and o in r.d]
        if d:
            found.append((name, programme.hours[-1] if name else 0.0, max(d)))
    return [*found[:1], *sorted(found[1:], key=lambda entry: entry[2])]
