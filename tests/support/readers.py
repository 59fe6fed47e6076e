"""Every reader of gyrotc with whole files to start from: what `mutants` damages."""

from __future__ import annotations

import json
import shutil
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from unittest.mock import patch

import gyrotc.pages.report as pages
import numpy as np
from gyrotc.assess import Earlier, budget_of, changes_since, evaluate, held_against, load_limits
from gyrotc.common import average_rows
from gyrotc.diagnose import diagnose, records_of, series_of
from gyrotc.fleet import load_manifest
from gyrotc.model import load_model
from gyrotc.pages import write_diagnosis_page
from gyrotc.quality import check, judge
from gyrotc.recordings import load
from gyrotc.results import DeclaredUnits, Evaluation, Manifest, read_result
from gyrotc.simulate import read as read_scenario
from gyrotc.simulate import simulate, simulated_floor
from gyrotc.tables import RECORD, emit, quantise, read_options
from gyrotc.train import FitOptions, fit_dataset, run_blocks
from gyrotc.verify import compared_words, log_parts, verify
from mutation import Form
from recordings import columns, columns_of_pulses, csv_text, toml, write_parquet

ROOT = Path(__file__).resolve().parents[2]
PICTURES_EVERY = 50  # drawing takes a second
_TRACED = ("bias_against_temperature", "_bias_over_time")
_DRAWN = ("map_with_centers", "curve_by_size", "prior_and_posterior", "allan_deviation", "_trend")
_PICTURES = dict.fromkeys((*_TRACED, *_DRAWN), lambda *_: None) | {"residual_pictures": lambda *_: ()}
SCENARIO = """title = "small"
[profile.a]
start_c = 20.0
record_min = 120
steps = [{ramp_to_c = 60.0, c_per_min = 2.0}, {hold_min = 10},
  {nested_c = 10.0, half_ranges_c = [20.0], c_per_min = 3.0}]
[[channel]]
name = "volts"
level = 5.0
[[cause]]
id = "auxiliary"
channel = "volts"
slope_dph_per_unit = 0.01
reference = 5.0
[[set]]
role = "train"
started = 2026-03-02T08:00:00Z
profiles = ["a", "a"]
[[set]]
role = "exam"
started = 2026-03-05T08:00:00Z
profiles = ["a"]
"""
DESCRIPTION = toml(
    'file = "a.csv"\nrole = "train"\nenvironment = "ramp"\nstarted = 2026-03-01T08:00:00Z\npower_on_s = -60.0\n'
    "from_s = 0.0\nto_s = 900.0\nexclude = [{from_s = 10.0, to_s = 12.0, reason = 'door'}]\n"
    "axis_azimuth_deg = 12.0\naxis_elevation_deg = 3.0",
    head='schema = 1\nserial = "RLG-0042"\ndescription = "six"\nearth_rate = "compute"\nlatitude_deg = 50.0',
    tail='[meta]\noperator = "A. Berg"\nnested = {a = [1, 2.5, "x"]}\n[noise]\narw_deg_per_sqrt_h = 0.001\n'
    '[columns]\ntime = "time_s"\n',
)
MANIFEST = """schema = 1
axis = "x"
numeric = ["f32"]
datasets = ["RLG*"]
[options]
method = "mrbf"
seed = 3
centers = 5
block_s = 10.0
average_s = 100.0
[[unit]]
dataset = "other"
axis = "all"
"""


@dataclass(frozen=True)
class Reader:
    """How a kind of file is read, its form, and whole ones."""

    read: Callable[[bytes], None]
    form: Form
    seeds: list[bytes]


def log_text() -> str:
    """What a board prints, with results of both kinds and costs."""
    rows = "\n".join(f"{k * 2654435761 % 2**32:08x} {k * 40503 % 2**32:08x}" for k in range(300))
    cost = "cost map 0000000a 00000010 00000020 00000000 00000100 00000040"
    return (
        f"board stm32\nbegin rlg_1 f32 all 12345678 00000010\n{rows}\nend 0000012c\n{cost}\ndone\nhello\n"
        f"begin rlg_1 q31 crc 12345678 00000010\n01234567\n89abcdef\nend 0000012c\n{cost}\ndone\n"
    )


def make_seeds(folder: Path) -> None:
    """Fills a folder with a data set and everything that a build writes beside a compiler."""
    (folder / "small.toml").write_text(SCENARIO, "utf-8")
    simulate(folder / "small.toml", seed=1, out=folder / "data", row_s=30.0)
    dataset = load(folder / "data")
    out = folder / "result"
    fitted = fit_dataset(dataset, FitOptions())
    emit(fitted.model, out)
    (out / "training.json").write_text(json.dumps(fitted.training.content()))
    verification = verify(out, compiled=False)
    evaluation = evaluate(out, dataset, trace=out / "trace", training=fitted.training, compiled=False)
    limits = ROOT / "docs" / "limits.md"
    text = limits.read_text("utf-8").split("```toml")[1].split("```")[0]
    (folder / "limits.toml").write_text(text.replace('targets = ["cortex-m4f"]', "targets = []"), "utf-8")
    held = held_against(load_limits(folder / "limits.toml"), fitted.model, evaluation, verification)
    manifest = Manifest(
        gyrotc_version="0.1.0", serial="A", axis=None, model_hash="00", refused={"q31": "x"}, meta={},
        units=DeclaredUnits(declared={}, trusted=()), sources=(), versions={"numpy": "2"}, files={"c/gtc.h": "00"},
    )  # fmt: skip
    changes = changes_since(Earlier(out), fitted.model, evaluation, manifest)
    budget = budget_of(fitted.model, fitted.training, evaluation, verification)
    for name, content in (
        ("verify", verification.content()), ("evaluate", evaluation.content()), ("limits", held.content()),
        ("manifest", manifest.content()), ("changes", changes.content()),
        ("budget", budget.content()),
    ):  # fmt: skip
        (out / f"{name}.json").write_text(json.dumps(content))
    found = diagnose(dataset)
    series = series_of(found)
    assert series is not None
    (folder / "diagnose.json").write_text(json.dumps(found.result.content()))
    (folder / "series.json").write_text(json.dumps(series.content()))


READERS = (
    "csv", "parquet", "dataset.toml", "model.json", "limits.toml", "fleet.toml", "scenario.toml", "evaluate.json",
    "training.json", "verify.json", "manifest.json", "limits.json", "changes.json", "budget.json",
    "diagnose.json", "series.json",
    "truth.json", "noise.npy", "trace.csv", "board.log", "record",
)  # fmt: skip


def seeds_in(seeds: Path, folder: Path) -> dict[str, Reader]:
    """All readers, on the seeds of `make_seeds`, working in `folder`."""
    result = seeds / "result"
    folder.mkdir(parents=True, exist_ok=True)
    readers = {
        "csv": Reader(_recording(folder, "a.csv"), "text", [csv_text(columns(300)).encode(), _axes(), _pulses()]),
        "parquet": Reader(_recording(folder, "a.parquet"), "bytes", [_parquet(folder)]),
        "dataset.toml": Reader(_description(folder), "toml", [DESCRIPTION.encode()]),
        "model.json": Reader(_model(folder), "json", [(result / "model.json").read_bytes(), _example()]),
        "limits.toml": Reader(
            _file(folder / "limits.toml", load_limits), "toml", [(seeds / "limits.toml").read_bytes()]
        ),
        "fleet.toml": Reader(_manifest(folder), "toml", [MANIFEST.encode()]),
        "scenario.toml": Reader(_scenario(folder), "toml", [SCENARIO.encode()]),
        "diagnose.json": Reader(
            _page(folder, "diagnose.json", write_diagnosis_page), "json", [(seeds / "diagnose.json").read_bytes()]
        ),
        "series.json": Reader(_series(seeds, folder), "json", [(seeds / "series.json").read_bytes()]),
        "truth.json": _truth(seeds, folder, "truth.json", "json"),
        "noise.npy": _truth(seeds, folder, _noise_name(seeds), "bytes"),
        "trace.csv": Reader(_trace(result, folder), "text", [(result / "trace" / "run-01.csv").read_bytes()]),
        "board.log": Reader(_log(folder), "text", [log_text().encode()]),
        "record": Reader(_record(folder), "json", [(result / "c" / RECORD).read_bytes()]),
    }  # fmt: skip
    for name in ("evaluate", "training", "verify", "manifest", "limits", "changes", "budget"):
        readers[f"{name}.json"] = Reader(
            _report(result, folder, name), "json", [(result / f"{name}.json").read_bytes()]
        )
    return {name: readers[name] for name in READERS}


def _fresh(folder: Path, name: str) -> Path:
    work = folder / name
    shutil.rmtree(work, ignore_errors=True)
    work.mkdir(parents=True)
    return work


def _file(path: Path, read: Callable[[Path], Any]) -> Callable[[bytes], None]:
    def act(data: bytes) -> None:
        path.write_bytes(data)
        read(path)

    return act


def _axes() -> bytes:
    table = columns(200)
    rate = table.pop("rate_dph")
    volts = np.full(200, 5.0)
    return csv_text(
        table | {"rate_x_dph": rate, "rate_y_dph": -rate, "rate_z_dph": 2.0 * rate, "volts": volts}
    ).encode()


def _pulses() -> bytes:
    return csv_text(columns_of_pulses(), "{:g}").encode()


def _parquet(folder: Path) -> bytes:
    path = folder / "seed.parquet"
    write_parquet(path)
    return path.read_bytes()


def _example() -> bytes:
    return (ROOT / "examples" / "minimal" / "model.json").read_bytes()


def _used(folder: Path, axis: str | None = None) -> None:
    """A data set as `check`, `fit` and `diagnose` begin with it."""
    found = check(folder, axis=axis)
    json.dumps(found.result().content(), allow_nan=False)
    "\n".join(found.lines()).encode("utf-8")
    if found.problems:
        raise found.problems[0]
    dataset = load(folder, axis=axis)
    judged = judge(dataset)
    for run in dataset.runs:
        rows = run.rows()
        blocks = run_blocks(
            rows, run, judged.usable(run, rows), block_s=10.0, slope_blocks=6, max_step_c=0.5, max_rate_c_per_min=20.0
        )
        assert len(blocks.valid)
        inside = run.in_span(rows.time_s)
        average_rows(
            rows.time_s[inside], rows.temperature_c[inside], rows.rate_dph[inside], rows.rate_dph[inside],
            scored=np.ones(int(inside.sum()), dtype=bool), average_s=100.0,
        )  # fmt: skip
    records_of(dataset, "train", block_s=10.0, average_s=100.0)


def _recording(folder: Path, name: str) -> Callable[[bytes], None]:
    def read(data: bytes) -> None:
        work = _fresh(folder, "RLG-1")
        (work / name).write_bytes(data)
        if b"pulses" in data[:100]:
            run = f'file = "{name}"'
            (work / "dataset.toml").write_text(toml(run, head='schema = 1\nserial = "A"\npulse_weight_arcsec = 0.1'))
        _used(work, "y" if b"rate_y_dph" in data[:100] else None)

    return read


def _description(folder: Path) -> Callable[[bytes], None]:
    def read(data: bytes) -> None:
        work = _fresh(folder, "RLG-2")
        (work / "a.csv").write_text(csv_text(columns(150)))
        (work / "dataset.toml").write_bytes(data)
        _used(work)

    return read


def _model(folder: Path) -> Callable[[bytes], None]:
    def read(data: bytes) -> None:
        path = folder / "model.json"
        path.write_bytes(data)
        model = load_model(path)
        assert model.id and model.hash and model.to_json()
        model.map_dph(np.linspace(-300.0, 300.0, 7), 0.0)
        for numeric in ("f32", "q31"):
            quantise(model, numeric)

    return read


def _manifest(folder: Path) -> Callable[[bytes], None]:
    def read(data: bytes) -> None:
        work = _fresh(folder, "fleet")
        for name in ("RLG-1", "other"):
            (work / name).mkdir()
            (work / name / "a.csv").write_text(csv_text(columns(20)))
        (work / "fleet.toml").write_bytes(data)
        load_manifest(work / "fleet.toml")

    return read


def _scenario(folder: Path) -> Callable[[bytes], None]:
    def read(data: bytes) -> None:
        path = folder / "scenario.toml"
        path.write_bytes(data)
        read_scenario(path)

    return read


def _report(result: Path, folder: Path, name: str) -> Callable[[bytes], None]:
    number = 0

    def read(data: bytes) -> None:
        nonlocal number
        number += 1
        work = _fresh(folder, "report")
        for path in result.glob("*.json"):
            shutil.copyfile(path, work / path.name)
        (work / f"{name}.json").write_bytes(data)
        quick = _PICTURES if number % PICTURES_EVERY else {}
        with patch.multiple(pages, **quick):
            pages.write_report(work)
        Earlier(work)

    return read


def _series(seeds: Path, folder: Path) -> Callable[[bytes], None]:
    """The page of a diagnosis whose series are damaged."""

    def read(data: bytes) -> None:
        work = _fresh(folder, "drawn")
        shutil.copy(seeds / "diagnose.json", work / "diagnose.json")
        (work / "series.json").write_bytes(data)
        write_diagnosis_page(work)

    return read


def _page(folder: Path, name: str, write: Callable[[Path], Any]) -> Callable[[bytes], None]:
    def read(data: bytes) -> None:
        work = _fresh(folder, "page")
        (work / name).write_bytes(data)
        write(work)

    return read


def _noise_name(seeds: Path) -> str:
    return str(json.loads((seeds / "data" / "truth.json").read_text())["runs"][0]["noise"])


def _truth(seeds: Path, folder: Path, name: str, form: Form) -> Reader:
    whole = (seeds / "data" / name).read_bytes()

    def read(data: bytes) -> None:
        work = folder / "truth"
        if not work.exists():
            shutil.copytree(seeds / "data", work)
        (work / name).write_bytes(data)
        try:
            simulated_floor(work, ["run-01.csv", "run-02.csv"], 100.0)
        finally:
            (work / name).write_bytes(whole)

    return Reader(read, form, [whole])


def _trace(result: Path, folder: Path) -> Callable[[bytes], None]:
    run = read_result(result / "evaluate.json", Evaluation).runs[0]

    def read(data: bytes) -> None:
        work = _fresh(folder, "trace")
        (work / "run-01.csv").write_bytes(data)
        with pages.page_from(work):
            pages.trace_means(work, run, 100.0)

    return read


def _log(folder: Path) -> Callable[[bytes], None]:
    def read(data: bytes) -> None:
        path = folder / "board.log"
        path.write_bytes(data)
        for part in log_parts(path).parts:
            compared_words(part, np.zeros((300, 2), dtype=np.uint32))

    return read


def _record(folder: Path) -> Callable[[bytes], None]:
    def read(data: bytes) -> None:
        (folder / RECORD).write_bytes(data)
        read_options(folder)

    return read
