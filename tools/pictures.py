"""The pictures of README.md and docs/, by a headless browser: `python tools/pictures.py` writes them into docs/."""

from __future__ import annotations

import subprocess
import sys
import tempfile
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT / "tests" / "support"))

from browser import browser  # noqa: E402
from lot import Lot  # noqa: E402

_PLANTED = ("sign_reversed", "axes_exchanged", "step", "noise", "thermometer_offset", "outliers")
_LIMITS = """schema = 1
product = "NAV"
[at_most]
rms_dph = 8.0e-4
table_bytes = 1000
[at_least]
improvement = 1.1
"""


def main(docs: Path = ROOT / "docs") -> None:
    """Make a result, a diagnosis and a fleet, and write pictures of their pages, bright and dark."""
    with tempfile.TemporaryDirectory(prefix="gyrotc-pictures-") as folder:
        work = Path(folder)
        (work / "product.toml").write_text(_LIMITS)
        _gyrotc("simulate", "paper", "--seed", "1", "--out", work / "data")
        _gyrotc("build", work / "data", "--out", work / "demo")
        _gyrotc("build", work / "data", "--limits", work / "product.toml", "--out", work / "unit")
        _gyrotc("simulate", "thermal-gradient", "--seed", "3", "--out", work / "gradient")
        _gyrotc("diagnose", work / "gradient", "--out", work / "diagnosis")
        unit, diagnosis = (work / name / "report.html" for name in ("unit", "diagnosis"))
        fleet = _fleet(work / "lot", work / "fleet")
        with browser(work / "profile") as tab:
            for page, name, width, height, dark, above in (
                (unit, "report.png", 1120, 720, False, "html"),
                (diagnosis, "diagnosis.png", 1120, 720, False, "html"),
                (fleet, "fleet.png", 1120, 940, False, "html"),
                (fleet, "fleet-curves.png", 1120, 830, True, "h2:has(+ figure)"),
            ):
                tab.open(page, width=width, height=height, dark=dark)
                tab.value(f"document.querySelector('{above}').scrollIntoView()")
                tab.picture(docs / name, whole=False)
            tab.open(work / "demo" / "report.html", width=1120, height=720)
            tab.picture_of("figure", docs / "bias.png")


def _gyrotc(*words: object) -> None:
    program = Path(sys.executable).with_name("gyrotc")
    subprocess.run([program, "-q", *map(str, words)], check=True)


def _fleet(data: Path, out: Path) -> Path:
    """Return the page of a lot of twelve units of three axes, of which six have a fault."""
    lot = Lot(1, 12)
    for fault, unit in zip(_PLANTED, lot.units[::2], strict=True):
        lot.plant(fault, unit)
    lot.write(data)
    (data / "fleet.toml").write_text('schema = 1\ndatasets = ["IMU-*"]\nnumeric = ["f32"]\n')
    _gyrotc("fleet", data / "fleet.toml", "--out", out)
    return out / "fleet.html"


if __name__ == "__main__":
    main()
