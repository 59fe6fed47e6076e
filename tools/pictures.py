"""The pictures of README.md and docs/fleet.md, by a headless browser (`make picture`)."""

from __future__ import annotations

import subprocess
import sys
import tempfile
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT / "tests" / "support"))

from browser import browser  # noqa: E402
from lot import Lot  # noqa: E402

_PHONE = 390  # points: the narrowest phones that are common
_PLANTED = ("sign_reversed", "axes_exchanged", "step", "noise", "thermometer_offset", "outliers")


def main(work: Path, docs: Path = ROOT / "docs") -> None:
    """Writes the pictures of `work/unit` on a screen and, dark, on a phone, of `work/diagnosis`, of a lot."""
    fleet = _fleet(work / "lot", work / "fleet")
    with tempfile.TemporaryDirectory(prefix="gyrotc-pictures-") as profile, browser(Path(profile)) as tab:
        for page, name, width, height, dark, above in (
            (work / "unit" / "report.html", "report.png", 1120, 1240, False, "html"),
            (work / "unit" / "report.html", "report-phone.png", _PHONE, 844, True, "h2 + figure"),
            (work / "diagnosis" / "report.html", "diagnosis.png", 1120, 1020, False, "html"),
            (fleet, "fleet.png", 1120, 940, False, "html"),
            (fleet, "fleet-curves.png", 1120, 830, True, "h2:has(+ figure)"),
        ):
            tab.open(page, width=width, height=height, dark=dark)
            tab.value(f"document.querySelector('{above}').scrollIntoView()")
            tab.picture(docs / name, whole=False)


def _fleet(data: Path, out: Path) -> Path:
    """The page of a lot of twelve units of three axes, of which six have a fault."""
    lot = Lot(1, 12)
    for fault, unit in zip(_PLANTED, lot.units[::2], strict=True):
        lot.plant(fault, unit)
    lot.write(data)
    (data / "fleet.toml").write_text('schema = 1\ndatasets = ["IMU-*"]\nnumeric = ["f32"]\n')
    program = Path(sys.executable).with_name("gyrotc")
    subprocess.run([program, "-q", "fleet", data / "fleet.toml", "--out", out], check=True)
    return out / "fleet.html"


if __name__ == "__main__":
    main(Path(sys.argv[1]))
