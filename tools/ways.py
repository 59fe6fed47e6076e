"""Every way to install or use gyrotc that this machine allows, tried: `make packages`.

Makes the archives, installs the generator by each way of pip, builds a program with each package of the C library (the
tests of tests/py/repository/test_packages.py), and weighs what an installation and each extra bring. Prints both
tables; `--docs docs` keeps the figures in docs/results/summary.json. What the machine lacks is named, not passed.
"""

from __future__ import annotations

import argparse
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import archives

import packages

ROOT = archives.ROOT
sys.path[:0] = [str(ROOT / "tests" / "py")]

MODEL = ROOT / "examples" / "minimal" / "model.json"
#: Extras that a user asks for; the others are for developers.
EXTRAS = ("sign", "sklearn", "dask", "hdf5", "tdms", "ulog", "dataflash", "ros", "mdf")


def generator(work: Path, wheel: Path, sdist: Path) -> Iterator[dict[str, Any]]:
    """Installs gyrotc by each way into an environment of its own, and emits C with it."""
    git = f"git+file://{ROOT}#subdirectory=gen"
    ways = [
        ("pip, from the source folder", ["{bin}/pip", "install", "-q", str(ROOT / "gen")]),
        ("pip, from git", ["{bin}/pip", "install", "-q", git]),
        ("pip, sdist", ["{bin}/pip", "install", "-q", str(sdist)]),
        ("pip, wheel", ["{bin}/pip", "install", "-q", str(wheel)]),
        (
            "uv, from the source folder",
            ["uv", "pip", "install", "-q", "--python", "{bin}/python", str(ROOT / "gen")],
        ),
    ]
    for number, (name, words) in enumerate(ways):
        shown = " ".join(words).replace("{bin}/", "").replace(str(ROOT), ".")
        if words[0] == "uv" and shutil.which("uv") is None:
            yield {"way": name, "command": shown, "seconds": 0.0, "result": "not tried: uv is not installed"}
            continue
        folder = work / f"way-{number}"
        subprocess.run([sys.executable, "-m", "venv", folder], check=True)
        begun = time.monotonic()
        done = _ran([w.replace("{bin}", str(folder / "bin")) for w in words], work)
        if not done:
            done = _ran(
                [str(folder / "bin" / "gyrotc"), "emit", str(MODEL), "--out", str(folder / "out")], work
            )
        yield {
            "way": name,
            "command": shown,
            "seconds": time.monotonic() - begun,
            "result": done or "emits C",
        }
        shutil.rmtree(folder)


def _ran(command: list[str], work: Path) -> str:
    """Nothing, or the last line of what went wrong."""
    done = subprocess.run(command, cwd=work, capture_output=True, text=True, check=False)
    return "" if done.returncode == 0 else f"failed: {(done.stderr.strip() or 'no message').splitlines()[-1]}"


def library(work: Path) -> Iterator[dict[str, Any]]:
    """Every package of the C library and every example, by their tests."""
    report = work / "report.xml"
    tests = [f"tests/py/repository/test_{name}.py" for name in ("packages", "examples")]
    command = [sys.executable, "-m", "pytest", "-q", f"--junitxml={report}", *tests]
    subprocess.run(command, cwd=ROOT, capture_output=True, check=False)
    for case in ElementTree.parse(report).iter("testcase"):
        skipped, failed = case.find("skipped"), case.find("failure")
        result = "same bits" if skipped is None and failed is None else "failed"
        if skipped is not None:
            result = f"not tried: {str(skipped.get('message')).removeprefix('Skipped: ')}"
        name = str(case.get("name")).removeprefix("test_").replace("_", " ")
        seconds = float(case.get("time", "0"))
        yield {"way": name, "command": f"pytest -k {case.get('name')}", "seconds": seconds, "result": result}


def weights(work: Path, wheel: Path) -> Iterator[dict[str, Any]]:
    """MB and packages of the plain installation and of each extra, what the plain one has left out."""
    plain: set[str] = set()
    for extra in ("", *EXTRAS):
        folder = work / f"weight-{extra}"
        what = f"{wheel}[{extra}]" if extra else str(wheel)
        reported = _ran([sys.executable, "-m", "pip", "install", "-q", "--target", str(folder), what], work)
        if reported:
            yield {"extra": extra or "plain", "mb": 0.0, "packages": 0, "result": reported}
            continue
        have = {path.name: path for path in folder.glob("*.dist-info")}
        new = {name: path for name, path in have.items() if name not in plain}
        yield {
            "extra": extra or "plain",
            "mb": sum(map(_size, new.values())) / 1e6,
            "packages": len(new),
            "result": "",
        }
        plain = plain or set(have)
        shutil.rmtree(folder)


def _size(info: Path) -> int:
    """Bytes of the files of a package, as its own list has them."""
    lines = (info / "RECORD").read_text("utf-8").splitlines()
    return sum(int(size) for _, _, size in (line.rsplit(",", 2) for line in lines) if size)


def section(result: dict[str, Any]) -> str:
    """Both tables."""
    from results import table

    ways = [[w["way"], f"`{w['command']}`", f"{w['seconds']:.1f}", w["result"]] for w in result["ways"]]
    sizes = [[e["extra"], f"{e['mb']:.0f}", e["packages"]] for e in result["installs"]]
    return f"{table(('way', 'command', 's ', 'result'), ways)}\n{table(('installation', 'MB ', 'packages '), sizes)}"


def main() -> int:
    """Tries all ways; exit status 1 where one failed."""
    parser = argparse.ArgumentParser(prog="tools/ways.py", description=__doc__.splitlines()[0])
    parser.add_argument("out", type=Path)
    parser.add_argument("--docs", type=Path)
    arguments = parser.parse_args()
    packages.assemble(arguments.out, list(packages.KINDS))
    sdist = archives.sdist(arguments.out)
    wheel = archives.wheel(sdist, arguments.out)
    with tempfile.TemporaryDirectory() as folder:
        work = Path(folder)
        ways = [*generator(work, wheel.resolve(), sdist.resolve()), *library(work)]
        result = {"ways": ways, "installs": [*weights(work, wheel.resolve())]}
    print(section(result))
    if arguments.docs is not None:
        from results import write

        write(arguments.docs.resolve(), "packages", result, section)
    return int(any(w["result"].startswith("failed") for w in [*ways, *result["installs"]]))


if __name__ == "__main__":
    sys.exit(main())
