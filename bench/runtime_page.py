"""The section `runtime` of docs/results.md: what the C runtime costs."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

from results import table

__all__ = ["AIMS", "Aim", "section"]

_HEAD = """## What the runtime costs (`make bench`)

{compiler}, instructions counted in QEMU; every build that was counted gives the reference's bits in its board test.
Models of 6 and of 64 centers with individual widths in both inputs. Mean and most over {vectors} random inputs, some of
them beyond the envelope, and over corners, cell edges and special values. The aims are of the means, each core with the
level of the compiler that serves it best.
"""
_MADE_OF = """### Instructions of one evaluation of the map

*Each center* and *once* are what the means of 6 and 64 centers say: count = once + centers × each. *Once* is the call,
checking, clamping and scaling two inputs, the linear part and the last rounding; *coverage*: what a coverage map adds.
A center in fixed point is, on the M3 and above, 18 instructions (two multiply-adds for its arguments, two products for
the square, one saturation, three for the fraction and the index, two products and a sum for the Gaussian, its word of
the table and two shifts, three loads, one multiply-accumulate) and half a turn of the loop; on the M0, whose products
have 32 bits, there are 20 products in it. float32 on the M0 and M3 is software.
"""
_BYTES = """### Bytes

The map's function and its lookup table (fixed point: 64 words and a constant), writable static data, stack of a call
of the map; `sample`: instructions of the call that opens a block, the front end and the map together, at most.
"""
_ERRORS = """### Errors, deg/h

*Largest found*: departure from the model in float64; fixed point: over all inputs that the visited positions stand for,
so with the rounding of the inputs to 16 bits and of the parameters; float32: over random inputs. *Arithmetic*: the
fixed-point map against its own table evaluated in float64. *Naive*: the map as one would write it down with `float` and
`expf`, against the model, at the random inputs of float32.
"""
_COUNTS = (
    "core",
    "arithmetic",
    "level",
    "6 centers: mean ",
    "most ",
    "64 centers: mean ",
    "most ",
    "each center ",
    "once ",
    "coverage ",
)
_SIZES = (
    "core",
    "arithmetic",
    "level",
    "map ",
    "lookup ",
    "static ",
    "stack ",
    "`sample`, 6 centers ",
    "64 ",
)
_FOUND = (
    "centers ",
    "arithmetic",
    "Σ\\|w\\| ",
    "bound ",
    "largest found ",
    "inputs ",
    "arithmetic ",
    "÷ Σ\\|w\\| ",
    "naive ",
)


@dataclass(frozen=True, slots=True)
class Aim:
    """A figure that is aimed at: at most `limit`."""

    what: str
    limit: float
    figure: Callable[[dict[str, Any]], float]


def _plain(result: dict[str, Any]) -> list[dict[str, Any]]:
    """Costs without a coverage map."""
    return [c for c in result["costs"] if not c["coverage"]]


def _mean(numeric: str, centers: int, *cores: str) -> Callable[[dict[str, Any]], float]:
    """The largest, over cores, of the least mean count over the compiler's levels."""

    def figure(result: dict[str, Any]) -> float:
        rows = [c for c in _plain(result) if (c["numeric"], c["centers"]) == (numeric, centers)]
        return float(max(min(c["map"]["mean"] for c in rows if c["core"] == core) for core in cores))

    return figure


def _least(key: str, *cores: str) -> Callable[[dict[str, Any]], float]:
    def figure(result: dict[str, Any]) -> float:
        rows = [c for c in _plain(result) if c["numeric"] == "q31" and c["core"] in cores]
        return float(max(min(c[key] for c in rows if c["core"] == core) for core in cores))

    return figure


#: Instructions of the dearest call of `sample` with 6 centers before channels were guarded and corrections had an
#: uncertainty (table layout 1), at the level that served the core best.
_BEFORE_GUARDS = {
    ("cortex-m3", "q31"): 847,
    ("cortex-m4f", "f32"): 657,
    ("cortex-m4f", "q31"): 849,
    ("cortex-m7", "f32"): 661,
    ("cortex-m7", "q31"): 848,
}


def _guards(numeric: str, *cores: str) -> Callable[[dict[str, Any]], float]:
    """What the dearest call of `sample` takes more than before the guards: the largest over cores."""

    def figure(result: dict[str, Any]) -> float:
        rows = [c for c in _plain(result) if (c["numeric"], c["centers"]) == (numeric, 6)]
        least = {core: min(c["sample"]["max"] for c in rows if c["core"] == core) for core in cores}
        return float(max(least[core] - _BEFORE_GUARDS[core, numeric] for core in cores))

    return figure


def _ratio(key: str, against: str) -> Callable[[dict[str, Any]], float]:
    def figure(result: dict[str, Any]) -> float:
        return float(max(e[key] / e[against] for e in result["errors"] if e["numeric"] == "q31"))

    return figure


_M4, _M7 = "cortex-m4f", "cortex-m7"
AIMS: tuple[Aim, ...] = (
    Aim("fixed point, 64 centers, Cortex-M3", 1420, _mean("q31", 64, "cortex-m3")),
    Aim("fixed point, 64 centers, Cortex-M4F and M7", 1500, _mean("q31", 64, _M4, _M7)),
    Aim("fixed point, 6 centers, Cortex-M3, M4F and M7", 180, _mean("q31", 6, "cortex-m3", _M4, _M7)),
    Aim("fixed point, 64 centers, Cortex-M0", 8300, _mean("q31", 64, "cortex-m0")),
    Aim("fixed point, 6 centers, Cortex-M0", 830, _mean("q31", 6, "cortex-m0")),
    Aim("float32, 64 centers, Cortex-M4F and M7", 2000, _mean("f32", 64, _M4, _M7)),
    Aim(
        "fixed point, `sample` more than before the guards, Cortex-M3, M4F and M7",
        40,
        _guards("q31", "cortex-m3", _M4, _M7),
    ),
    Aim("float32, `sample` more than before the guards, Cortex-M4F and M7", 40, _guards("f32", _M4, _M7)),
    Aim(
        "fixed point, bytes of the map (-Os), Cortex-M3, M4F and M7",
        340,
        _least("map_bytes", "cortex-m3", _M4, _M7),
    ),
    Aim("fixed point, bytes of the lookup table", 256, _least("lookup_bytes", _M4)),
    Aim(
        "fixed point, bytes of stack, Cortex-M3, M4F and M7", 56, _least("stack_bytes", "cortex-m3", _M4, _M7)
    ),
    Aim(
        "fixed point, bytes of writable static data",
        0,
        _least("ram_bytes", "cortex-m0", "cortex-m3", _M4, _M7),
    ),
    Aim(
        "fixed point, proved error of the Gaussians ÷ Σ\\|w\\|",
        3.5e-8,
        _ratio("gaussian_bound_dph", "sum_abs_weights_dph"),
    ),
    Aim("fixed point, largest error found ÷ bound", 1, _ratio("worst_dph", "bound_dph")),
    Aim("fixed point, arithmetic ÷ error of naive float32", 1, _ratio("arithmetic_dph", "naive_float32_dph")),
)


def section(result: dict[str, Any]) -> str:
    """The section as text."""
    parts = [
        _HEAD.format(**result),
        table(["aim", "at most ", "measured "], [_aim_row(a, result) for a in AIMS]),
        _MADE_OF,
        table(
            _COUNTS,
            [_count_row(result, c) for c in _plain(result) if c["centers"] == 6],
        ),
        _BYTES,
        table(
            _SIZES,
            [_byte_row(result, c) for c in _plain(result) if c["centers"] == 6],
        ),
        _ERRORS,
        table(
            _FOUND,
            [_error_row(e) for e in result["errors"]],
        ),
    ]  # fmt: skip
    return "\n".join(parts)


def _aim_row(aim: Aim, result: dict[str, Any]) -> Sequence[object]:
    figure = aim.figure(result)
    text = f"{figure:.4g}" if aim.limit >= 0.01 or figure == 0 else f"{figure:.2e}"
    return [aim.what, f"{aim.limit:g}", text if figure <= aim.limit else f"**{text}** (missed)"]


def _partner(result: dict[str, Any], cost: dict[str, Any], centers: int, coverage: bool) -> dict[str, Any]:
    """The same build with other tables."""
    keys = ("core", "level", "numeric")
    wanted = {k: cost[k] for k in keys} | {"centers": centers, "coverage": coverage}
    found: dict[str, Any] = next(c for c in result["costs"] if wanted.items() <= c.items())
    return found


def _count_row(result: dict[str, Any], six: dict[str, Any]) -> Sequence[object]:
    many, covered = _partner(result, six, 64, False), _partner(result, six, 6, True)
    each = (many["map"]["mean"] - six["map"]["mean"]) / 58.0
    counts = [f"{c['map'][k]:.0f}" for c in (six, many) for k in ("mean", "max")]
    once = six["map"]["mean"] - 6.0 * each
    more = covered["map"]["mean"] - six["map"]["mean"]
    return [
        six["core"],
        six["numeric"],
        f"`{six['level']}`",
        *counts,
        f"{each:.1f}",
        f"{once:.0f}",
        f"{more:.0f}",
    ]


def _byte_row(result: dict[str, Any], six: dict[str, Any]) -> Sequence[object]:
    many = _partner(result, six, 64, False)
    sizes = [six[k] for k in ("map_bytes", "lookup_bytes", "ram_bytes", "stack_bytes")]
    return [
        six["core"],
        six["numeric"],
        f"`{six['level']}`",
        *sizes,
        six["sample"]["max"],
        many["sample"]["max"],
    ]


def _error_row(e: dict[str, Any]) -> Sequence[object]:
    arithmetic = e["worst_dph"] if e["arithmetic_dph"] is None else e["arithmetic_dph"]
    return [
        e["centers"],
        e["numeric"],
        f"{e['sum_abs_weights_dph']:.3f}",
        f"{e['bound_dph']:.2e}",
        f"{e['worst_dph']:.2e}",
        f"{e['inputs']:,}",
        f"{arithmetic:.2e}",
        f"{arithmetic / e['sum_abs_weights_dph']:.1e}",
        f"{e['naive_float32_dph']:.2e}",
    ]
