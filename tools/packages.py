"""Firmware packages that are archives of their own, made from `include/`, `libc/` and `packages/`: `make packages`.

Writes into OUT: `gyrotc-<version>-esp-idf.zip` and `gyrotc-<version>-crate.zip`, each beside the folder that it was
made of. Equal sources give equal bytes.
CMake, Meson, Zephyr and PlatformIO take the sources as they are: packages/README.md. Standard library only.
"""

from __future__ import annotations

import argparse
import shutil
import sys
import zipfile
from collections.abc import Callable
from pathlib import Path

import version

ROOT = version.ROOT
PACKAGES = ROOT / "packages"
#: The earliest time that a zip archive can hold: no date of the build gets into one.
EPOCH = (1980, 1, 1, 0, 0, 0)
#: Regular file, rw-r--r--, in the high half of a zip entry's attributes.
MODE = 0o100644 << 16


def _runtime(out: Path) -> None:
    shutil.copytree(ROOT / "include", out / "include")
    shutil.copytree(ROOT / "libc", out / "libc")


def _copy(out: Path, *paths: Path) -> None:
    out.mkdir(parents=True, exist_ok=True)
    for path in paths:
        shutil.copy(path, out)


def esp_idf(out: Path) -> None:
    """A component that needs nothing beside it."""
    _copy(out, PACKAGES / "Kconfig")
    for template in (PACKAGES / "esp-idf").glob("*.in"):  # so named that no tool takes their folder for a component
        shutil.copy(template, out / template.stem)
    _copy(out, ROOT / "LICENSE", ROOT / "CHANGELOG.md", ROOT / "libc" / "README.md")
    _runtime(out)


def crate(out: Path) -> None:
    """A crate that carries the C sources, in `c/`."""
    _copy(out, PACKAGES / "rust" / "Cargo.toml", PACKAGES / "rust" / "build.rs", ROOT / "LICENSE")
    _copy(out, PACKAGES / "rust" / "README.md")
    shutil.copytree(PACKAGES / "rust" / "src", out / "src")
    _runtime(out / "c")


#: Kind: who fills its folder, and the name of its archive.
KINDS: dict[str, tuple[Callable[[Path], None], str]] = {
    "esp-idf": (esp_idf, "gyrotc-{}-esp-idf.zip"),
    "crate": (crate, "gyrotc-{}-crate.zip"),
}


def archive(folder: Path, path: Path, inside: str) -> None:
    """A zip archive of a folder, the same bytes each time; files lie below `inside` if it is not empty."""
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED, compresslevel=9) as target:
        for file in sorted(p for p in folder.rglob("*") if p.is_file()):
            name = (Path(inside) / file.relative_to(folder)).as_posix()
            entry = zipfile.ZipInfo(name, EPOCH)
            entry.external_attr = MODE
            entry.create_system = 3  # Unix, whose modes these are
            entry.compress_type = zipfile.ZIP_DEFLATED
            target.writestr(entry, file.read_bytes())


def assemble(out: Path, kinds: list[str]) -> list[Path]:
    """Folders and archives of `kinds` in `out`; gives the archives."""
    made = []
    for kind in kinds:
        fill, name = KINDS[kind]
        folder = out / kind / "gyrotc"
        shutil.rmtree(folder, ignore_errors=True)
        fill(folder)
        made.append(out / name.format(version.header_version(ROOT)))
        archive(folder, made[-1], "gyrotc")
    return made


def main() -> int:
    """Makes the packages that are named, by default all."""
    parser = argparse.ArgumentParser(prog="tools/packages.py", description=__doc__.splitlines()[0])
    parser.add_argument("out", type=Path)
    parser.add_argument("kinds", nargs="*", choices=[[], *KINDS], metavar="KIND", help=f"of {', '.join(KINDS)}")
    arguments = parser.parse_args()
    for path in assemble(arguments.out, arguments.kinds or list(KINDS)):
        print(f"{path}: {path.stat().st_size} bytes")
    return 0


if __name__ == "__main__":
    sys.exit(main())
