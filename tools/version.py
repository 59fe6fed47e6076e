"""One source of the version: `include/gtc.h` states it, every other file that carries it repeats it.

`python tools/version.py` says which file differs (exit status 1); `--write` enters the header's version everywhere;
`--set 0.2.0` changes it in the header first. Standard library only.
"""

from __future__ import annotations

import argparse
import re
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
HEADER = "include/gtc.h"
PARTS = ("MAJOR", "MINOR", "PATCH")
_NUMBER = r"(\d+\.\d+\.\d+)"
#: Files that repeat the version, and where in them it stands.
PLACES = {
    "gen/pyproject.toml": rf'^version = "{_NUMBER}"$',
    "gen/gyrotc/__init__.py": rf'^__version__ = "{_NUMBER}"$',
}


def header_version(root: Path) -> str:
    """The version that `include/gtc.h` defines."""
    text = (root / HEADER).read_text("ascii")
    return ".".join(re.findall(rf"^#define GTC_VERSION_(?:{'|'.join(PARTS)}) (\d+)$", text, re.MULTILINE))


def differing(root: Path) -> list[str]:
    """One line for each file whose version is not the header's, or that has none."""
    wanted = header_version(root)
    found = {
        name: re.findall(pattern, (root / name).read_text("utf-8"), re.MULTILINE) for name, pattern in PLACES.items()
    }
    return [
        f"{name}: {', '.join(versions) or 'no version'}; {HEADER} has {wanted}"
        for name, versions in found.items()
        if set(versions) != {wanted}
    ]


def write(root: Path) -> None:
    """Enters the header's version in every other file."""
    wanted = header_version(root)
    for name, pattern in PLACES.items():
        path = root / name
        text = path.read_text("utf-8")
        changed = re.sub(pattern, lambda m: m[0].replace(m[1], wanted), text, flags=re.MULTILINE)
        path.write_text(changed, "utf-8")


def set_header(root: Path, version: str) -> None:
    """Changes the version that the header defines; `version` has three numbers."""
    path = root / HEADER
    text = path.read_text("ascii")
    for part, number in zip(PARTS, version.split("."), strict=True):
        text = re.sub(rf"^(#define GTC_VERSION_{part}) \d+$", rf"\1 {number}", text, flags=re.MULTILINE)
    path.write_text(text, "ascii")


def main() -> int:
    """Compares, or writes."""
    parser = argparse.ArgumentParser(prog="tools/version.py", description=__doc__.splitlines()[0])
    parser.add_argument("--write", action="store_true", help="enter the header's version everywhere")
    parser.add_argument("--set", metavar="X.Y.Z", help="change it in the header first")
    arguments = parser.parse_args()
    if arguments.set is not None:
        if not re.fullmatch(_NUMBER, arguments.set):
            parser.error(f"'{arguments.set}' is not three numbers with dots between")
        set_header(ROOT, arguments.set)
    if arguments.write or arguments.set is not None:
        write(ROOT)
    lines = differing(ROOT)
    print("\n".join(lines) or header_version(ROOT))
    return 1 if lines else 0


if __name__ == "__main__":
    sys.exit(main())
