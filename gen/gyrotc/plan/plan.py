"""`gyrotc plan`: what a programmed profile will be able to show, before the chamber is booked.

A part of the bias that follows T_node − T_sensor shows by what no map of (T, dT/dt) and no thermometer that is there
already can hold of that difference. The amplitude that is found in 95 % of cases has d = 6 (docs/diagnosis.md).

The temperatures come from the simulation of chamber and gyro, the rest from the search that `diagnose` would
make on them: detection limits, separability, how well the map will be known after how many hours.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path

import numpy as np

from .. import __version__
from ..causes import CATALOGUE, separate_by
from ..common.errors import InputError
from ..common.statistics import orthonormal
from ..diagnose.blocks import RunRecord
from ..diagnose.candidates import searched
from ..diagnose.profile_likelihood import Gains
from ..results.recordings import (
    Accuracy,
    Additions,
    AssumedNoise,
    DetectionLimit,
    Hard,
    Plan,
    PlanLimit,
    PlannedRun,
    Separability,
    Shortest,
    Temperature,
    ThermometerPlace,
    TriedRun,
)
from ..simulate.campaign import NoiseName
from .sensitivity import Row, Sensitivity, additions, node_temperatures, programme_of, separability

__all__ = ["places", "plan", "shortest"]

_MOST_RUNS = 60  # bounds the search
_UNSEEN = 1e3  # times the required limit: what counts for a cause that would not be seen at all


def shortest(sensitivity: Sensitivity, required: Mapping[str, float]) -> Shortest:
    """Adds the run that helps most for its hours, until every limit is reached; no runs where no number of them does.

    Args:
        sensitivity: Belongs to the programme whose runs may be used, each as often as needed.
        required: Limits by cause, in the unit of its limit.

    Raises:
        InputError: A cause is unknown or cannot be tested by these runs.
    """
    known = sensitivity.limits()
    for id in required:
        if id not in known:
            raise InputError("--require", repr(id), ", ".join(known))
    hours = sensitivity.programme.hours
    chosen: list[int] = []
    now = _distance(sensitivity, chosen, required)
    while now > 0.0 and len(chosen) < _MOST_RUNS:
        after = [_distance(sensitivity, [*chosen, k], required) for k in range(len(hours))]
        best = max(range(len(hours)), key=lambda k: ((now - after[k]) / hours[k], -chosen.count(k)))
        chosen.append(best)
        now = after[best]
    for k in sorted(chosen, key=lambda k: -hours[k]) if now <= 0.0 else ():
        rest = [*chosen]
        rest.remove(k)
        if _distance(sensitivity, rest, required) == 0.0:  # what a later run has made needless
            chosen = rest
    names = [run.name for run in sensitivity.programme.records.runs]
    return Shortest(
        required=dict(required),
        runs=None if now > 0.0 else tuple(names[k] for k in chosen),
        hours=None if now > 0.0 else sum(hours[k] for k in chosen),
        reached=_values(sensitivity, chosen, required),
    )


def _values(sensitivity: Sensitivity, runs: list[int], required: Mapping[str, float]) -> dict[str, float | None]:
    if not runs:
        return dict.fromkeys(required)
    limits = sensitivity.limits(runs)
    return {id: limits[id].value for id in required}


def _distance(sensitivity: Sensitivity, runs: list[int], required: Mapping[str, float]) -> float:
    """Sum of the logarithms by which limits are above what is required; 0 when all are reached."""
    values = _values(sensitivity, runs, required)
    return sum(float(np.log(_UNSEEN if v is None else max(v / required[id], 1.0))) for id, v in values.items())


_D_FOUND = 6.0  # about where most causes are found, as in `sensitivity`
_LEAST_C = 1e-4  # no thermometer tells less than this


def places(scenario: str | Path, sensitivity: Sensitivity, *, noise: NoiseName, seed: int) -> list[ThermometerPlace]:
    """Every node but the sensor's own, the most telling first.

    Raises:
        InputError: The scenario's gyro has no other node.
    """
    found = node_temperatures(scenario, noise=noise, seed=seed)
    if len(found.runs[0]) < 2:
        raise InputError(f"{scenario}, gyro.node", "one node", "further nodes, where a thermometer could be")
    records = sensitivity.programme.records
    differences = {
        node: records.average([run[node] - run[found.sensor] for run in found.runs])
        for node in found.runs[0]
        if node != found.sensor
    }
    gains = Gains(sensitivity.search)
    there = [node for node in differences if node in found.there]
    ranked = []
    for node, column in differences.items():
        others = [differences[o] for o in there if o != node]
        white, plain = gains.whiten(column), column - column.mean()
        q = orthonormal(gains.map, *([gains.whiten(np.column_stack(others))] if others else []))
        own = white - q @ (q.T @ white)
        held = np.column_stack([sensitivity.bank.map, *others, np.ones(len(column))])
        rest = column - held @ np.linalg.lstsq(held, column, rcond=1e-9)[0]
        unseen = float(np.sqrt(np.mean(rest**2)))
        norm = float(np.linalg.norm(own)) / gains.scale
        limit = _D_FOUND / norm if unseen > _LEAST_C else None
        ranked.append(
            ThermometerPlace(
                node=node,
                there=node in there,
                difference_c=float(np.sqrt(np.mean(plain**2))),
                unseen_c=unseen,
                limit_dph_per_c=limit,
            )
        )
    return sorted(ranked, key=lambda place: (place.there, place.limit_dph_per_c or np.inf))


_AVERAGE_S = 100.0  # the paper's means, as `fit` has it where nothing else is asked for
_PICTURE_POINTS = 200  # of a run: as many as a picture a few centimetres wide shows
_HARD = 10.0  # d above which two causes count as hard to separate


def plan(
    scenario: str | Path,
    *,
    noise: NoiseName = "paper",
    seed: int = 1,
    required: Mapping[str, float] | None = None,
    pair: tuple[str, str] | None = None,
    add_thermometer: bool = False,
    progress: Callable[[str], None] | None = None,
) -> Plan:
    """What `plan.json` holds.

    Args:
        scenario: Profiles: a scenario that comes with gyrotc, or a TOML file.
        noise: Levels where the scenario gives none.
        seed: Draws the simulated gyro, on whose bias the limits of `cavity_lag` and `time_misalignment` depend.
        required: Detection limits to reach, by cause, for the shortest profile.
        pair: Two causes; further runs are ranked by how they part them.
        add_thermometer: Say where a further thermometer would add most.
        progress: Called with what is being done.

    Raises:
        InputError: A scenario, profile or cause that cannot be.
    """
    say = progress or (lambda _: None)
    say("simulating the profile")
    programme = programme_of(scenario, noise=noise, seed=seed)
    say("computing signatures")
    sensitivity = Sensitivity(programme)
    say("comparing causes")
    rows = separability(sensitivity)
    profile = ranked = found = None
    if required:
        say("looking for the shortest profile")
        profile = shortest(sensitivity, required)
    if pair:
        say("trying further runs")
        tried = additions(scenario, pair, noise=noise, seed=seed)
        ranked = Additions(pair=pair, runs=tuple(TriedRun(profile=n, hours=h, d=d) for n, h, d in tried))
    if add_thermometer:
        say("trying further thermometers")
        found = tuple(places(scenario, sensitivity, noise=noise, seed=seed))
    result = Plan(
        gyrotc_version=__version__,
        serial=None,
        axis=None,
        scenario=programme.name,
        hours=sum(programme.hours),
        noise=AssumedNoise.of_object(programme.declared),
        bias_range_dph=programme.bias_range_dph,
        runs=tuple(
            PlannedRun(profile=run.name, hours=h, temperature=_temperature(run))
            for run, h in zip(programme.records.runs, programme.hours, strict=True)
        ),
        limits=tuple(
            PlanLimit(
                id=id,
                family=CATALOGUE[id].family,
                detection_limit=DetectionLimit(value=one.value, unit=one.unit, parameter=one.parameter, over=one.at),
            )
            for id, one in sensitivity.limits().items()
        ),
        not_testable=dict(sensitivity.bank.untestable),
        separability=tuple(Separability.of_object(row) for row in rows),
        hard_to_separate=_hard(rows),
        accuracy=tuple(_accuracy(sensitivity)),
        shortest=profile,
        additions=ranked,
    )
    return result if found is None else result.model_copy(update={"thermometers": found})


def _temperature(run: RunRecord) -> Temperature:
    """The run's temperature for a picture."""
    step = max(run.history.time_s.size // _PICTURE_POINTS, 1)
    return Temperature(
        time_h=tuple(round(float(t) / 3600.0, 4) for t in run.history.time_s[::step]),
        value_c=tuple(round(float(c), 2) for c in run.history.temperature_c[::step]),
    )


def _hard(rows: list[Row]) -> tuple[Hard, ...]:
    """Pairs that need more than d = 10 in either direction, the hardest first, and what would part them."""
    worst: dict[frozenset[str], tuple[float, str, str]] = {}
    for row in rows:
        for other, d in row.d.items():
            key = frozenset({row.id, other})
            planned = searched(other).planned
            if planned and d > _HARD and d > worst.get(key, (0.0, "", ""))[0]:
                worst[key] = (d, row.id, other)
    ranked = sorted(worst.values(), reverse=True)
    return tuple(Hard(pair=(a, b), d=d, add=separate_by(a, b)) for d, a, b in ranked)


def _accuracy(sensitivity: Sensitivity) -> list[Accuracy]:
    """Predicted accuracy after each run: error of the map over the whole programme, RMS of means over 100 s."""
    programme = sensitivity.programme
    floor = float(np.sqrt(programme.declared.colour(_AVERAGE_S).matrix(np.zeros(1, dtype=np.int64), _AVERAGE_S)[0, 0]))
    out = []
    hours = np.cumsum(programme.hours)
    for count in range(1, len(hours) + 1):
        error = sensitivity.map_error(range(count))
        rms = float(np.hypot(floor, error))
        out.append(
            Accuracy(
                hours=float(hours[count - 1]), runs=count, map_error_dph=error, rms_dph=rms, rms_over_floor=rms / floor
            )
        )
    return out
