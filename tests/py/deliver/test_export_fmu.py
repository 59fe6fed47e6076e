"""The unit of co-simulation: the bits of the reference over a run with every fault, through any importer."""

from __future__ import annotations

import ctypes
import io
import platform
import shutil
import subprocess
import sys
import zipfile
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
import pytest
from conftest import ROOT, Command, quick_and_slow
from emitted import emitted
from gyrotc.common.errors import CheckFailed, InputError
from gyrotc.deliver.export import export
from gyrotc.jobs.release import joint_texts
from gyrotc.mirror.front_end import samples_per_block
from gyrotc.mirror.history import Replay, replay
from gyrotc.model import Model, load_model
from gyrotc.results.marker import MARKER
from gyrotc.tables.quantise import quantise
from gyrotc.tables.rounding import channel_names
from gyrotc.tables.text import example_period_us
from models import bank_with_channels, random_channels, random_history
from numpy.typing import NDArray

HERE = f"{platform.machine()}-linux"
pytestmark = pytest.mark.skipif(
    sys.platform != "linux" or platform.machine() not in ("x86_64", "aarch64") or shutil.which("gcc") is None,
    reason="a binary is made on Linux with gcc only",
)
_OK, _ERROR = 0, 3
_LOG = ctypes.CFUNCTYPE(None, ctypes.c_void_p, ctypes.c_int, ctypes.c_char_p, ctypes.c_char_p)
_SEED, _ROWS = 11, 1500


@pytest.fixture(scope="module")
def plain(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = emitted(tmp_path_factory.mktemp("plain"), load_model(ROOT / "tests" / "c" / "model.json"))
    export(folder, "fmu", folder / "gyro.fmu")
    return folder


@pytest.fixture(scope="module")
def channels(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A bank with terms and two auxiliary channels."""
    model = bank_with_channels(load_model(ROOT / "examples" / "minimal" / "model.json"))
    folder = emitted(tmp_path_factory.mktemp("channels"), model)
    export(folder, "fmu", folder / "gyro.fmu")
    return folder


class Imported:
    """An importer of the standard's own words: the library, loaded, and the variables by name."""

    def __init__(self, path: Path, folder: Path) -> None:
        self.folder = folder
        with zipfile.ZipFile(path) as archive:
            archive.extractall(folder)
        self.root = ElementTree.parse(folder / "modelDescription.xml").getroot()
        name = self.root.find("CoSimulation").attrib["modelIdentifier"]  # type: ignore[union-attr]
        self.library = ctypes.CDLL(str(folder / "binaries" / HERE / f"{name}.so"))
        self.refs = {v.attrib["name"]: int(v.attrib["valueReference"]) for v in self.root.findall("ModelVariables/*")}
        self.said: list[str] = []
        self._log = _LOG(lambda _e, _s, _c, text: self.said.append(text.decode()))

    def instance(self, token: str | None = None) -> Any:
        make = self.library.fmi3InstantiateCoSimulation
        make.restype = ctypes.c_void_p
        asked = self.root.attrib["instantiationToken"] if token is None else token
        made = make(
            b"gyro", asked.encode(), None, ctypes.c_bool(False), ctypes.c_bool(False), ctypes.c_bool(False),
            ctypes.c_bool(False), None, ctypes.c_size_t(0), None, self._log, None,
        )  # fmt: skip
        return ctypes.c_void_p(made) if made else None

    def value(self, call: str, unit: Any, name: str, kind: Any, value: float | None = None) -> tuple[int, Any]:
        refs, values = ((ctypes.c_uint32 * 1)(self.refs[name]), (kind * 1)(*(() if value is None else (value,))))
        done = getattr(self.library, f"fmi3{call}")(unit, refs, ctypes.c_size_t(1), values, ctypes.c_size_t(1))
        return done, values[0]

    def step(self, unit: Any, at: float, size: float) -> int:
        flags, last = (ctypes.c_bool * 3)(), ctypes.c_double()
        places = [ctypes.byref(flags, k) for k in range(3)]
        done: int = self.library.fmi3DoStep(
            unit, ctypes.c_double(at), ctypes.c_double(size), ctypes.c_bool(True), *places, ctypes.byref(last)
        )
        return done

    def started(self, period_us: int | None = None) -> Any:
        unit = self.instance()
        if period_us is not None:
            assert self.value("SetUInt32", unit, "sample_period_us", ctypes.c_uint32, period_us)[0] == _OK
        assert self.library.fmi3ExitInitializationMode(unit) == _OK
        return unit


def history(model: Model) -> tuple[NDArray[np.float32], int, Replay]:
    """Samples of a run with every fault, shape (n, channels); the samples of a block; what the reference answers."""
    table = quantise(model, "f32")
    period_us = 20 * example_period_us(model)  # blocks of 50 samples, so that the run has some
    per_block = samples_per_block(model.block_s, period_us / 1e6)
    temperature, _ = random_history(model, _SEED, _ROWS, per_block)
    names = channel_names(model)
    extra = random_channels(model, _SEED, _ROWS) if names else np.zeros((_ROWS, 0))
    rows = np.concatenate([temperature[:, None], extra], axis=1)
    with np.errstate(over="ignore"):
        rows = rows.astype(np.float32)
    none = np.zeros(_ROWS, dtype=np.int64)
    answers = replay(table, rows.view(np.uint32), missed=none, samples_per_block=per_block)
    return rows, period_us, answers


def bits(values: Any) -> NDArray[np.uint32]:
    return np.array(values, dtype=np.float32).view(np.uint32)


@pytest.mark.parametrize("which", quick_and_slow(["channels"], ["plain"]))
def test_every_step_gives_the_references_bits(which: str, request: pytest.FixtureRequest, tmp_path: Path) -> None:
    folder: Path = request.getfixturevalue(which)
    model = load_model(folder / "model.json")
    rows, period_us, answers = history(model)
    gyro = Imported(folder / "gyro.fmu", tmp_path)
    unit = gyro.started(period_us)
    names = ["temperature_c", *channel_names(model)]
    found = []
    for k, row in enumerate(rows):
        for name, reading in zip(names, row, strict=True):
            assert gyro.value("SetFloat32", unit, name, ctypes.c_float, float(reading))[0] == _OK
        assert gyro.step(unit, k * period_us * 1e-6, period_us * 1e-6) == _OK
        sigma = "sigma_dph" if answers.sigma is not None else "bias_dph"
        found.append(
            (
                gyro.value("GetFloat32", unit, "bias_dph", ctypes.c_float)[1],
                gyro.value("GetInt32", unit, "status", ctypes.c_int32)[1],
                gyro.value("GetFloat32", unit, sigma, ctypes.c_float)[1],
            )
        )
    bias, status, sigmas = zip(*found, strict=True)
    assert len(set(status)) > 4 and len(set(bias)) > 20, "the run has faults and blocks"
    assert np.array_equal(bits(bias), answers.bits) and np.array_equal(status, answers.status)
    assert ("sigma_dph" in gyro.refs) == (answers.sigma is not None)
    if answers.sigma is not None:
        assert np.array_equal(bits(sigmas), answers.sigma)
    gyro.library.fmi3FreeInstance(unit)


def test_a_long_step_takes_a_sample_for_each_period_and_a_state_is_taken_back(plain: Path, tmp_path: Path) -> None:
    gyro = Imported(plain / "gyro.fmu", tmp_path)
    period_s = example_period_us(load_model(plain / "model.json")) * 1e-6

    def ended(*steps: int) -> bytes:
        unit = gyro.started()
        saved = ctypes.c_void_p()
        at = 0
        for k, count in enumerate(steps):
            gyro.value("SetFloat32", unit, "temperature_c", ctypes.c_float, 20.0)
            assert gyro.step(unit, at * period_s, count * period_s) == _OK
            at += count
            if k == 0:
                assert gyro.library.fmi3GetFMUState(unit, ctypes.byref(saved)) == _OK
        before = gyro.value("GetFloat32", unit, "bias_dph", ctypes.c_float)[1]
        gyro.value("SetFloat32", unit, "temperature_c", ctypes.c_float, 55.0)
        assert gyro.step(unit, at * period_s, 5000 * period_s) == _OK
        after = gyro.value("GetFloat32", unit, "bias_dph", ctypes.c_float)[1]
        assert before != after
        assert gyro.library.fmi3SetFMUState(unit, saved) == _OK
        for count in steps[1:]:
            assert gyro.step(unit, 0.0, count * period_s) == _OK
        again = gyro.value("GetFloat32", unit, "bias_dph", ctypes.c_float)[1]
        assert again == before
        assert gyro.library.fmi3FreeFMUState(unit, ctypes.byref(saved)) == _OK and not saved.value
        gyro.library.fmi3FreeInstance(unit)
        return np.float32(before).tobytes()

    assert ended(1000, 2000) == ended(1, 2999) == ended(*[500] * 6)


def test_what_no_unit_can_do_is_said(plain: Path, tmp_path: Path) -> None:
    gyro = Imported(plain / "gyro.fmu", tmp_path)
    assert gyro.instance("{other}") is None and "token" in gyro.said[-1]
    unit = gyro.instance()
    assert gyro.step(unit, 0.0, 1.0) == _ERROR, "not started"
    gyro.value("SetUInt32", unit, "sample_period_us", ctypes.c_uint32, 7)
    assert gyro.library.fmi3ExitInitializationMode(unit) == _ERROR and "makes a block" in gyro.said[-1]
    assert gyro.library.fmi3Reset(unit) == _OK and gyro.library.fmi3ExitInitializationMode(unit) == _OK
    assert gyro.value("SetUInt32", unit, "sample_period_us", ctypes.c_uint32, 10000)[0] == _ERROR, "fixed"
    for size in (0.0, -1.0, float("nan"), 1e12):
        assert gyro.step(unit, 0.0, size) == _ERROR and "length of time" in gyro.said[-1]
    assert gyro.value("SetFloat32", unit, "bias_dph", ctypes.c_float, 1.0)[0] == _ERROR
    assert gyro.value("GetInt32", unit, "bias_dph", ctypes.c_int32)[0] == _ERROR
    assert gyro.value("GetFloat64", unit, "bias_dph", ctypes.c_double)[0] == _ERROR
    gyro.library.fmi3FreeInstance(unit)


@pytest.mark.slow
def test_three_axes_are_one_unit_and_each_is_its_own_table(tmp_path: Path, gyrotc: Command) -> None:
    models, sources = {}, {}
    for axis in "xyz":
        models[axis] = load_model(ROOT / "examples" / "triad" / f"model_{axis}.json")
        part = emitted(tmp_path / "r" / axis, models[axis]) / "c"
        sources[axis] = {path.name: path.read_bytes() for path in part.iterdir() if path.is_file()}
    (tmp_path / "r" / "c").mkdir()
    for name, data in joint_texts(models, sources, "f32").items():
        (tmp_path / "r" / "c" / name).write_bytes(data)
    done = gyrotc("export", tmp_path / "r", "--format", "fmu", "--out", tmp_path / "triad.fmu")
    assert done.returncode == 0, done.stderr
    gyro = Imported(tmp_path / "triad.fmu", tmp_path / "x")
    unit = gyro.started()
    gyro.value("SetFloat32", unit, "temperature_c", ctypes.c_float, 31.5)
    assert gyro.step(unit, 0.0, 200.0) == _OK
    for axis, model in models.items():
        got = gyro.value("GetFloat32", unit, f"bias_{axis}_dph", ctypes.c_float)[1]
        count = round(200e6) // example_period_us(model)
        readings = np.full((count, 1), np.float32(31.5)).view(np.uint32)
        per_block = samples_per_block(model.block_s, example_period_us(model) / 1e6)
        none = np.zeros(count, dtype=np.int64)
        answers = replay(quantise(model, "f32"), readings, missed=none, samples_per_block=per_block)
        assert bits([got])[0] == answers.bits[-1]
    gyro.library.fmi3FreeInstance(unit)


def test_the_sources_are_those_of_the_result_and_compile_by_the_description_alone(plain: Path, tmp_path: Path) -> None:
    gyro = Imported(plain / "gyro.fmu", tmp_path)
    sources = tmp_path / "sources"
    for path in sources.glob("gtc*"):
        assert path.read_bytes() == (plain / "c" / path.name).read_bytes()
    build = ElementTree.parse(sources / "buildDescription.xml").getroot()
    files = [one.attrib["name"] for one in build.iter("SourceFile")]
    options = next(build.iter("SourceFileSet")).attrib["compilerOptions"].split()
    library = tmp_path / "again.so"
    command = ["gcc", "-shared", "-fPIC", *options, *(sources / name for name in files), "-o", library]
    subprocess.run(command, check=True)
    assert ctypes.CDLL(str(library)).fmi3DoStep and gyro.root.attrib["fmiVersion"] == "3.0"


@pytest.mark.slow
def test_the_same_result_gives_the_same_bytes_and_a_changed_one_none(plain: Path, tmp_path: Path) -> None:
    for _ in range(2):  # the second one replaces what gyrotc wrote
        export(plain, "fmu", tmp_path / "gyro.fmu")
    assert (tmp_path / "gyro.fmu").read_bytes() == (plain / "gyro.fmu").read_bytes()
    shutil.copytree(plain, tmp_path / "r")
    with next((tmp_path / "r" / "c").glob("gtc_*.c")).open("a") as stream:
        stream.write("/* changed */\n")
    with pytest.raises(InputError, match="is not as gyrotc wrote it"):
        export(tmp_path / "r", "fmu", tmp_path / "other.fmu")
    (tmp_path / "r" / MARKER).unlink()
    with pytest.raises(CheckFailed, match="not exported"):
        export(tmp_path / "r", "fmu", tmp_path / "other.fmu")
    assert not (tmp_path / "other.fmu").exists()


def test_a_zip_file_of_somebody_else_stays(plain: Path, tmp_path: Path, gyrotc: Command) -> None:
    stream = io.BytesIO()
    with zipfile.ZipFile(stream, "w") as archive:
        archive.writestr("modelDescription.xml", "<fmiModelDescription/>")
    (tmp_path / "a.fmu").write_bytes(stream.getvalue())
    done = gyrotc("export", plain, "--format", "fmu", "--out", tmp_path / "a.fmu")
    assert done.returncode == 2 and "not written by gyrotc" in done.stderr
    assert (tmp_path / "a.fmu").read_bytes() == stream.getvalue()


@pytest.mark.parametrize("which", ["plain", "channels"])
def test_fmpy_finds_no_fault_and_simulates_the_references_bits(which: str, request: pytest.FixtureRequest) -> None:
    fmpy = pytest.importorskip("fmpy", reason="fmpy is not installed")
    from fmpy.validation import validate_fmu

    folder: Path = request.getfixturevalue(which)
    model = load_model(folder / "model.json")
    assert validate_fmu(str(folder / "gyro.fmu")) == []
    rows, period_us, answers = history(model)
    names = ["temperature_c", *channel_names(model)]
    period_s = period_us * 1e-6
    given = np.zeros(_ROWS, dtype=[("time", "f8"), *((name, "f4") for name in names)])
    given["time"] = np.arange(_ROWS) * period_s
    for name, column in zip(names, rows.T, strict=True):
        given[name] = column
    outputs = ["bias_dph", "status"]
    found = fmpy.simulate_fmu(
        str(folder / "gyro.fmu"), start_time=0.0, stop_time=_ROWS * period_s, step_size=period_s,
        output_interval=period_s, start_values={"sample_period_us": period_us}, input=given, output=outputs,
    )  # fmt: skip
    assert len(found) == _ROWS + 1 and found["status"][0] == 8
    assert np.array_equal(bits(found["bias_dph"][1:]), answers.bits)
    assert np.array_equal(found["status"][1:], answers.status)
