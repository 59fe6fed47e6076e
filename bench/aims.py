"""What the project wants to reach (none of it depends on peers), beside what was measured."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

__all__ = ["AIMS", "Aim"]

Result = dict[str, Any]
Aim = tuple[str, float, str, Callable[[Result], float]]  # what, at most, format, figure of a result


def _default(r: Result, key: str, of: str) -> list[float]:
    """A figure of the default method for the smooth scenario and for those with ripple."""
    return [float(d[key][of]) for d in r["accuracy"]["default"]]


def _row(r: Result, table: str, name: str, **where: Any) -> dict[str, Any]:
    """The row of a contestant in a table of the section on speed."""
    rows = r["speed"][table]
    if where:
        rows = next(x["rows"] for x in rows if all(x[key] == value for key, value in where.items()))
    return next(row for row in rows if row["name"] == name)


def _large(r: Result, name: str) -> dict[str, Any]:
    return _row(r, "selection", name, samples=172800)


_GRID, _ANY = "gyrotc, grid", "gyrotc, any candidates"

AIMS: tuple[Aim, ...] = (
    ("RMS ÷ floor, smooth maps: median", 1.006, ".4f", lambda r: _default(r, "ratio", "median")[0]),
    ("RMS ÷ floor, smooth maps: worst", 1.015, ".4f", lambda r: _default(r, "ratio", "worst")[0]),
    ("RMS ÷ floor, with ripple: worst", 1.02, ".4f", lambda r: max(_default(r, "ratio", "worst")[1:])),
    ("bytes of float32, smooth maps: most", 144, ".0f", lambda r: _default(r, "bytes", "worst")[0]),
    ("bytes of float32, with ripple: most", 264, ".0f", lambda r: max(_default(r, "bytes", "worst")[1:])),
    (
        "predicted against found RMS ÷ floor: median difference",
        0.002,
        ".4f",
        lambda r: max(abs(d["found_minus_predicted"] or 0.0) for d in r["accuracy"]["default"]),
    ),
    (
        "up to 60 centers asked for: largest change of the ratio",
        0.005,
        ".4f",
        lambda r: max(abs(v) for x in r["accuracy"]["more_centers"] for v in x["largest"].values()),
    ),
    (
        "RMS ÷ floor on a ramp rate left out: median",
        1.03,
        ".4f",
        lambda r: max(x["median"] for x in r["accuracy"]["left_out"]),
    ),
    (
        "CPU s, orthogonal least squares of paper size",
        0.010,
        ".4f",
        lambda r: float(_row(r, "selection", _GRID, samples=1728, widths=7)["seconds"]),
    ),
    ("CPU s, `mrbf`, smooth maps: median", 0.06, ".3f", lambda r: _default(r, "seconds", "median")[0]),
    ("CPU s, `mrbf`, with ripple: median", 0.25, ".3f", lambda r: max(_default(r, "seconds", "median")[1:])),
    (
        "CPU s, variable projection of six Gaussians",
        0.007,
        ".4f",
        lambda r: float(_row(r, "varpro", "gyrotc")["seconds"]),
    ),
    (
        "CPU s, 2000 candidates on a grid × 172800 samples",
        0.3,
        ".2f",
        lambda r: float(_large(r, _GRID)["seconds"]),
    ),
    (
        "CPU s, 2000 candidates anywhere × 172800 samples",
        18.0,
        ".2f",
        lambda r: float(_large(r, _ANY)["seconds"]),
    ),
    (
        "peak GiB of these two",
        0.5,
        ".2f",
        lambda r: max(float(_large(r, name)["peak_gib"]) for name in (_GRID, _ANY)),
    ),
    ("CPU s, Kohonen network", 0.1, ".3f", lambda r: float(_row(r, "kohonen", "gyrotc")["seconds"])),
    (
        "CPU s, six recordings of 2.88 million rows to proven C",
        10.0,
        ".1f",
        lambda r: r["speed"]["raw"]["seconds"],
    ),
    ("peak GiB of this", 0.5, ".2f", lambda r: r["speed"]["raw"]["peak_gib"]),
)
