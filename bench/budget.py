"""Does the uncertainty that the page states hold?

Units that nothing was tuned on are calibrated as `gyrotc build` does it, with a thermometer and a reference whose
errors are drawn from what their certificates state, and used at the end of the interval of a drift drawn from what
the limits file states. A gyro has a new offset at each power-on and a thermal gradient that no term of its table
corrects, since the budget counts the repeatability of power-ons and thermal history that was not trained. Covered is a
block of its exam where |true bias − correction| ≤ U.
"""

from __future__ import annotations

import tempfile
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from gyrotc.assess import load_limits
from gyrotc.mirror import replay
from gyrotc.recordings import load
from gyrotc.results import Budget, read_result
from gyrotc.simulate import simulate
from gyrotc.tables import quantise
from jobs import built_for_fleet

from .campaigns import Settings, say
from .page import Figure, ResultsTable, figures_table
from .records import Record
from .sigma import CAMPAIGNS, exam_of

FIRST_SEED = 300_000  # of gyros that nothing was tuned on
UNITS = 100
_SHARES = (0.4, 0.2, 0.2, 0.2)  # of the first four campaigns, which have no terms
_THERMOMETER_C, _REFERENCE_DPH, _DRIFT_DPH = 0.05, 3e-5, 1e-4  # 1 sigma, 1 sigma, most in the interval
# Standard deviation of the offset from power-on to power-on.
_TURN_ON_DPH = 5e-5
# Largest amplitude of a gradient. The map follows most of it, and the rest is of the size of the other sources.
_MAX_GRADIENT_DPH_PER_C = 9e-5
_CAUSES = """
[[cause]]
id = "turn_on_offset"
std_dph = {turn_on}
[[cause]]
id = "thermal_gradient"
tau_s = 900.0
amplitude_dph_per_c = {gradient}
"""
_LIMITS = f"""schema = 1
[interval]
days = 365.25
drift_dph_per_year = {_DRIFT_DPH}
[[instrument]]
name = "thermometer"
certificate = "T-1"
quantity = "temperature"
expanded_uncertainty = {2.0 * _THERMOMETER_C}
[[instrument]]
name = "levelled base"
certificate = "R-1"
quantity = "rate"
expanded_uncertainty = {2.0 * _REFERENCE_DPH}
"""
_TEXT = """
{units} simulated gyros that were not used in development are calibrated by `gyrotc build`. The errors of temperature
sensor ({thermometer} C), rate reference ({reference} deg/h; both 1 sigma) and drift (up to {drift} deg/h) are random
within what certificates and limits file state. Each power-on has another offset ({turn_on} deg/h, 1 sigma), and each
gyro a thermal gradient of 15 min that no term corrects (up to {gradient} deg/h/C). A block of 10 s of a test run is
covered if |true bias − correction| ≤ U of the budget.
"""


@dataclass(frozen=True, slots=True)
class Covered:
    """Of one unit: its share of blocks within U, U (deg/h) and k."""

    campaign: str
    share: float
    expanded_dph: float
    factor: float


def units_of(units: int) -> list[tuple[int, int]]:
    """Campaign and seed of each unit."""
    counts = [round(share * units) for share in _SHARES]
    return [(c, FIRST_SEED + 1000 * c + k) for c, count in enumerate(counts) for k in range(count)]


def coverage_of(number: int, seed: int) -> Covered:
    """One unit calibrated, and used at the end of its interval."""
    campaign = CAMPAIGNS[number]
    draw = np.random.default_rng(seed)
    with tempfile.TemporaryDirectory(prefix="gyrotc-budget-") as place:
        work = Path(place)
        plan = work / "scenario.toml"
        plan.write_text(_scenario(campaign.scenario, draw.uniform(0.1, 1.0) * _MAX_GRADIENT_DPH_PER_C), "utf-8")
        (work / "limits.toml").write_text(_LIMITS, "utf-8")
        simulate(plan, seed=seed, out=work / "data", format="parquet")
        limits = load_limits(work / "limits.toml")
        built = built_for_fleet(work / "out", load(work / "data"), limits=limits)
        budget = read_result(work / "out" / "budget.json", Budget)
        exam = list(exam_of(plan, seed))
    table = quantise(built.model, "f32")
    wrong_c = draw.normal(0.0, _THERMOMETER_C)
    moved_dph = draw.normal(0.0, _REFERENCE_DPH) + draw.uniform(-_DRIFT_DPH, _DRIFT_DPH)
    within, blocks = 0, 0
    for run in exam:
        words = table.encode_inputs((run.temperature_c + wrong_c)[:, None])
        steps = replay(table, words, missed=np.zeros(len(words), dtype=np.int64), samples_per_block=1)
        error = run.bias_dph + moved_dph - table.decode_bias(steps.bits)
        plain = steps.status == 0
        within += int(np.count_nonzero(np.abs(error[plain]) <= budget.expanded_dph))
        blocks += int(np.count_nonzero(plain))
    return Covered(campaign.name, within / blocks, budget.expanded_dph, budget.coverage_factor)


def _scenario(base: str, gradient: float) -> str:
    """Return the scenario of a unit: `base`, a name or TOML, with the causes that a budget counts."""
    text = base if "\n" in base else f'extends = "{base}"\ntitle = "With what a budget counts"\n'
    return text + _CAUSES.format(turn_on=_TURN_ON_DPH, gradient=gradient)


def measure(settings: Settings) -> Record:
    """Return the coverage of each campaign and of all."""
    found = []
    for number, seed in units_of(5 if settings.quick else UNITS):
        found.append(coverage_of(number, seed))
        say(f"{found[-1].campaign}, {seed}: {100.0 * found[-1].share:.1f} %")
    names = dict.fromkeys(one.campaign for one in found)
    rows = [_row(name, [one for one in found if one.campaign == name]) for name in names]
    return {"units": len(found), "rows": [*rows, _row("together", found)]}


def _row(name: str, found: list[Covered]) -> dict[str, Any]:
    shares = np.array([one.share for one in found])
    return {
        "campaign": name,
        "units": len(found),
        "covered": float(shares.mean()),
        "error": float(shares.std(ddof=1) / np.sqrt(len(shares))) if len(shares) > 1 else 0.0,
        "expanded_dph": float(np.median([one.expanded_dph for one in found])),
        "factor": float(np.median([one.factor for one in found])),
    }


def table(record: Record) -> ResultsTable:
    """Return the coverage of all campaigns together, with its aim, and of the lowest and highest one."""
    text = _TEXT.format(
        units=record["units"],
        thermometer=_THERMOMETER_C,
        reference=_REFERENCE_DPH,
        drift=_DRIFT_DPH,
        turn_on=_TURN_ON_DPH,
        gradient=_MAX_GRADIENT_DPH_PER_C,
    )
    (together,) = (row for row in record["rows"] if row["campaign"] == "together")
    ends = sorted((row for row in record["rows"] if row is not together), key=lambda row: row["covered"])
    return figures_table(
        text,
        [
            ("blocks that are covered", Figure(together["covered"], ".1%", at_least=0.92, at_most=0.98)),
            *((f"the same, {row['campaign']}", Figure(row["covered"], ".1%")) for row in (ends[0], ends[-1])),
            ("U, median, deg/h", Figure(together["expanded_dph"], ".2e")),
        ],
    )
