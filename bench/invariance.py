"""Diagnose recordings in equivalent forms, which must not change the result.

Every set (packaged scenarios, axes of measured recordings) is diagnosed as it is, then with a constant added to the
rate, another clock, seed or order of runs, each run twice, spans cut in two, rates that were written in deg/s, other
lengths of a block, and means in place of its rows. Verdict and causes must be the same; the table says by how much
parameters and figures move.
"""

from __future__ import annotations

import tempfile
import traceback
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, field, replace
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
from gyrotc.diagnose import diagnose
from gyrotc.recordings import Dataset, Exclusion, Rows, Run, load
from gyrotc.results import Diagnosed
from gyrotc.simulate import simulate
from gyrotc.train import FitOptions

from .campaigns import Settings, say
from .page import Count, ResultsTable, figures_table
from .records import Record

SCENARIOS = ("paper", "thermal-gradient", "hysteresis", "cavity-lag", "warm-up", "supply-voltage")
MEASURED = ("mpu6000-chamber-cycle", "atoms3-mpu6886-heating", "pan-lsm6dsm-cold", "mpu6050-isothermal")
AXES = "xyz"
PARAMETERS, OF_BLOCKS, FIGURES = 0.01, 0.05, 0.02
"""Shares by which parameters (with another length of a block) and figures may move."""

AVERAGE_S = FitOptions().average_s
WHOLE_S = 120.0
"""Means that hold a whole number of blocks of 10, 20, 30 and 60 s; 100 s hold one or two of 60."""

Change = Callable[[Dataset], Dataset]


@dataclass(frozen=True)
class Variation:
    """One way to hand over the same recordings; it is asked of rows of at most `finest_s`.

    Means longer than a block are blocks of their own, so what they are held against (`against`) has blocks as long, and
    RMS figures are of means that hold a whole number of either.
    """

    change: Change = lambda dataset: dataset
    options: FitOptions = field(default_factory=FitOptions)
    parameters: float = PARAMETERS
    finest_s: float = np.inf
    against: FitOptions = field(default_factory=FitOptions)

    @property
    def later_s(self) -> float:
        """By how much a correction comes earlier or later: it is in force one block after what it is made of."""
        return abs(self.options.block_s - self.against.block_s)


def of_rows(change: Callable[[Rows], Rows], **moved: Any) -> Change:
    """Every run with its rows changed."""

    def one(run: Run) -> Run:
        rows = change(run.rows())
        return replace(run, reader=lambda: rows, n_rows=len(rows), **moved)

    return lambda dataset: replace(dataset, runs=tuple(map(one, dataset.runs)))


def shifted(constant_dph: float) -> Change:
    return of_rows(lambda rows: replace(rows, rate_dph=rows.rate_dph + constant_dph))


def in_degrees_per_second(rows: Rows) -> Rows:
    """Return rows as they come back from a file in deg/s with nine digits."""
    return replace(rows, rate_dph=np.array([float(f"{v / 3600.0:.9g}") * 3600.0 for v in rows.rate_dph]))


def later(by_s: float) -> Change:
    """All clocks moved."""

    def moved(at_s: float | None) -> float | None:
        return None if at_s is None else at_s + by_s

    def one(run: Run) -> Run:
        rows = run.rows()
        return replace(
            run,
            reader=lambda: replace(rows, time_s=rows.time_s + by_s),
            power_on_s=moved(run.power_on_s),
            from_s=moved(run.from_s),
            to_s=moved(run.to_s),
            exclude=tuple(Exclusion(e.from_s + by_s, e.to_s + by_s, e.reason) for e in run.exclude),
        )

    return lambda dataset: replace(dataset, runs=tuple(map(one, dataset.runs)))


def twice(dataset: Dataset) -> Dataset:
    copies = tuple(replace(run, file=f"copy-{run.file}") for run in dataset.runs)
    return replace(dataset, runs=(*dataset.runs, *copies))


def cut(dataset: Dataset) -> Dataset:
    """Every run as two spans that touch at the middle of its rows, the second first."""
    spans = []
    for run in dataset.runs:
        time = run.rows().time_s
        time = time[run.in_span(time)]
        middle = float(time[time.size // 2])
        spans += [replace(run, from_s=middle), replace(run, to_s=middle)]
    return replace(dataset, runs=tuple(spans))


def averaged(seconds: float) -> Change:
    """Means over so many seconds in place of rows."""

    def one(run: Run) -> Run:
        rows = run.rows()
        group = max(round(seconds / run.row_period_s), 1)
        count = len(rows) // group

        def mean(values: np.ndarray) -> np.ndarray:
            return np.asarray(values[: count * group].reshape(count, group).mean(axis=1))

        means = Rows(
            mean(rows.time_s),
            mean(rows.temperature_c),
            mean(rows.rate_dph),
            {name: mean(values) for name, values in rows.channels.items()},
        )
        return replace(run, reader=lambda: means, n_rows=count, row_period_s=group * run.row_period_s)

    return lambda dataset: replace(dataset, runs=tuple(map(one, dataset.runs)))


VARIATIONS = {
    **{f"rate + {c:g} deg/h": Variation(shifted(c)) for c in (1.0, 10.0, 1000.0)},
    "clock + 1e5 s": Variation(later(1e5)),
    "seed 2": Variation(options=FitOptions(seed=2)),
    "runs in another order": Variation(lambda dataset: replace(dataset, runs=dataset.runs[::-1])),
    "each run twice": Variation(twice),
    "spans cut in two": Variation(cut),
    "rates in deg/s": Variation(of_rows(in_degrees_per_second)),
    **{
        f"blocks of {s:g} s": Variation(options=FitOptions(block_s=s), parameters=OF_BLOCKS, finest_s=s)
        for s in (1.0, 2.0, 5.0, 20.0)
    },
    "means over 10 s": Variation(averaged(10.0), finest_s=5.0),
    **{
        f"means over {s:g} s": Variation(averaged(s), as_long, OF_BLOCKS, s / 2.0, as_long)
        for s, as_long in ((s, FitOptions(block_s=s, average_s=WHOLE_S)) for s in (30.0, 60.0))
    },
}


@dataclass(frozen=True)
class Answer:
    """Parts of a diagnosis that are compared."""

    verdict: str
    causes: tuple[str, ...]
    parameters: dict[str, float]
    figures: dict[str, float]

    @staticmethod
    def of(result: Diagnosed) -> Answer:
        parameters = {
            f"{k}.{cause.id}.{name}": value.value
            for k, cause in enumerate(result.physical)
            for name, value in cause.parameters.items()
        }
        figures = {"noise floor": result.noise_floor_dph or 0.0}
        if result.baseline is not None:
            figures["RMS without"] = result.baseline.exam_rms_dph
        if result.extended is not None:
            figures["RMS with"] = result.extended.exam_rms_dph
        return Answer(result.verdict, tuple(c.id for c in result.physical), parameters, figures)


def change_per_s(dataset: Dataset, noise_dph: float) -> float:
    """RMS over the recordings of how fast the rate changes, deg/h per s, without what the noise of means does."""
    steps = [np.diff(run.rows().rate_dph) for run in averaged(AVERAGE_S)(dataset).runs]
    squares = np.concatenate(steps) ** 2
    return float(np.sqrt(max(np.nanmean(squares) - 2.0 * noise_dph**2, 0.0))) / AVERAGE_S


def moved(was: dict[str, float], now: dict[str, float]) -> dict[str, float]:
    """By which share each value has moved; values that one of them lacks have moved by infinity."""
    return {
        name: abs(now[name] / was[name] - 1.0) if name in was and name in now and was[name] else np.inf
        for name in was.keys() | now.keys()
        if was.get(name) != now.get(name)
    }


def answer(dataset: Dataset, options: FitOptions) -> Answer | str:
    """A text where the diagnosis failed."""
    try:
        return Answer.of(diagnose(dataset, options=options).result)
    except Exception:
        return traceback.format_exc()


def compared(was: Answer, name: str, now: Answer, change: float) -> dict[str, Any]:
    """A record of one variation.

    Args:
        change: How fast the rate changes, deg/h per s: two corrections of one model that differ in delay differ by no
            more than this times the difference, and so do their RMS.
    """
    parameters, figures = moved(was.parameters, now.parameters), moved(was.figures, now.figures)
    same = (was.verdict, was.causes) == (now.verdict, now.causes)
    variation = VARIATIONS[name]
    near = same and all(v <= variation.parameters for v in parameters.values())
    late = {k: variation.later_s * change / v for k, v in was.figures.items() if k.startswith("RMS")}
    return {
        "variation": name,
        "same": same,
        "kept": near and all(v <= FIGURES for v in figures.values()),
        "late": near and all(v <= max(FIGURES, late.get(k, 0.0)) for k, v in figures.items()),
        "verdict": [was.verdict, now.verdict],
        "causes": [list(was.causes), list(now.causes)],
        "parameters": parameters,
        "figures": figures,
        "delay": late,
        "plain": {"verdict": was.verdict, "causes": was.causes, **was.parameters, **was.figures},
    }


def of_set(task: tuple[str, str, str, tuple[str, ...]]) -> list[dict[str, Any]]:
    """Records of all variations of one set."""
    label, folder, axis, names = task
    dataset = load(Path(folder), axis=axis or None)
    row_s = max(run.row_period_s for run in dataset.runs)
    known: dict[FitOptions, Answer | str] = {}
    records = []
    for name in names:
        variation = VARIATIONS[name]
        if row_s > variation.finest_s:
            continue
        if variation.against not in known:
            known[variation.against] = answer(dataset, variation.against)
        was, now = known[variation.against], answer(variation.change(dataset), variation.options)
        if isinstance(was, str) or isinstance(now, str):
            failed = was if isinstance(was, str) else now
            records.append({"set": label, "variation": name, "failed": failed})
            continue
        change = change_per_s(dataset, was.figures["noise floor"]) if variation.later_s else 0.0
        records.append({"set": label, **compared(was, name, now, change)})
    return records


def line(record: dict[str, Any]) -> str:
    """A record as a line of the terminal."""
    head = f"{record['set']:24s} {record['variation']:22s}"
    if "failed" in record:
        return f"{head} FAILED: {record['failed'].splitlines()[-1]}"
    (was, now), (causes, others) = record["verdict"], record["causes"]
    worst = [max(record[kind].values(), default=0.0) for kind in ("parameters", "figures")]
    state = "ok  " if record["kept"] else "late" if record["late"] else "NOT "
    text = f"{head} {state} parameters {worst[0]:7.2%} figures {worst[1]:7.2%}"
    return text if record["same"] else f"{text} {was} {causes} -> {now} {others}"


def sets(source: Path, work: Path) -> Iterator[tuple[str, Path, str]]:
    """Label, folder and axis of every set."""
    for name, axis in product(MEASURED, AXES):
        if not (source / name).is_dir():
            say(f"{name} {axis} is absent in {source}: skipped")
            continue
        folder = source / name
        if not (folder / "dataset.toml").is_file():
            folder = work / name
            folder.mkdir(exist_ok=True)
            data = next((source / name).glob("*.csv"))
            (folder / data.name).write_bytes(data.read_bytes())
            run = f'[[run]]\nfile = "{data.name}"\npower_on_s = "unknown"\n'
            (folder / "dataset.toml").write_text(f'schema = 1\nserial = "R1"\n{run}', "utf-8")
        yield f"{name} {axis}", folder, axis
    for name in SCENARIOS:
        folder = work / name
        simulate(name, seed=1, out=folder)
        yield name, folder, ""


def diagnosed(source: Path, only: Sequence[str], names: tuple[str, ...], workers: int) -> list[dict[str, Any]]:
    """Return records of all sets whose names have one of the parts `only` (none: of all)."""
    records: list[dict[str, Any]] = []
    with tempfile.TemporaryDirectory() as work, ProcessPoolExecutor(workers) as pool:
        tasks = [
            (label, str(folder), axis, names)
            for label, folder, axis in sets(source, Path(work))
            if not only or any(part in label for part in only)
        ]
        for found in pool.map(of_set, tasks):
            records += found
            for record in found:
                say(line(record))
    return records


def rows_of(records: Sequence[dict[str, Any]]) -> list[dict[str, Any]]:
    """For each variation: how many sets keep verdict and causes, how many all figures too, and the worst of them."""
    rows = []
    for name in VARIATIONS:
        own = [r for r in records if r["variation"] == name]
        if not own:
            continue
        done = [r for r in own if "failed" not in r]
        worst = {
            kind: max((v for r in done if r["same"] for v in r[kind].values()), default=0.0)
            for kind in ("parameters", "figures")
        }
        counts = {key: sum(bool(r.get(key)) for r in own) for key in ("same", "kept", "late")}
        rows.append({"variation": name, "sets": len(own), **counts, **worst})
    return rows


_TEXT = """
{sets} data sets (built-in scenarios and axes of measured recordings) are diagnosed as they are and in an equivalent
form. Verdict and causes must not change. Within bounds: parameters change by at most 1 % (5 % for another block
length), and figures by 2 % and what another delay of the correction explains.
"""
# Forms on the page, with the beginnings of their names; all others are exactly equivalent.
_OTHERS = {"blocks of another length": "blocks of", "means over another time": "means over"}


def measure(settings: Settings) -> Record:
    """Diagnose every set in every way; `settings.only` takes the sets whose names have one of these parts."""
    only = settings.only or (("hysteresis",) if settings.quick else ())
    names = tuple(VARIATIONS)[:2] if settings.quick else tuple(VARIATIONS)
    records = diagnosed(settings.real, only, names, settings.workers)
    return {"sets": sorted({r["set"] for r in records}), "rows": rows_of(records)}


def table(record: Record) -> ResultsTable:
    """Return how many equivalent forms keep verdict and causes, and how many keep all figures within bounds."""
    rows = record["rows"]
    exact = [row for row in rows if not row["variation"].startswith(tuple(_OTHERS.values()))]
    groups = {f"{len(exact)} equivalent forms (a constant added, another unit, order, seed and others)": exact}
    groups |= {name: [row for row in rows if row["variation"].startswith(own)] for name, own in _OTHERS.items()}
    figures = []
    for name, group in ((name, group) for name, group in groups.items() if group):
        of = sum(row["sets"] for row in group)
        for words, key in (("same verdict and causes", "same"), ("within bounds", "late")):
            kept = sum(row[key] for row in group)
            figures.append((f"{name}: {words}", Count(kept, of, is_missed=kept < of, aim="all")))
    return figures_table(_TEXT.format(sets=len(record["sets"])), figures)
