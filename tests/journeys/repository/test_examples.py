"""Examples are built as their pages say, run, and give the reference's numbers."""

from __future__ import annotations

import ast
import json
import re
import shutil
import subprocess
import sys
from pathlib import Path

import gyrotc
import numpy as np
import pytest
from gyrotc.mirror import evaluate_map
from gyrotc.model import Model, load_model
from gyrotc.tables import emit, quantise

ROOT = Path(__file__).resolve().parents[3]
EXAMPLES = ROOT / "examples"
FLAGS = (
    "-std=c99",
    "-ffp-contract=off",
    "-Wall",
    "-Wextra",
    "-Wconversion",
    "-Werror",
    f"-I{ROOT / 'include'}",
)
RUNTIME = sorted((ROOT / "libc").glob("*.c"))


def _run(*command: str | Path, status: int = 0, cwd: Path | None = None) -> str:
    done = subprocess.run([str(c) for c in command], capture_output=True, text=True, check=False, cwd=cwd)
    assert done.returncode == status, done.stdout + done.stderr
    return done.stdout


def _at(model: Model, temperature: float) -> float:
    """The reference's bias at rest, deg/h."""
    table = quantise(model, "f32")
    _, bits = evaluate_map(table, table.encode_inputs(np.array([[temperature, 0.0]])))
    return float(table.decode_bias(bits)[0])


def test_every_example_is_on_the_page() -> None:
    listed = re.findall(r"^\| \[(\w+)\]", (EXAMPLES / "README.md").read_text(), re.MULTILINE)
    assert sorted(listed) == sorted(p.name for p in EXAMPLES.iterdir() if p.is_dir() and (p / "README.md").exists())


@pytest.mark.parametrize("name", ["filter", "many_serials", "minimal", "rtos", "triad", "two_slots"])
def test_the_commands_of_a_page_run_and_leave_nothing_to_be_tracked(
    name: str, gyros: dict[str, Path], tmp_path: Path
) -> None:
    """What stands in blocks, else `make`; what they write is ignored by git."""
    for part in ("examples", "include", "libc"):
        shutil.copytree(ROOT / part, tmp_path / part, ignore=shutil.ignore_patterns("build", "__pycache__"))
    shutil.copy(ROOT / ".gitignore", tmp_path)
    _run("git", "init", "-q", cwd=tmp_path)
    _run("git", "add", "-A", cwd=tmp_path)
    page = (EXAMPLES / name / "README.md").read_text("utf-8")
    blocks = re.findall(r"```\n(.*?)```", page, re.DOTALL) or [
        f"make GYROTC={Path(sys.executable).with_name('gyrotc')}"
    ]
    words = "\n".join(blocks).replace("FLEET", str(gyros["RLG-0001"])).replace("RLG-0042", "RLG-0001")
    _run("bash", "-ec", words.replace("python3", sys.executable), cwd=tmp_path / "examples" / name)
    assert _run("git", "ls-files", "--others", "--exclude-standard", cwd=tmp_path) == ""


def test_triad_compensates_each_axis_by_its_own_table(tmp_path: Path) -> None:
    folder = tmp_path / "examples" / "triad"
    shutil.copytree(EXAMPLES / "triad", folder)
    _run("make", f"GYROTC={Path(sys.executable).with_name('gyrotc')}", cwd=folder)
    reported = re.findall(r"-?\d+\.\d+", _run(folder / "build" / "triad"))
    for axis, temperature, rate in zip("xyz", (20.0, 21.5, None), reported, strict=True):
        if temperature is not None:  # the third one's temperature moves
            assert float(rate) == pytest.approx(-_at(load_model(folder / f"model_{axis}.json"), temperature), abs=1e-6)
    assert len({abs(float(rate)) for rate in reported}) == 3


@pytest.fixture(scope="module")
def gyros(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    """Results of three serials, each with a bias of its own, as `emit` leaves them."""
    raw = load_model(EXAMPLES / "minimal" / "model.json")
    found = {}
    for k, serial in enumerate(("RLG-0001", "RLG-0002", "RLG-0010")):
        network = raw.networks[0].model_copy(update={"w0": raw.networks[0].w0 + 1e-3 * k})
        model = raw.model_copy(update={"serial": serial, "networks": (network,)})
        found[serial] = tmp_path_factory.mktemp("fleet") / serial
        emit(model, found[serial])
        model.save(found[serial] / "model.json")
    return found


@pytest.fixture(scope="module")
def firmware(tmp_path_factory: pytest.TempPathFactory) -> Path:
    program = tmp_path_factory.mktemp("firmware") / "many_serials"
    folder = EXAMPLES / "many_serials"
    _run("gcc", *FLAGS, folder / "main.c", folder / "images.c", *RUNTIME, "-o", program)
    return program


def test_one_firmware_takes_the_image_of_its_serial(gyros: dict[str, Path], firmware: Path, tmp_path: Path) -> None:
    flash = tmp_path / "flash.bin"
    assert _run(sys.executable, EXAMPLES / "many_serials" / "pack.py", flash, *gyros.values()).startswith("3 images")
    flash.write_bytes(flash.read_bytes() + b"\xff" * 64)  # erased behind the last one
    for serial, folder in gyros.items():
        reported = _run(firmware, flash, serial)
        assert reported.startswith(f"{serial}: ")
        assert float(reported.split()[-2]) == pytest.approx(_at(load_model(folder / "model.json"), 20.0), abs=2e-7)
    for other in ("RLG-0003", "RLG-001", "RLG-00100", ""):
        assert "-5" in _run(firmware, flash, other, status=1), "GTC_E_ID"


def test_a_damaged_image_is_not_used_nor_passed_over(gyros: dict[str, Path], firmware: Path, tmp_path: Path) -> None:
    flash = tmp_path / "flash.bin"
    _run(sys.executable, EXAMPLES / "many_serials" / "pack.py", flash, *gyros.values())
    content = bytearray(flash.read_bytes())
    content[400] ^= 1
    flash.write_bytes(content)
    for serial in ("RLG-0001", "RLG-0002"):
        assert "-4" in _run(firmware, flash, serial, status=1), "GTC_E_IMAGE"
    flash.write_bytes(content[:10])
    _run(firmware, flash, "RLG-0001", status=1)
    assert "-5" in _run(firmware, tmp_path / "none", "RLG-0001", status=1)


def test_interrupt_and_task_on_the_host(tmp_path: Path) -> None:
    reported = _run("make", "-s", f"OUT={tmp_path}", cwd=EXAMPLES / "rtos")
    assert re.search(r"\d+ increments, 5 readings, 0\.\d+ arcsec taken away", reported)


def test_a_filter_in_cpp_integrates_the_corrected_rate(tmp_path: Path) -> None:
    """0.01 deg/h beside the bias, over ten minutes."""
    own = EXAMPLES / "minimal"
    flags = [f"-I{ROOT / 'include'}", f"-I{own}", "-Wall", "-Wextra", "-Werror"]
    objects = [tmp_path / f"{source.stem}.o" for source in (*RUNTIME, own / "gtc_rlg_0042.c")]
    for source, made in zip((*RUNTIME, own / "gtc_rlg_0042.c"), objects, strict=True):
        _run("gcc", "-std=c99", *flags, "-c", source, "-o", made)
    _run("g++", "-std=c++11", *flags, EXAMPLES / "filter" / "main.cpp", *objects, "-o", tmp_path / "filter")
    found = re.fullmatch(r"heading (\S+) deg, variance (\S+) deg\^2\n", _run(tmp_path / "filter"))
    assert found is not None
    assert abs(float(found[1]) - 0.01 / 6.0) < 1e-5 and float(found[2]) >= 1e-6 / 6.0


def test_the_notebook_builds_a_result(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Its cells in order, as Jupyter runs them, and what it would show of the last line of each."""
    monkeypatch.chdir(tmp_path)
    cells = json.loads((EXAMPLES / "notebook" / "map.ipynb").read_text())["cells"]
    names: dict[str, object] = {}
    shown: list[object] = []
    for cell in (c for c in cells if c["cell_type"] == "code"):
        text = "".join(cell["source"])
        if text.startswith("!gyrotc "):
            _run(Path(sys.executable).with_name("gyrotc"), *text.removeprefix("!gyrotc ").split())
            continue
        *before, last = ast.parse(text).body
        exec(compile(ast.Module(before, []), "map.ipynb", "exec"), names)
        assert isinstance(last, ast.Expr)
        shown.append(eval(compile(ast.Expression(last.value), "map.ipynb", "eval"), names))
    data, result, series, bias = shown
    assert isinstance(data, gyrotc.Dataset) and isinstance(result, gyrotc.Result)
    assert result._repr_html_().count("<svg") == 3 and (tmp_path / "build" / "result" / "report.html").is_file()
    assert float(series["max"]) < 0.02 and len(bias) == 2  # type: ignore[index, arg-type]
