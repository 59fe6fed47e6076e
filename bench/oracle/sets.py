"""The sets of recordings, and the commands that each goes through. Recordings are simulated, measured, or written here.

Together they pass every cause of the simulation, every format that needs no further library, every reason to refuse a
data set, and the events that screening looks for. A set costs between a second and half a minute.
"""

from __future__ import annotations

import json
import re
import shutil
import sys
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from .steps import Steps

sys.path.append(str(Path(__file__).resolve().parents[2] / "tests" / "support"))

from logger_binaries import BINARY_CASES
from logger_files import CSV_CASES, truth
from logger_foreign import FOREIGN
from recordings import ACCEPTED, Columns, columns, write_csv
from refused_recordings import REFUSED


@dataclass(frozen=True)
class RecordingSet:
    """Recordings and what is done with them; `measured`: from the folder of measured recordings."""

    do: Callable[[Steps], None]
    measured: bool = False


def run_set(name: str, folder: Path, measured: Path) -> dict[str, Any]:
    """The outcomes of a set's steps by name; `folder` is made for it and removed."""
    folder.mkdir()
    steps = Steps(folder, measured)
    SETS[name].do(steps)
    shutil.rmtree(folder)
    return steps.outcomes


# The campaigns of `paper` and of `separating` with fewer runs, for sets in which the rest costs more.
_FEW = """extends = "{}"
title = "A short campaign"
[[set]]
role = "train"
started = 2026-03-02T08:00:00Z
every_h = 24.0
profiles = ["cold start 60 C", "nested loops", "fast full range"]
[[set]]
role = "exam"
started = 2026-03-16T08:00:00Z
profiles = ["slow staircase"]
"""
_PRODUCT = """schema = 1
product = "NAV"
[at_most]
rms_dph = 30.0
centers = 40
[at_least]
improvement = 1e6
[interval]
days = 365
drift_dph_per_year = 1e-4
[[instrument]]
name = "Pt100 SN 71"
certificate = "K-4711"
quantity = "temperature"
expanded_uncertainty = 0.04
"""
_LABORATORY = """schema = 1
laboratory = "North"
city = "Bremen"
country = "DE"
operator = "A. Berg"
customer = "Navigation GmbH"
customer_city = "Kiel"
customer_country = "DE"
manufacturer = "Maker"
type = "RLG 90"
procedure = "WI-7.3"
environment = "23 C"
calibrated_on = 2026-03-07
issued = 2026-03-20
"""


def _place(name: str) -> str:
    """A folder's name made of a case's."""
    return re.sub(r"[^0-9A-Za-z]+", "-", name)


def _text(name: str, text: str) -> Callable[[Path], object]:
    return lambda folder: (folder / name).write_text(text, "utf-8")


def _paper(s: Steps) -> None:
    """All that can be done with one unit without a compiler."""
    s.run("simulate", "paper", "--seed", 1, "--out", "data")
    s.run("check", "data", "--json", "check.json")
    s.run("fit", "data", "--out", "result")
    s.run("emit", "result/model.json", "--out", "result")
    s.run("evaluate", "result", "data", "--trace", "result/trace")
    s.run("report", "result")
    s.run("diagnose", "data", "--out", "diagnosis")
    s.run("compare", "data", "--out", "comparison", "--quiet")  # it prints how long training took
    s.run(
        "emit",
        "result/model.json",
        "--out",
        "shifted",
        "--zero-at",
        25,
        "--numeric",
        "q31",
        name="emit shifted",
    )
    for form in ("csv", "json"):
        s.run("emit", "result/model.json", "--out", "mapped", "--map", f"map.{form}", name=f"emit a map as {form}")
    s.run("schema")


def _unit(s: Steps) -> None:
    """A unit from its recordings to the certificate: builds with limits, verification, recalibration."""
    s.write(lambda f: [_text(n, t)(f) for n, t in (("product.toml", _PRODUCT), ("facts.toml", _LABORATORY),
                                                   ("few.toml", _FEW.format("separating")))])  # fmt: skip
    s.run("simulate", "few.toml", "--seed", 4, "--out", "data")
    s.run("build", "data", "--out", "result", "--limits", "product.toml")
    s.run("verify", "result", "--target", "host-gcc-O2")
    accepted, facts = ("--accept-fail", "the only unit at hand"), ("--facts", "facts.toml")
    for name, options in {
        "certificate": (*facts, *accepted, "--out", "certificate"),
        "certificate of a FAIL": (*facts, "--out", "refused"),
        "certificate without facts": (*accepted, "--out", "refused"),
        "certificate as a draft": (*accepted, "--draft", "--out", "draft"),
    }.items():
        s.run("certificate", "result", "--number", "2026-0042", *options, name=name)
    s.run("simulate", "paper-20C", "--seed", 4, "--out", "check-run", name="simulate a check run")
    again = ("build", "check-run", "--prior", "result", "--limits", "product.toml")
    s.run(*again, "--out", "confirmed", name="build from a check run")
    s.run("check", "data", "--previous", "result")
    s.write(_fit('method = "bank"'), name="state the method bank")
    s.run("fit", "data", "--out", "bank", name="fit a bank")
    s.run("emit", "bank/model.json", "--out", "bank", name="emit a bank")


def _extended(s: Steps) -> None:
    """A build with the causes that are found."""
    s.run("simulate", "two-causes", "--seed", 2, "--out", "data")
    s.run("diagnose", "data", "--out", "diagnosis")
    s.run("build", "data", "--extend", "--numeric", "q31", "--out", "result")


_CLASS = """[noise]
arw_deg_per_sqrt_h = 2e-3
bias_instability_dph = 1e-3
rate_random_walk_dph_per_sqrt_h = 2e-4
quantum_arcsec = 0.5
"""


def _fit(line: str) -> Callable[[Path], object]:
    """State `[fit]` at the end of the description in `data`, in place of an earlier one."""

    def do(folder: Path) -> object:
        path = folder / "data" / "dataset.toml"
        return path.write_text(f"{path.read_text('utf-8').partition(_FIT)[0]}{_FIT}{line}\n", "utf-8")

    return do


_FIT = "\n[fit]\n"


def _simulated(scenario: str, *, seed: int, noise: str = "", few: bool = True) -> Callable[[Steps], None]:
    """Check, fit, emit and diagnosis of a scenario; `few`: four runs of eight hours, with this noise."""

    def do(s: Steps) -> None:
        if few:
            s.write(_text("few.toml", _FEW.format(scenario) + noise), name="scenario")
        source = "few.toml" if few else scenario
        s.run("simulate", source, "--seed", seed, "--out", "data")
        s.run("check", "data", "--json", "check.json")
        s.run("fit", "data", "--out", "result")
        s.run("emit", "result/model.json", "--out", "result")
        s.run("diagnose", "data", "--out", "diagnosis")

    return do


def _channels(s: Steps) -> None:
    """Recorded channels as inputs of the map."""
    s.write(_text("few.toml", _FEW.format("signals")), name="scenario")
    s.run("simulate", "few.toml", "--seed", 1, "--out", "data")
    s.run("check", "data", "--json", "check.json")
    s.write(_fit("channels = true"), name="state channels")
    s.run("fit", "data", "--out", "result")
    s.run("emit", "result/model.json", "--out", "result")
    s.run("evaluate", "result", "data")


def _pulses(s: Steps) -> None:
    """Counts of pulses in Parquet files, and the options of training."""
    s.write(_text("few.toml", _FEW.format("separating")), name="scenario")
    s.run("simulate", "few.toml", "--seed", 6, "--pulses", "--format", "parquet", "--raw-hz", 0.05, "--out", "data")
    s.run("check", "data", "--json", "check.json")
    for method in ("constant", "linear", "cubic", "cubic_slope", "mrbf_t", "mrbf", "bank"):
        s.write(_fit(f'method = "{method}"'), name=f"state the method {method}")
        s.run("fit", "data", "--out", method, name=f"fit {method}")


_CYCLES = """title = "Two short cycles"
[profile.slow]
start_c = 0.0
record_min = 120
steps = [{ramp_to_c = 40.0, c_per_min = 1.0}, {hold_min = 20}, {ramp_to_c = -20.0, c_per_min = 2.0}, {hold_min = 30}]
[profile.fast]
start_c = 0.0
record_min = 90
steps = [{repeat = [
  {ramp_to_c = 40.0, c_per_min = 5.0}, {hold_min = 15}, {ramp_to_c = -20.0, c_per_min = 5.0}, {hold_min = 15}]}]
[[set]]
started = 2026-01-01T00:00:00Z
"""


def _lot(s: Steps) -> None:
    """A fleet, what its units share, and a new unit of the lot with one short run."""
    runs = {"whole": '"slow", "fast", "slow"', "short": '"fast"'}
    s.write(lambda f: [_text(f"{n}.toml", f"{_CYCLES}profiles = [{p}]\n")(f) for n, p in runs.items()])
    lot = ("--seed", 5, "--format", "parquet")
    s.run("simulate", "whole.toml", *lot, "--units", 9, "--out", "whole")
    s.run("simulate", "short.toml", *lot, "--units", 10, "--out", "short", name="simulate a new unit")
    s.write(_reversed_unit, name="a unit with its sign reversed")
    s.run("fleet", "whole", "--out", "fleet", "--jobs", 1)
    s.run("lot", "fleet", "--out", "lot.json")
    unit = "short/LOT-0005-010"
    s.run("build", unit, "--lot", "lot.json", "--out", "with-lot")
    s.run("diagnose", unit, "--lot", "lot.json", "--out", "diagnosis")


def _reversed_unit(folder: Path) -> None:
    """A unit that a fleet should name."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    for path in sorted((folder / "whole" / "LOT-0005-002").glob("*.parquet")):
        table = pq.read_table(path)
        rates = pa.array(-table.column("rate_dph").to_numpy())
        at = table.column_names.index("rate_dph")
        pq.write_table(table.set_column(at, "rate_dph", rates), path)


def _measured(folder: str, axis: str, *commands: str) -> RecordingSet:
    def do(s: Steps) -> None:
        s.write(lambda f: shutil.copytree(s.measured / folder, f / "data", ignore=shutil.ignore_patterns("raw")))
        s.run("check", "data", "--json", "check.json")
        if "fit" in commands:
            s.run("fit", "data", "--axis", axis, "--out", "result")
            s.run("emit", "result/model.json", "--out", "result")
        if "diagnose" in commands:
            s.run("diagnose", "data", "--axis", axis, "--out", "diagnosis")

    return RecordingSet(do, measured=True)


def _accepted(s: Steps) -> None:
    """Small recordings in every accepted form."""
    for name, make in ACCEPTED.items():
        place = _place(name)
        s.write(lambda f, make=make, place=place: _made(make, f / place / "RLG-1"), name=f"recordings: {name}")
        s.run("check", f"{place}/RLG-1", "--json", f"{place}/check.json", name=f"check: {name}")
        s.run("fit", f"{place}/RLG-1", "--out", f"{place}/result", name=f"fit: {name}")


def _made(make: Callable[[Path], object], folder: Path) -> None:
    folder.parent.mkdir()
    make(folder)


def _refused(s: Steps) -> None:
    """One thing wrong in each."""
    for name, case in REFUSED.items():
        place = _place(name)
        s.write(lambda f, c=case, p=place: _made(c.make, f / p / c.folder), name=f"recordings: {name}")
        s.run("check", f"{place}/{case.folder}", "--json", f"{place}/check.json", name=f"check: {name}")
        s.run("fit", f"{place}/{case.folder}", "--out", f"{place}/result", name=f"fit: {name}")


def _long(seed: int, hours: float = 8.0) -> Columns:
    """A run with two cycles of temperature and a bias that follows temperature and its rate."""
    draw = np.random.default_rng(seed)
    time = np.arange(0.0, 3600.0 * hours, 10.0)
    temperature = np.interp(time / 3600.0, [0, 1, 2, 4, 5, 6, 8], [20, 20, 60, 60, -30, -30, 50])
    temperature += 0.01 * draw.standard_normal(time.size)
    rate = 0.01 + 2e-4 * temperature + 1e-6 * temperature**2 + 2.2e-3 * draw.standard_normal(time.size)
    return {"time_s": time, "temperature_c": temperature, "rate_dph": rate}


def _where(c: Columns, first: int, last: int) -> Any:
    rows = np.arange(c["time_s"].size)
    return (rows >= first) & (rows < last)


def _with(c: Columns, **changed: Any) -> Columns:
    return {name: np.asarray(values, dtype=float) for name, values in (c | changed).items()}


#: What happens to the second of three runs.
EVENTS: dict[str, Callable[[Columns], Columns]] = {
    "step": lambda c: _with(c, rate_dph=c["rate_dph"] + 0.01 * _where(c, 1500, 9999)),
    "drift at the beginning": lambda c: _with(c, rate_dph=c["rate_dph"] + 0.05 * np.exp(-c["time_s"] / 1200.0)),
    "spikes": lambda c: _with(c, rate_dph=c["rate_dph"] + 0.2 * (np.arange(c["time_s"].size) % 397 == 5)),
    "sign reversed": lambda c: _with(c, rate_dph=-c["rate_dph"]),
    "sign reversed within": lambda c: _with(c, rate_dph=np.where(_where(c, 900, 9999), -1, 1) * c["rate_dph"]),
    "another scale": lambda c: _with(c, rate_dph=1.5 * c["rate_dph"]),
    "saturated": lambda c: _with(c, rate_dph=np.clip(c["rate_dph"], 0.008, 0.02)),
    "rate stuck": lambda c: _with(c, rate_dph=np.where(_where(c, 700, 1000), 0.0125, c["rate_dph"])),
    "thermometer stuck": lambda c: _with(c, temperature_c=np.where(_where(c, 700, 1400), 47.0, c["temperature_c"])),
    "thermometer jumps": lambda c: _with(c, temperature_c=c["temperature_c"] + 8.0 * _where(c, 1200, 9999)),
    "thermometer off": lambda c: _with(c, temperature_c=c["temperature_c"] + 3.0),
    "noise doubled": lambda c: _with(c, rate_dph=c["rate_dph"] + 5e-3 * np.sin(1e3 * c["time_s"] ** 1.1)),
    "coarse rate": lambda c: _with(c, rate_dph=np.round(c["rate_dph"], 2)),
    "coarse temperature": lambda c: _with(c, temperature_c=np.round(c["temperature_c"])),
    "time jumps": lambda c: _with(c, time_s=c["time_s"] + 3600.0 * _where(c, 900, 9999)),
    "time drifts": lambda c: _with(c, time_s=np.cumsum(np.where(_where(c, 0, 1400), 10.0, 9.8)) - 10.0),
    "gap": lambda c: {name: np.delete(values, np.arange(500, 700)) for name, values in c.items()},
    "fahrenheit": lambda c: _with(c, temperature_c=c["temperature_c"] * 1.8 + 32.0),
    "rate in deg/s": lambda c: _with(c, rate_dph=c["rate_dph"] / 3600.0),
    "copy of the first run": lambda c: _long(1),
    "a channel that is a copy": lambda c: c | {"case_c": c["temperature_c"]},
}


def _events(s: Steps) -> None:
    """Recordings that are read, and of which something is doubtful."""
    for name, change in EVENTS.items():
        place = _place(name)

        def make(folder: Path, change: Any = change, place: str = place) -> None:
            for k in range(3):
                write_csv(folder / place / f"{k}.csv", change(_long(k + 1)) if k == 1 else _long(k + 1))

        s.write(make, name=f"recordings: {name}")
        s.run("check", place, "--json", f"{place}.json", name=f"check: {name}")
        s.run("fit", place, "--out", f"{place}-result", name=f"fit: {name}")
    for name in ("step", "spikes"):
        s.run("diagnose", name, "--out", f"{name}-found", name=f"diagnose: {name}")


def _graded(s: Steps) -> None:
    """Outliers of 3 to 12 times the noise of a row, so that no limit between can move without a changed result."""

    def make(folder: Path) -> None:
        for k in range(3):
            run = _long(k + 1)
            run["rate_dph"][5::29] += 2.2e-3 * np.linspace(3.0, 12.0, run["rate_dph"][5::29].size)
            write_csv(folder / "data" / f"{k}.csv", run)

    s.write(make)
    s.run("check", "data", "--json", "check.json")
    s.run("fit", "data", "--out", "result")


def _axes(s: Steps) -> None:
    """Three axes in one file, two of them exchanged in one run."""

    def make(folder: Path) -> None:
        for k in range(4):
            table = columns(600, seed=k + 1)
            draw, rate = np.random.default_rng(k), table.pop("rate_dph")
            x, y, z = (rate * scale + draw.normal(0.0, 0.01, 600) for scale in (0.1, -0.05, 0.02))
            x, y = (x, y) if k != 2 else (y, x)
            rates = {"rate_x_dph": x, "rate_y_dph": y, "rate_z_dph": z}
            write_csv(folder / "data" / f"{k}.csv", table | rates)

    s.write(make)
    s.run("check", "data", "--json", "check.json")
    s.run("build", "data", "--axis", "all", "--numeric", "f32", "--out", "result")
    s.run("certificate", "result", "--number", "7", "--out", "draft", "--draft")


def _imported(s: Steps) -> None:
    """A file of each format that needs no further library."""
    seen = truth()
    for case in (case for case in (*CSV_CASES, *FOREIGN, *BINARY_CASES) if not case.needs):
        file = Path(_place(case.id)) / case.file

        def make(folder: Path, case: Any = case, file: Path = file) -> None:
            (folder / file).parent.mkdir()
            case.write(folder / file, seen)
            if file.suffix == ".mat":
                _undated(folder / file)

        s.write(make, name=f"file: {case.id}")
        s.run("import", file, "--out", file.parent / "RLG-1", *case.options, name=case.id)


def _undated(path: Path) -> None:
    """The time in the first line of a MATLAB file, which its writer takes from the clock, replaced."""
    data = path.read_bytes()
    path.write_bytes(b"MATLAB 5.0 MAT-file".ljust(116) + data[116:])


def _wrong(s: Steps) -> None:
    """Options, manifests, scenarios and results that are refused."""
    s.write(lambda f: write_csv(f / "RLG-1" / "a.csv", _long(1)))
    s.write(_text("fleet.toml", 'schema = 1\ndatasets = ["RLG-*"]\n[options]\nrho = 2.0\n'), name="manifest")
    negative = 'title = "x"\n[profile.a]\nstart_c = 20.0\nrecord_min = -1\nsteps = []\n'
    s.write(_text("bad.toml", negative), name="scenario")
    s.run("fit", "RLG-1", "--out", "result")
    s.run("emit", "result/model.json", "--out", "result")
    for words in (
        ("fit", "RLG-1", "--axis", "x"), ("fit", "nowhere"), ("build", "RLG-1", "--lot", "none.json"),
        ("build", "RLG-1", "--prior", "none"), ("build", "RLG-1", "--numeric", "f99"),
        ("build", "RLG-1", "--limits", "bad.toml"),
        ("fleet", "fleet.toml", "--out", "fleet"), ("fleet", "nowhere", "--out", "fleet"),
        ("simulate", "bad.toml", "--out", "made"), ("simulate", "nothing", "--out", "made"),
        ("lot", "nowhere", "--out", "lot.json"),
        ("import", "RLG-1/a.csv", "--out", "made", "--rate-unit", "apples"),
        ("certificate", "result", "--number", "1", "--out", "made"), ("verify", "nowhere"), ("schema", "nothing"),
        ("emit", "bad.toml"), ("report", "nowhere"), ("x",),
    ):  # fmt: skip
        out = () if words[0] not in ("fit", "build") else ("--out", "made")
        s.run(*words, *out, name=" ".join(words))
    s.write(_changed_model, name="a model changed by hand")
    s.run("emit", "changed.json", "--out", "changed", name="emit the changed model")
    s.write(
        lambda f: next((f / "result" / "c").glob("gtc_*.h")).write_text("int x;\n"),
        name="a table changed by hand",
    )
    s.run("verify", "result", "--target", "host-gcc-O2")


def _changed_model(folder: Path) -> None:
    model = json.loads((folder / "result" / "model.json").read_text("utf-8"))
    (folder / "changed.json").write_text(json.dumps(model | {"seed": 99}), "utf-8")


#: All sets by name; those that take longest begin, so that two processes end at about the same time.
SETS: dict[str, RecordingSet] = {
    "extended": RecordingSet(_extended),
    "events": RecordingSet(_events),
    "paper": RecordingSet(_paper),
    "atoms3-mpu6886-heating": _measured("atoms3-mpu6886-heating", "x", "fit", "diagnose"),
    "unit": RecordingSet(_unit),
    "lot": RecordingSet(_lot),
    "axes": RecordingSet(_axes),
    "mpu6000-chamber-cycle": _measured("mpu6000-chamber-cycle", "y", "fit", "diagnose"),
    "channels": RecordingSet(_channels),
    "ripple": RecordingSet(_simulated("paper-ripple-strong", seed=2, few=False)),
    "separating": RecordingSet(_simulated("separating", seed=3, noise=_CLASS)),
    "hysteresis": RecordingSet(_simulated("hysteresis", seed=1)),
    "warm-up": RecordingSet(_simulated("warm-up", seed=2)),
    "cavity-lag": RecordingSet(_simulated("cavity-lag", seed=3)),
    "thermal-gradient": RecordingSet(_simulated("thermal-gradient", seed=4)),
    "turn-on-offset": RecordingSet(_simulated("turn-on-offset", seed=5)),
    "power-on-temperature": RecordingSet(_simulated("power-on-temperature", seed=6)),
    "ageing": RecordingSet(_simulated("ageing", seed=7)),
    "supply-voltage": RecordingSet(_simulated("supply-voltage", seed=8)),
    "sensor-lag": RecordingSet(_simulated("sensor-lag", seed=9)),
    "pulses": RecordingSet(_pulses),
    "mpu6050-isothermal": _measured("mpu6050-isothermal", "z", "fit", "diagnose"),
    "pan-lsm6dsm-cold": _measured("pan-lsm6dsm-cold", "x", "fit", "diagnose"),
    "graded": RecordingSet(_graded),
    "imported": RecordingSet(_imported),
    "accepted": RecordingSet(_accepted),
    "refused": RecordingSet(_refused),
    "wrong": RecordingSet(_wrong),
}
