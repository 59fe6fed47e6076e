"""Instructions and bytes of the C runtime: the map in emulators, whole programs as the linker makes them."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from ..campaigns import Settings
from ..page import Figure, ResultsTable, figures_table
from ..records import Record
from .instructions import CORES, instructions
from .sizes import EMLEARN, sizes

_TEXT = """
{compiler}. Instructions are means over random inputs, counted in QEMU, for maps of 6 and 64 Gaussians with individual
widths; each core has the optimisation level that is best for it. Flash is everything that is linked with a table of
{centers} Gaussians in float32 with uncertainties, coverage and known answers. Instructions for a sample are those of
whole blocks of ten samples, on a Cortex-M4F at -O2. The programs by hand test none of their inputs. The network of
emlearn was trained on the same map and is linked with the libm of newlib.
"""
_PROGRAMS = "Cortex-M4F -Os"
# Programs on the page, with their largest size in bytes; the others are in the record.
_SHOWN = {
    "init, sample, bias": 4096, "init, sample, bias; all else left out": 3300, "with snapshot; all else left out": 3700,
    "with check; all else left out": 4400, "every function, whole runtime": 12288,
    "by hand: mean, slope, four Gaussians": None, EMLEARN: None,
}  # fmt: skip
_COUNTED = ("init, sample, bias; all else left out", "by hand: mean, slope, four Gaussians", EMLEARN)
_M3, _M4, _M7 = "cortex-m3", "cortex-m4f", "cortex-m7"


def measure(settings: Settings) -> Record:
    """Count instructions and link programs."""
    record: Record = instructions(quick=settings.quick) | {"sizes": sizes()}
    return record


def table(record: Record) -> ResultsTable:
    """Return instructions, bytes and errors with their aims."""
    text = _TEXT.format(compiler=record["compiler"], centers=record["sizes"]["centers"])
    of_map = _of_map(record) if {cost["core"] for cost in record["costs"]} == set(CORES) else ()
    return figures_table(text, [*of_map, *_of_programs(record)])


def _of_map(record: Record) -> Iterator[tuple[str, Figure]]:
    for words, numeric, centers, cores, aim in (
        ("fixed point, 6 Gaussians, Cortex-M3, M4F and M7", "q31", 6, (_M3, _M4, _M7), 180),
        ("fixed point, 64 Gaussians, Cortex-M3", "q31", 64, (_M3,), 1420),
        ("fixed point, 64 Gaussians, Cortex-M4F and M7", "q31", 64, (_M4, _M7), 1500),
        ("fixed point, 6 Gaussians, Cortex-M0", "q31", 6, ("cortex-m0",), 830),
        ("fixed point, 64 Gaussians, Cortex-M0", "q31", 64, ("cortex-m0",), 8300),
        ("float32, 64 Gaussians, Cortex-M4F and M7", "f32", 64, (_M4, _M7), 2000),
    ):
        count = _largest(record, numeric, centers, cores, lambda cost: cost["map"]["mean"])
        yield f"instructions of a map, {words}", Figure(count, ".0f", at_most=aim)
    for words, key, aim in (
        ("bytes of the map's functions", "map_bytes", 340),
        ("bytes of its lookup table", "lookup_bytes", 256),
        ("bytes of stack", "stack_bytes", 56),
        ("bytes of writable static data", "ram_bytes", 0),
    ):
        count = _largest(record, "q31", 6, (_M3, _M4, _M7), lambda cost, key=key: cost[key])
        yield f"fixed point, {words}", Figure(count, ".0f", at_most=aim)
    for words, key, against, aim in (
        ("proved error of the Gaussians over Σ\\|w\\|", "gaussian_bound_dph", "sum_abs_weights_dph", 3.5e-8),
        ("largest error found over proved bound", "worst_dph", "bound_dph", 1.0),
        ("error of the arithmetic over that of plain float32", "arithmetic_dph", "naive_float32_dph", 1.0),
    ):
        ratio = max(e[key] / e[against] for e in record["errors"] if e["numeric"] == "q31")
        yield f"fixed point, {words}", Figure(ratio, ".3g", at_most=aim)


def _largest(record: Record, numeric: str, centers: int, cores: tuple[str, ...], figure: Any) -> float:
    """Return the largest, over cores, of the smallest figure over the compiler's levels, without a coverage map."""
    rows = [
        cost for cost in record["costs"]
        if not cost["coverage"] and (cost["numeric"], cost["centers"]) == (numeric, centers)
    ]  # fmt: skip
    return float(max(min(figure(cost) for cost in rows if cost["core"] == core) for core in cores))


def _of_programs(record: Record) -> Iterator[tuple[str, Figure]]:
    for row in (row for row in record["sizes"]["rows"] if row["name"] in _SHOWN):
        flash, ram = row[_PROGRAMS]
        words = f"{_PROGRAMS.replace(' -', ' `-')}`: {row['name']}"
        yield f"bytes of flash, {words}", Figure(flash, "d", at_most=_SHOWN[row["name"]])
        if row["name"] == "init, sample, bias":
            yield f"bytes of RAM, {words}", Figure(ram, "d", at_most=256)
        if row["name"] in _COUNTED:
            yield f"instructions for a sample, Cortex-M4F `-O2`: {row['name']}", Figure(row["instructions"], ".0f")
