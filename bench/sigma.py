"""Does the uncertainty of a correction hold? True bias less correction, in units of the sigma of its snapshot.

Gyros that nothing was tuned on; the table's answers are those of the reference, which are those of the compiled code
bit for bit (tests/cases/mirror/test_sigma.py).
"""

from __future__ import annotations

import re
import tempfile
from collections.abc import Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from gyrotc.mirror import CLAMPED, FALLBACK, FLOAT64, HELD, UNCOVERED, WARMING, Table, TermOutcome, recursion_of, replay
from gyrotc.model import Model, Term, load_model
from gyrotc.recordings import load
from gyrotc.simulate import read, simulate, simulate_campaign, with_noise
from gyrotc.tables import emit, quantise
from gyrotc.train import FitOptions, TrainingData, fit, front_end, joined, model_of, samples_of, start_sigma
from gyrotc.verify import all_targets, compile_c, run_program
from numpy.typing import NDArray
from scipy.special import ndtr

from .campaigns import Settings, say
from .page import Figure, ResultsTable, figures_table
from .records import Record

Floats = NDArray[np.float64]

BLOCK_S = 10.0


@dataclass(frozen=True, slots=True)
class Recording:
    """One run, a mean for every block of 10 s: temperature as it is read, C; true bias and measured rate, deg/h."""

    environment: str
    temperature_c: Floats
    bias_dph: Floats
    rate_dph: Floats


@dataclass(frozen=True, slots=True)
class Gyro:
    """A gyro's table, and recordings that it was not made from."""

    seed: int
    model: Model
    table: Table
    exam: tuple[Recording, ...]


def gyro(scenario: str, seed: int, *, terms: Sequence[Term] = (), numeric: str = "f32") -> Gyro:
    """The gyro that a seed draws; `scenario` is a name or TOML, `terms` are in the model as they were planted."""
    with tempfile.TemporaryDirectory() as place:
        plan: str | Path = scenario
        if "\n" in scenario:
            plan = Path(place) / "scenario.toml"
            plan.write_text(scenario, "utf-8")
        simulate(plan, seed=seed, out=Path(place) / "data", format="parquet")
        model = _model(Path(place) / "data", terms)
        exam = tuple(exam_of(plan, seed))
    return Gyro(seed, model, quantise(model, numeric), exam)


def exam_of(plan: str | Path, seed: int) -> Iterator[Recording]:
    """The test runs of a simulated gyro, with their true bias."""
    content = with_noise(read(plan)[1], "paper")
    runs = [(s.role, name) for s in content.set for name in s.profiles]
    n = round(BLOCK_S)
    for (role, name), record in zip(runs, simulate_campaign(content, seed), strict=True):
        whole = len(record.reading_c) // n * n
        if role == "exam":
            yield Recording(
                environment=name,
                temperature_c=record.reading_c[:whole].reshape(-1, n).mean(axis=1),
                bias_dph=np.diff(record.true_arcsec[: whole + 1 : n]) / BLOCK_S,
                rate_dph=np.diff(record.angle_arcsec[: whole + 1 : n]) / BLOCK_S,
            )


def _model(folder: Path, terms: Sequence[Term]) -> Model:
    """Return the model that `gyrotc fit` makes, without the refits that only say how it was chosen."""
    dataset = load(folder)
    runs = [run for run in dataset.runs if run.role == "train"]
    options = FitOptions()
    front = front_end(runs, options.block_s)
    parts, raw = [], []
    for k, run in enumerate(runs):
        blocks = front.blocks(run)
        part = samples_of(blocks, front.block_s, k)
        raw.append(part.bias_dph)
        parts.append(_beside(terms, blocks, part, front.block_s) if terms else part)
    data = joined(parts)
    found = fit(data, method="mrbf" if terms else "auto")
    plain = model_of(dataset, runs, data, found, front, options, np.concatenate(raw) - data.bias_dph)
    content = plain.to_dict()
    rules = content["uncertainty_dph"]["rules"]
    rules["terms"] = [start_sigma(t.id, t.parameters, rules, data) for t in terms]
    return Model.from_dict({**content, "terms": [t.model_dump() for t in terms]})


def _beside(terms: Sequence[Term], blocks: Any, part: TrainingData, block_s: float) -> TrainingData:
    """The samples as the map sees them beside the terms."""
    steps, n = blocks.steps, blocks.settings.samples_per_block
    slope, none = steps.slope.astype(np.float64), np.zeros(steps.slope.size)
    seen = TermOutcome(steps.temperature.astype(np.float64), slope, none, steps.remarks)
    for term in terms:
        parameters = term.table.parameters(term.parameters, block_s)
        recursion = recursion_of(term.table.kind, FLOAT64, parameters)
        recursion.apply(blocks.stream.course(steps, n), None, seen)
    k = blocks.in_force[blocks.used]
    columns = {name: getattr(part, name) for name in TrainingData.__slots__}
    columns["temperature_c"] = np.asarray(seen.temperature, dtype=np.float64)[k]
    columns["slope_c_per_min"] = np.asarray(seen.slope, dtype=np.float64)[k] * (60.0 / block_s)
    columns["bias_dph"] = part.bias_dph - np.asarray(seen.added, dtype=np.float64)[k]
    return TrainingData(**columns)


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


def measure(settings: Settings) -> Record:
    """Return figures of every campaign, of all together, and what a snapshot costs."""
    rows, every = [], {state: [] for state in STATES}
    with ProcessPoolExecutor(settings.workers) as pool:
        for number, campaign in enumerate(CAMPAIGNS):
            parts: list[dict[str, tuple[Floats, Floats]]] = []
            count = 1 if settings.quick else campaign.gyros
            first = FIRST_SEED if settings.seed is None else settings.seed
            seeds = range(first + 1000 * number, first + 1000 * number + count)
            for seed, part in zip(seeds, pool.map(_looked_at, [campaign] * count, seeds), strict=True):
                say(f"{campaign.name}, gyro {seed}")
                parts.append(part)
            rows.append({"campaign": campaign.name, "gyros": count, "states": pooled(parts)})
            for part in parts:
                for state, pair in part.items():
                    every[state].append({state: pair})
    total = {state: pooled(parts)[state] for state, parts in every.items() if parts}
    together = {"gyros": sum(r["gyros"] for r in rows), "states": total}
    return {"campaigns": rows, "together": together, "cost": cost()}


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


HERE = Path(__file__).resolve().parent
_MODEL = HERE.parent / "examples" / "nav_loop" / "filter_model.json"
_CORES = ("cortex-m0", "cortex-m3", "cortex-m4f", "rv32imac")


def cost() -> list[dict[str, Any]]:
    """For each core and arithmetic: of a correction in force, of a held one; the table of examples/nav_loop."""
    rows = []
    with tempfile.TemporaryDirectory() as place:
        emit(load_model(_MODEL), Path(place))
        c = Path(place) / "c"
        for name in _CORES:
            target = all_targets()[name]
            if target.missing():
                say(f"{name} is left out: {target.missing()} is not installed")
                continue
            for numeric in ("f32", "q31"):
                source = Path(place) / f"{name}-{numeric}.c"
                text = (HERE / "snapshot.c").read_text("utf-8")
                source.write_text(f"#define OF_{numeric.upper()} 1\n{text}", "utf-8")
                sources = [source, c / f"gtc_{numeric}.c", c / "gtc_sim_0003.c"]
                program = source.with_suffix("")
                compile_c(target, sources, program, include=c)
                run = run_program(target, program)
                printed = run.stdout.decode("ascii") + run.stderr
                words = [int(w, 16) for w in re.findall(r"(?:^|m)([0-9a-f]{8})\.?$", printed, re.MULTILINE)]
                assert len(words) == 4, printed
                counts = [(words[k + 1] - words[k]) / target.ticks_per_count for k in (0, 2)]
                rows.append({"core": name, "numeric": numeric, "in_force": counts[0], "held": counts[1]})
    return rows


_TEXT = """
Error of the correction divided by the standard uncertainty (sigma) of the snapshot of the same moment, for every block
of 10 s of {gyros} simulated gyros that were not used in development, with outages, restarts and environments beyond
those of the calibration.
"""


def table(record: Record) -> ResultsTable:
    """Return how many errors lie within one and two sigma, and where sigma is furthest from the error."""
    states = record["together"]["states"]
    whole = states["all"]
    state, of_state = max(states.items(), key=lambda item: item[1]["squared"])
    campaign = max(record["campaigns"], key=lambda one: one["states"]["all"]["squared"])
    return figures_table(
        _TEXT.format(gyros=record["together"]["gyros"]),
        [
            ("errors within 1 sigma (normal: 68.3 %)", Figure(whole["within_1"], ".1%")),
            ("errors within 2 sigma (normal: 95.4 %)", Figure(whole["within_2"], ".1%")),
            ("mean of (error/sigma)² (ideal: 1)", Figure(whole["squared"], ".2f")),
            (f"the same, worst status of a correction ({state})", Figure(of_state["squared"], ".2f")),
            (
                f"the same, worst environment ({campaign['campaign']})",
                Figure(campaign["states"]["all"]["squared"], ".2f"),
            ),
            ("RMS of error/sigma of a gyro, 10 % quantile", Figure(whole["low"], ".2f")),
            ("RMS of error/sigma of a gyro, 90 % quantile", Figure(whole["high"], ".2f")),
        ],
    )
