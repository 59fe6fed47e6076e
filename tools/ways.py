"""Every way to install or use gyrotc that this machine allows, tried: `make packages`.

Makes the archives, installs the generator by each way of pip and emits C with it (of the wheel a whole build with its
report), builds a program with each package of the C library (tests of tests/journeys/repository), and weighs what an
installation and each extra bring. Prints the tables; `--docs docs` keeps the figures in docs/results/summary.json;
`--only PART` tries a part and keeps it beside the others. What the machine lacks is named.
"""

from __future__ import annotations

import argparse
import json
import os
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import archives

import packages

ROOT = archives.ROOT
sys.path[:0] = [str(ROOT / "tests" / "support")]

MODEL = ROOT / "examples" / "minimal" / "model.json"
#: Extras that a user asks for; the others are for developers.
EXTRAS = (
    "sign",
    "sklearn",
    "dask",
    "hdf5",
    "tdms",
    "excel",
    "netcdf",
    "paper",
)
#: Tests that use a package as its page says: the way, and its command.
USES = {
    "test_cmake_finds_it[lib]": ("CMake, installed", "cmake --install; find_package(gyrotc)"),
    "test_cmake_finds_it[lib/x86_64-linux-gnu]": ("CMake, lib of Debian", "the same with lib/<triplet>"),
    "test_a_project_takes_the_sources_in": ("CMake, sources", "FetchContent"),
    "test_pkg_config_finds_it[lib]": ("pkg-config", "pkg-config --cflags --libs gyrotc"),
    "test_pkg_config_finds_it[lib/x86_64-linux-gnu]": (
        "pkg-config, lib of Debian",
        "the same with lib/<triplet>",
    ),
    "test_meson_builds_a_user_of_the_wrap": ("Meson", "dependency('gyrotc') of the wrap"),
    "test_zephyr_finds_the_module_and_its_options": ("Zephyr, test functions", "CONFIG_GYROTC=y"),
    "test_esp_idf_takes_the_component": ("ESP-IDF, test functions", "the archive in components"),
    "test_espressifs_tool_packs_all_sources": ("ESP-IDF, its packer", "compote component pack"),
    "test_platformio_compiles_what_its_manifest_says": ("PlatformIO, its manifest", "lib_deps"),
    "test_rust_gives_the_bits_of_c": ("Rust", "cargo test; cargo run"),
    "test_ada_gives_the_bits_of_c_with_every_contract_checked": ("Ada, files", "gnatmake -gnata"),
    "test_gprbuild_builds_a_user_of_the_project": ("Ada, project", "gprbuild, with gyrotc.gpr"),
    "test_a_filter_in_cpp_integrates_the_corrected_rate": ("C++", "#include <gtc.hpp>"),
    "test_the_commands_of_a_page_run_and_leave_nothing_to_be_tracked[minimal]": (
        "C, files",
        "cc main.c gtc_*.c",
    ),
    "test_interrupt_and_task_on_the_host": ("POSIX task and interrupt", "make of examples, rtos"),
    "test_interrupt_and_task_with_freertos": ("FreeRTOS", "make FREERTOS=<kernel>"),
    "test_the_notebook_builds_a_result": ("notebook", "jupyter lab map.ipynb"),
}


def generator(work: Path, wheel: Path, sdist: Path) -> Iterator[dict[str, Any]]:
    """Installs gyrotc by each way into an environment of its own, and emits C with it."""
    git = f"git+file://{ROOT}#subdirectory=gen"
    ways = [
        ("pip, wheel", ["{bin}/pip", "install", "-q", str(wheel)]),
        ("pip, sdist", ["{bin}/pip", "install", "-q", str(sdist)]),
        ("pip, source folder", ["{bin}/pip", "install", "-q", str(ROOT / "gen")]),
        ("pip, git", ["{bin}/pip", "install", "-q", git]),
        (
            "uv, source folder",
            ["uv", "pip", "install", "-q", "--python", "{bin}/python", str(ROOT / "gen")],
        ),
    ]
    for number, (name, words) in enumerate(ways):
        shown = " ".join(words).replace("{bin}/", "").replace(str(ROOT), ".")
        shown = shown.replace(str(wheel), wheel.name).replace(str(sdist), sdist.name)
        if words[0] == "uv" and shutil.which("uv") is None:
            yield {"way": name, "command": shown, "seconds": 0.0, "result": "not tried: uv is not installed"}
            continue
        folder = work / f"way-{number}"
        subprocess.run([sys.executable, "-m", "venv", folder], check=True)
        begun = time.monotonic()
        wrong = _ran([w.replace("{bin}", str(folder / "bin")) for w in words], work)
        seconds = time.monotonic() - begun
        whole = name == "pip, wheel"
        if not wrong:
            wrong = _builds(folder) if whole else _emits(folder)
        result = wrong or ("builds, with its report" if whole else "emits C")
        yield {"way": name, "command": shown, "seconds": seconds, "result": result}
        shutil.rmtree(folder)


def _emits(folder: Path) -> str:
    return _ran([str(folder / "bin" / "gyrotc"), "emit", str(MODEL), "--out", str(folder / "out")], folder)


def _builds(folder: Path) -> str:
    """The main job, from simulated recordings to verified C and a page with pictures."""
    gyrotc = str(folder / "bin" / "gyrotc")
    wrong = _ran([gyrotc, "simulate", "paper", "--seed", "1", "--out", "data"], folder)
    wrong = wrong or _ran([gyrotc, "build", "data", "--out", "result"], folder)
    if not wrong and "<svg" not in (folder / "result" / "report.html").read_text("utf-8"):
        return "failed: the report has no picture"
    return wrong


def _ran(command: Sequence[str | Path], work: Path) -> str:
    """Nothing, or the last line of what went wrong."""
    clean = {name: value for name, value in os.environ.items() if name != "PYTHONPATH"}
    done = subprocess.run(command, cwd=work, capture_output=True, text=True, check=False, env=clean)
    return "" if done.returncode == 0 else f"failed: {(done.stderr.strip() or 'no message').splitlines()[-1]}"


def library(work: Path) -> Iterator[dict[str, Any]]:
    """Every package of the C library and every example, by their tests."""
    report = work / "report.xml"
    tests = [f"tests/journeys/repository/test_{name}.py" for name in ("packages", "examples")]
    command = [sys.executable, "-m", "pytest", "-q", f"--junitxml={report}", *tests]
    subprocess.run(command, cwd=ROOT, capture_output=True, check=False)
    for case in ElementTree.parse(report).iter("testcase"):
        test = str(case.get("name"))
        skipped, sound = case.find("skipped"), case.find("failure") is None and case.find("error") is None
        if sound and test not in USES:
            continue  # a check of files and no way to use them
        way, words = USES.get(test, (test, f"pytest -k {test}"))
        result = "same bits" if sound else "failed"
        if skipped is not None:
            result = f"not tried: {str(skipped.get('message')).removeprefix('Skipped: ')}"
        yield {"way": way, "command": words, "seconds": float(case.get("time", "0")), "result": result}


def weights(work: Path, wheel: Path) -> Iterator[dict[str, Any]]:
    """MB and packages of the plain installation and of each extra, what the plain one has left out."""
    plain: set[str] = set()
    for extra in ("", *EXTRAS):
        name, folder = extra or "plain", work / f"weight-{extra}"
        pip = [sys.executable, "-m", "pip", "install", "-q", "--disable-pip-version-check"]
        report = work / f"report-{extra}.json"
        what = f"{wheel}[{extra}]" if extra else str(wheel)
        wrong = _ran([*pip, "--dry-run", "--ignore-installed", "--report", str(report), what], work)
        if not wrong:
            chosen = [one["metadata"] for one in json.loads(report.read_text("utf-8"))["install"]]
            new = {f"{one['name']}=={one['version']}" for one in chosen if one["name"] != "gyrotc"} - plain
            wrong = _ran([*pip, "--no-deps", "--target", str(folder), *new, *([] if plain else [wheel])], work)
        if wrong:
            yield {"extra": name, "mb": 0.0, "packages": 0, "result": wrong}
            continue
        have = list(folder.glob("*.dist-info"))
        yield {"extra": name, "mb": sum(map(_size, have)) / 1e6, "packages": len(have), "result": ""}
        plain = plain or new
        shutil.rmtree(folder)


def _size(info: Path) -> int:
    """Bytes of the files of a package, as its own list has them."""
    lines = (info / "RECORD").read_text("utf-8").splitlines()
    return sum(int(size) for _, _, size in (line.rsplit(",", 2) for line in lines) if size)


def section(result: dict[str, Any]) -> str:
    """All tables."""
    from results import table

    ways = [*result.get("generator", []), *result.get("library", [])]
    rows = [[w["way"], f"`{w['command']}`", f"{w['seconds']:.1f}", w["result"]] for w in ways]
    sizes = [[e["extra"], f"{e['mb']:.1f}", e["packages"]] for e in result.get("weights", [])]
    return f"{table(('way', 'command', 's ', 'result'), rows)}\n{table(('installation', 'MB ', 'packages '), sizes)}"


def _archives(out: Path) -> tuple[Path, Path]:
    """The wheel and the sdist of this tree."""
    sdist = archives.sdist(out)
    return archives.wheel(sdist, out).resolve(), sdist.resolve()


def main() -> int:
    """Tries all ways; exit status 1 where one failed."""
    parser = argparse.ArgumentParser(prog="tools/ways.py", description=__doc__.splitlines()[0])
    parser.add_argument("out", type=Path)
    parser.add_argument("--docs", type=Path)
    parser.add_argument("--only", choices=("generator", "library", "weights"))
    arguments = parser.parse_args()
    packages.assemble(arguments.out, list(packages.KINDS))
    wheel, sdist = _archives(arguments.out) if arguments.only != "library" else (Path(), Path())
    with tempfile.TemporaryDirectory() as folder:
        work = Path(folder)
        parts = {
            "generator": lambda: generator(work, wheel, sdist),
            "library": lambda: library(work),
            "weights": lambda: weights(work, wheel),
        }
        result = {name: [*part()] for name, part in parts.items() if arguments.only in (None, name)}
    if arguments.docs is not None:
        from results import recorded, write

        earlier = recorded(arguments.docs, "packages") or {}
        write(arguments.docs.resolve(), "packages", earlier | result, section)
    print(section(result))
    return int(any(found["result"].startswith("failed") for part in result.values() for found in part))


if __name__ == "__main__":
    sys.exit(main())
