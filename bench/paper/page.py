"""Every table and figure of docs/paper.md made again, or checked; and the record of all that they are made of.

python -m bench.paper.page docs            docs/results/paper.json, page, figures, run of simulation.md
python -m bench.paper.page docs --check    the same measured again and compared with what is there; changes nothing
"""

from __future__ import annotations

import argparse
import math
import platform
import re
import sys
import tempfile
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import scipy
from gyrotc import _core
from gyrotc.common import InputError
from gyrotc.pages import AFTER_DPH, BEFORE_DPH, ENVIRONMENTS, RUNNING_S
from gyrotc.results import write_atomically
from gyrotc.simulate import NoiseName, read, simulate_campaign, with_noise

from ..records import read_record, rounded, write_record
from .experiment import FIGURES, METHODS, Experiment, Series, checksum, draw, draw_run, experiment

Figures = Mapping[str, Any]
"""Those of one gyro, as `Experiment.figures` gives them."""
Gyros = Mapping[str, Mapping[str, Figures]]
"""By level of noise and seed."""

_Row = Sequence[str]
_MAIN = ("constant", "mlr", "rbf_random", "mrbf_paper", "mrbf")  # the others vary one of them
_HOLDS = ENVIRONMENTS[:3]
_CLAIMS = (
    ("mrbf_paper", "rbf_random"),
    ("mrbf_paper", "mlr"),
    ("mrbf_paper", "constant"),
    ("mlr", "constant"),
    ("mrbf", "mrbf_paper"),
    ("mrbf", "mlr"),
)
_NOISE_TITLES = {"paper": "the paper's noise", "class": "an ordinary unit's"}


def filled(text: str, parts: Mapping[str, str]) -> str:
    """The page with each part between its marks replaced.

    Raises:
        InputError: a mark is missing.
    """
    for name, part in parts.items():
        pattern = re.compile(rf"(<!-- {name} -->\n).*?(<!-- /{name} -->)", re.DOTALL)
        if not pattern.search(text):
            raise InputError("docs/paper.md", f"no marks for {name}", f"<!-- {name} --> ... <!-- /{name} -->")
        text = pattern.sub(lambda found, part=part: f"{found[1]}{part}\n{found[2]}", text)  # type: ignore[misc]
    return text


def parts(record: Mapping[str, Any], bench: Sequence[Mapping[str, Any]]) -> dict[str, str]:
    """All parts of the page.

    Args:
        record: What docs/results/paper.json has of the experiment.
        bench: Whole methods on one gyro of scenario `paper`, as `accuracy` leaves them; empty: not measured.
    """
    gyros: Gyros = record["gyros"]
    first, made = next(iter(gyros["paper"].values())), record["made_with"]
    return {
        "made": f"Made with numpy {made['numpy']} and scipy {made['scipy']}, the core compiled by {made['compiler']}, "
        f"on {made['machine']}.",
        "table-1": _table_1(first),
        "gyros": _gyros_table(gyros),
        "scatter": _scatter_table(first, record["samples"]),
        "holds": _holds_table(gyros),
        "claims": _claims_table(gyros),
        "times": _times(bench),
    }


def _markdown(head: _Row, rows: Sequence[_Row]) -> str:
    lines = [head, ["---"] * len(head), *rows]
    return "\n".join("| " + " | ".join(line) + " |" for line in lines)


def _table_1(figures: Figures) -> str:
    """Return Table 1: before, after and improvement in each environment, with the paper's own figures."""
    before, after = figures["before"], figures["after"]
    rows = [
        ["before: mean", *(f"{1e3 * before[name]['mean_dph']:.3f}" for name in ENVIRONMENTS)],
        ["before: RMS about zero", *(f"{1e3 * before[name]['rms_dph']:.3f}" for name in ENVIRONMENTS)],
        ['*paper\'s "σ" before*', *(f"*{1e3 * BEFORE_DPH[name]:.3f}*" for name in ENVIRONMENTS)],
        ["before: σ about the mean", *(f"{1e3 * before[name]['std_dph']:.3f}" for name in ENVIRONMENTS)],
    ]
    for method, label in METHODS.items():
        of = after[method]
        rows.append([f"after, {label}", *(f"{1e3 * of[name]['rms_dph']:.3f}" for name in ENVIRONMENTS)])
        if method in AFTER_DPH:
            rows.append(["*paper*", *(f"*{1e3 * AFTER_DPH[method][name]:.3f}*" for name in ENVIRONMENTS)])
    for method in _MAIN:
        gains = (f"{before[name]['rms_dph'] / after[method][name]['rms_dph']:.1f}" for name in ENVIRONMENTS)
        rows.append([f"improvement, {METHODS[method]}", *gains])
        if method in AFTER_DPH:
            gains = (f"*{BEFORE_DPH[name] / AFTER_DPH[method][name]:.1f}*" for name in ENVIRONMENTS)
            rows.append(["*paper*", *gains])
    for method in _MAIN:
        gains = (f"{before[name]['std_dph'] / after[method][name]['std_dph']:.2f}" for name in ENVIRONMENTS)
        rows.append([f"improvement of σ, {METHODS[method]}", *gains])
    for method, label in METHODS.items():
        centers = [after[method][name]["centers"] for name in ENVIRONMENTS]
        if any(centers):
            rows.append([f"centers, {label}", *map(str, centers)])
    return _markdown(["1e-3 deg/h", *ENVIRONMENTS], rows)


def _ratio(figures: Figures, method: str) -> float:
    """RMS after compensation over all environments, which have as many means each, ÷ the noise floor."""
    squares = [figures["after"][method][name]["rms_dph"] ** 2 for name in ENVIRONMENTS]
    return math.sqrt(sum(squares) / len(squares)) / float(figures["floor_dph"])


def _median_worst(values: Sequence[float]) -> str:
    return f"{np.median(values):.3f}, {max(values):.3f}"


def _gyros_table(gyros: Gyros) -> str:
    """Exam RMS ÷ noise floor over several gyros, median and worst, for each level of noise."""
    rows = [
        [label, *(_median_worst([_ratio(one, method) for one in of.values()]) for of in gyros.values())]
        for method, label in METHODS.items()
    ]
    floors = [f"{1e3 * float(np.median([one['floor_dph'] for one in of.values()])):.3f}" for of in gyros.values()]
    rows.append(["noise floor, 1e-3 deg/h", *floors])
    return _markdown(["RMS after ÷ noise floor", *(f"{_NOISE_TITLES[noise]}: median, worst" for noise in gyros)], rows)


def _scatter_table(figures: Figures, samples: int) -> str:
    """Return a table of how much σ after compensation differs between the environments: paper, here, and by chance."""
    chance = f"{100.0 / np.sqrt(2.0 * samples):.1f} %"
    rows = []
    for method, published in AFTER_DPH.items():
        ours = [figures["after"][method][name]["std_dph"] for name in ENVIRONMENTS]
        rows.append([METHODS[method], _scatter(list(published.values())), _scatter(ours), chance])
    return _markdown(["spread of σ over the environments", "paper", "here", f"chance, {samples} samples"], rows)


def _scatter(values: Sequence[float]) -> str:
    return f"{100.0 * float(np.std(values, ddof=1) / np.mean(values)):.1f} %"


def _holds_table(gyros: Gyros) -> str:
    """RMS at constant temperature over what a constant leaves: as recorded, and with set 2 at set 1's temperature."""
    rows = []
    for method, label in METHODS.items():
        row = [label]
        for key in ("rms_dph", "moved_rms_dph"):
            ratios = [
                one["after"][method][name][key] / one["after"]["constant"][name]["rms_dph"]
                for one in gyros["paper"].values()
                for name in _HOLDS
            ]
            row.append(_median_worst(ratios))
        rows.append(row)
    return _markdown(
        ["RMS ÷ that of a constant", "as recorded: median, worst", "at the temperature of set 1: median, worst"], rows
    )


def _claims_table(gyros: Gyros) -> str:
    """Of how many gyros one method leaves less than another, with medians of RMS ÷ noise floor."""
    rows = []
    for better, worse in _CLAIMS:
        row = [f"{METHODS[better]} < {METHODS[worse]}"]
        for of in gyros.values():
            pairs = [(_ratio(one, better), _ratio(one, worse)) for one in of.values()]
            wins = sum(a < b for a, b in pairs)
            row.append(f"{wins} of {len(pairs)}")
        rows.append(row)
    return _markdown(["which leaves less, of all gyros", *(_NOISE_TITLES[noise] for noise in gyros)], rows)


def _times(bench: Sequence[Mapping[str, Any]]) -> str:
    """Running times in words: the paper's for one environment, ours for all six together."""
    ours = {row["name"]: row.get("seconds") for row in bench}
    random, modified = ours.get("paper: rbf_random"), ours.get("paper: mrbf_paper")
    theirs = [sorted(RUNNING_S[method].values()) for method in ("rbf_random", "mrbf_paper")]
    paper = (
        f"The paper trains its random network in {theirs[0][0]:.0f} to {theirs[0][-1]:.0f} s for one environment, the "
        f"modified one in {theirs[1][0]:.0f} to {theirs[1][-1]:.0f} s."
    )
    if random is None or modified is None:
        return f"{paper} The campaign accuracy has not measured ours."
    verdict = "confirmed" if modified < 0.9 * random else "not confirmed"
    return (
        f"{paper} Here one model over all six takes {random:.3f} s and {modified:.3f} s of CPU time "
        f"([results/accuracy.json](results/accuracy.json)), so that a faster training of the modified network is "
        f"{verdict}. Both factorise normal equations with the same number of candidates; the Kohonen network is "
        "additional."
    )


SEEDS = range(1, 11)
"""The ten gyros; Table 1 and the figures are of the first."""
TOLERANCE = 1e-6
"""Relative, where libraries and compiler are those of the record."""
_TOLERANCE_ELSEWHERE = 1e-3
"""Relative, elsewhere: other libraries round otherwise, and no choice of a center is near enough to depend on that.
Of the default everywhere: where the search for its evidence ends depends on the processor's BLAS kernels, by up to 1e-4
with the noise of an ordinary unit."""
_DIGITS = 10  # kept of a figure
_SERIES_DIGITS = 7  # decimals of what is drawn, deg/h: a seven-thousandth of the noise
_SERIES = ("mlr", "rbf_random", "mrbf_paper")  # methods that the paper draws
_NOISES: tuple[NoiseName, ...] = ("paper", "class")


def made_with() -> dict[str, str]:
    """Versions and machine that the last digits depend on."""
    return {
        "numpy": np.__version__,
        "scipy": scipy.__version__,
        "compiler": _core.compiler,
        "machine": platform.machine(),
    }


def measured(seeds: Sequence[int] = SEEDS) -> tuple[dict[str, Any], Series]:
    """The experiment on the gyros of `seeds` with the paper's noise and that of an ordinary unit.

    Returns:
        The record, everything of the first gyro and RMS of the others, and the series of the first that figures show.
    """
    gyros: dict[str, dict[str, Any]] = {noise: {} for noise in _NOISES}
    series: Series = {}
    with tempfile.TemporaryDirectory() as folder:
        for noise in _NOISES:
            for seed in seeds:
                found = experiment(seed, noise, Path(folder) / f"{noise}-{seed}")
                gyros[noise][str(seed)] = rounded(found.figures(whole=seed == SEEDS[0]), _DIGITS)
                series = series or _series(found)
    samples = len(series["measured"][ENVIRONMENTS[0]])
    return {"made_with": made_with(), "gyros": gyros, "samples": samples, "figures": checksum(series)}, series


def _series(result: Experiment) -> Series:
    """Means over 100 s that the figures show, deg/h: measured, and what each model says."""
    cells = {"measured": result.cells["constant"], **{name: result.cells[name] for name in _SERIES}}
    return {
        name: {
            environment: np.round(cell.before if name == "measured" else cell.predicted, _SERIES_DIGITS).tolist()
            for environment, cell in of.items()
        }
        for name, of in cells.items()
    }


def departures(recorded: Mapping[str, Any], now: Mapping[str, Any]) -> Iterator[str]:
    """Where what was measured now departs from the record by more than is allowed; only gyros measured now count."""
    same = recorded["made_with"] == now["made_with"]
    for noise, gyros in now["gyros"].items():
        for seed, figures in gyros.items():
            there = recorded["gyros"].get(noise, {}).get(seed, {})
            for place, was, found in _pairs(there, figures, f"{noise} noise, gyro {seed}"):
                allowed = TOLERANCE if same and ", mrbf, " not in place else _TOLERANCE_ELSEWHERE
                # A mean may be 0: it is measured by the noise of the test runs.
                size = figures["floor_dph"] if place.endswith(", mean_dph") else abs(found)
                if was is None or not abs(found - was) <= allowed * size:
                    yield f"{place}: {was} recorded, {found} now; allowed {allowed:g} of it"


def _pairs(was: Any, now: Mapping[str, Any], place: str) -> Iterator[tuple[str, Any, Any]]:
    for key, value in now.items():
        before = was.get(key) if isinstance(was, Mapping) else None
        if isinstance(value, Mapping):
            yield from _pairs(before, value, f"{place}, {key}")
        else:
            yield f"{place}, {key}", before, value


_RUN = "5 C/min"


def record_of(docs: Path) -> dict[str, Any]:
    """Return the record docs/results/paper.json."""
    found = read_record(docs, "paper")
    assert found is not None
    return found


def page_of(docs: Path, record: Mapping[str, Any]) -> str:
    """docs/paper.md with its tables made from the record."""
    accuracy = read_record(docs, "accuracy")
    tables = accuracy["speed"]["learning"] if accuracy else []
    rows: list[dict[str, Any]] = next((table["rows"] for table in tables if table["scenario"] == "paper"), [])
    return filled((docs / "paper.md").read_text("utf-8"), parts(record, rows))


def stale(docs: Path) -> Iterator[str]:
    """Yield what of the page and its figures is not made from the record beside them."""
    record = record_of(docs)
    there, made = (docs / "paper.md").read_text("utf-8"), page_of(docs, record)
    for old, new in zip(there.splitlines(), made.splitlines(), strict=False):
        if old != new:
            yield f"{docs / 'paper.md'}: {old!r}; the record gives {new!r}"
    if there.count("\n") != made.count("\n"):
        yield f"{docs / 'paper.md'}: {there.count(chr(10))} lines; the record gives {made.count(chr(10))}"
    for number in FIGURES:
        path = docs / "paper" / f"figure-{number:02d}.png"
        if not path.exists() or record["figures"].encode() not in path.read_bytes():
            yield f"{path}: does not show the series that the record is of"


def write(docs: Path) -> None:
    """Writes record, tables, `docs/paper/`, and one run into `docs/simulation/`."""
    record, series = measured()
    write_record(docs, "paper", record)
    write_atomically(docs / "paper.md", page_of(docs, record))
    draw(series, docs / "paper")
    plan = with_noise(read("paper-5C-min")[1], "paper")
    draw_run(next(iter(simulate_campaign(plan, SEEDS[0]))), f"Chamber at {_RUN}", docs / "simulation" / "run.png")
    print(f"{docs / 'paper.md'} and the figures beside it")


def main() -> int:
    """0: done, or all is as recorded; 1: something is not."""
    parser = argparse.ArgumentParser(prog="bench.paper.page", description=__doc__.splitlines()[0])
    parser.add_argument("docs", type=Path)
    parser.add_argument("--check", action="store_true", help="measure again and compare; write nothing")
    arguments = parser.parse_args()
    if not arguments.check:
        write(arguments.docs)
        return 0
    wrong = [*stale(arguments.docs), *departures(record_of(arguments.docs), measured()[0])]
    for line in wrong:
        print(line, file=sys.stderr)
    print(f"docs/paper.md: {len(wrong)} departures" if wrong else "docs/paper.md: as measured now")
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
