"""Images of many serials as the contents of one flash sector: pack.py FLASH RESULT...

Each RESULT is a folder of `gyrotc build` (or `fit` and `emit`), or of `gyrotc fleet`, whose units are taken.
"""

from __future__ import annotations

import sys
from pathlib import Path


def images(result: Path) -> list[Path]:
    """float32 images below a result, in order of name."""
    return sorted(p for p in result.rglob("gtc_*.bin") if not p.stem.endswith("_q31"))


def main() -> int:
    """Writes the images one after another."""
    if len(sys.argv) < 3:
        print(__doc__)
        return 2
    found = [path for word in sys.argv[2:] for path in images(Path(word))]
    Path(sys.argv[1]).write_bytes(b"".join(path.read_bytes() for path in found))
    print(f"{len(found)} images, {Path(sys.argv[1]).stat().st_size} bytes")
    return 0 if found else 1


if __name__ == "__main__":
    sys.exit(main())
