"""Costs of the C runtime, counted in emulators, and its errors: the section `runtime` of docs/results.md.

Two models whose centers have individual widths in both inputs; every build that is counted has first
answered the board test bit for bit.
"""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from unittest import mock

import numpy as np
from gyrotc.common.errors import CheckFailed
from gyrotc.model import Coverage, Envelope, Model, Network, Scale
from gyrotc.tables import vectors
from gyrotc.tables.emit import emit, emitted_tables
from gyrotc.tables.vectors import make_vectors
from gyrotc.mirror.history import answers
from gyrotc.mirror.history import evaluate_map
from gyrotc.mirror.table import Table
from gyrotc.verify.emitted import Job
from gyrotc.verify.board import board_entries
from gyrotc.verify.job import visit_all
from gyrotc.verify.toolchain import Target, all_targets, compile_objects, compiler_version, symbols
from numpy.typing import NDArray
from results import table

GRIDS = {6: (3, 2), 64: (8, 8)}
LEVELS = ("-O2", "-O3 -fira-region=one", "-Os")
CORES = ("cortex-m0", "cortex-m3", "cortex-m4f", "cortex-m7")
_SUM = 0.02  # of the weights' magnitudes, deg/h
_VECTORS = 1000  # random ones; directed vectors and the history come on top
_EVERY = {6: 1, 64: 32}  # slices of slopes that are visited: every one, one in 32
_POINTS = 1_000_000

Say = Callable[[str], None]


def grid_model(n: int, *, coverage: bool = False) -> Model:
    """A model of `n` centers near the places of a grid, all widths different (seed fixed).

    Args:
        n: A key of `GRIDS`.
        coverage: With a map of 16 × 8 cells that says where training data was.
    """
    rng = np.random.default_rng(20140801)
    columns, rows = GRIDS[n]
    t0, t1, r = -40.0, 60.0, 1.0
    t = t0 + (np.arange(columns) + 0.5) / columns * (t1 - t0)
    s = -r + (np.arange(rows) + 0.5) / rows * 2.0 * r
    centers = np.stack(np.meshgrid(t, s, indexing="ij"), axis=-1).reshape(-1, 2)
    centers += rng.uniform(-1.0, 1.0, centers.shape) * (2.0, 0.05)
    widths = rng.uniform((0.32, 0.35), (0.70, 0.90), centers.shape)
    weights = rng.normal(0.0, 1.0, n)
    weights *= _SUM / np.sum(np.abs(weights))
    network = Network(
        w0=0.007,
        linear=(0.0003, -0.0001),
        centers=tuple(map(tuple, centers.tolist())),
        widths=tuple(map(tuple, widths.tolist())),
        weights=tuple(weights.tolist()),
    )
    return Model(
        serial=f"GRID-{n}",
        axis=None,
        method="mrbf",
        block_s=10.0,
        slope_blocks=10,
        scale=Scale(temperature_c=((t0 + t1) / 2, (t1 - t0) / 2), slope_c_per_min=r),
        envelope=Envelope(temperature_c=(t0, t1), slope_c_per_min=(-r, r)),
        coverage=Coverage(cells=(16, 8), rows=("1" * 16,) * 8) if coverage else None,
        networks=(network,),
        fallback_dph=0.007,
        hold_blocks=30,
        max_step_c=1.0,
        max_rate_c_per_min=30.0,
        noise_floor_dph=0.0007,
        noise_floor_source="estimated",
        data=(),
        seed=0,
    )


def runtime(say: Say) -> dict[str, Any]:
    """Instructions, bytes and errors of both models in both arithmetics.

    Raises:
        CheckFailed: A build gives other bits than the reference; an emulator is missing.
    """
    costs: list[dict[str, Any]] = []
    errors: list[dict[str, Any]] = []
    for n, coverage in ((6, False), (6, True), (64, False)):
        with (
            tempfile.TemporaryDirectory(prefix="gyrotc-") as work,
            mock.patch.object(vectors, "N_RANDOM", _VECTORS),
        ):
            job = _job(grid_model(n, coverage=coverage), Path(work))
            for core in CORES:
                for level in LEVELS:
                    say(f"{n} centers{', coverage' * coverage}, {core} {level}")
                    costs += [{"coverage": coverage} | cost for cost in _costs(job, core, level, n)]
            if not coverage:
                say(f"{n} centers, errors")
                errors += _errors(job, n)
    return {
        "schema": "gyrotc.runtime/1",
        "compiler": compiler_version("arm-none-eabi-gcc"),
        "vectors": _VECTORS,
        "costs": costs,
        "errors": errors,
    }


def _job(model: Model, folder: Path) -> Job:
    emit(model, folder)
    tables = emitted_tables(folder / "c", model)
    made = make_vectors(model, tuple(tables))
    return Job(folder / "c", model, tables, {n: answers(table, made) for n, table in tables.items()})


def _costs(job: Job, core: str, level: str, n: int) -> Iterator[dict[str, Any]]:
    target = all_targets()[core]
    flags = (*(flag for flag in target.flags if flag != "-O2"), *level.split())
    target = target.model_copy(update={"flags": flags})
    sizes = _sizes(job, target)
    for entry in (found.content() for found in board_entries(job, target)):
        if entry["status"] != "pass":
            raise CheckFailed(f"{core} {level}: {entry}")
        yield {
            "core": core,
            "level": level,
            "numeric": entry["numeric"],
            "centers": n,
            "map": entry["instructions"],
            "sample": entry["step_instructions"],
            "stack_bytes": entry["stack_bytes"],
            "ram_bytes": entry["ram_bytes"],
            **sizes[entry["numeric"]],
        }


def _sizes(job: Job, target: Target) -> dict[str, dict[str, int]]:
    """Bytes of the map's function and of its lookup table, by arithmetic."""
    with tempfile.TemporaryDirectory(prefix="gyrotc-") as work:
        objects = compile_objects(target, [job.c_folder / "gtc.c"], Path(work), include=job.c_folder)
        # Public names carry the options that the runtime was compiled with.
        size = {s.name.partition("_20blocks")[0]: s.size for s in symbols(target, *objects)}
    return {
        n: {"map_bytes": size[f"gtc_{n}_map"], "lookup_bytes": size[f"gtc_{n}_exp2_table"]}
        for n in job.tables
    }


def _errors(job: Job, n: int) -> Iterator[dict[str, Any]]:
    """Bounds, and the largest errors found, in deg/h; fixed point by visiting inputs, float32 by random ones."""
    total = job.model.sum_abs_weights_dph
    naive = _naive_error(job.model)
    for numeric, emitted in job.tables.items():
        record = {
            "centers": n,
            "numeric": numeric,
            "sum_abs_weights_dph": total,
            "bound_dph": emitted.error_bound_dph,
            "gaussian_bound_dph": emitted.bound_parts_dph["Gaussian"],
            "naive_float32_dph": naive,
        }
        if numeric == "q31":
            visited = visit_all(job.c_folder, job.model, emitted, every=_EVERY[n])
            if visited.mismatches:
                raise CheckFailed(f"{n} centers: {visited.first}")
            yield record | {
                "inputs": visited.inputs,
                "worst_dph": visited.worst_dph,
                "arithmetic_dph": _words_error(emitted),
            }
        else:
            yield record | {
                "inputs": _POINTS,
                "worst_dph": _float_error(job.model, emitted),
                "arithmetic_dph": None,
            }


def _words_error(table: Table) -> float:
    """Of the fixed-point arithmetic alone: against the table's own words in float64, at random inputs."""
    rng = np.random.default_rng(2)
    low_t, high_t, low_r, high_r = (int(v) for v in table.numbers(table.envelope))
    inputs = np.stack([rng.integers(low_t, high_t, _POINTS), rng.integers(low_r, high_r, _POINTS)], axis=1)
    _, bits = evaluate_map(table, inputs.astype(np.int32).view(np.uint32))
    gain_t, gain_r, narrow = (int(v) for v in table.scale)
    x_t = (((inputs[:, 0] - low_t) * gain_t) >> 27).astype(np.float64)
    x_r = (((inputs[:, 1] - low_r) * gain_r) >> 27).astype(np.float64)
    _, w0, linear_t, linear_r, *_ = (float(v) for v in table.numbers(table.networks))
    total = w0 + (linear_t * x_t + linear_r * x_r) / 65536.0
    for s_t, k_t, s_r, k_r, weight in table.numbers(table.centers).reshape(-1, 5).astype(np.float64):
        u = ((s_t * x_t + k_t) ** 2 + (s_r * x_r + k_r) ** 2) / 2.0 ** (56 - narrow)
        total += weight * 2.0**-u
    return float(np.max(np.abs(table.decode_bias(bits) - total * 2.0**-table.bias_frac_bits)))


def _inputs(model: Model) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Random temperatures (C) and slopes (C per block) in float32."""
    rng = np.random.default_rng(1)
    (t0, t1), (r0, r1) = model.envelope.temperature_c, model.envelope.slope_c_per_min
    per_block = model.block_s / 60.0
    t = rng.uniform(t0, t1, _POINTS).astype(np.float32)
    slope = rng.uniform(r0 * per_block, r1 * per_block, _POINTS).astype(np.float32)
    return t, slope


def _float_error(model: Model, table: Table) -> float:
    t, slope = _inputs(model)
    _, bits = evaluate_map(table, np.stack([t, slope], axis=1).view(np.uint32))
    return float(np.max(np.abs(table.decode_bias(bits) - _exact(model, t, slope))))


def _exact(model: Model, t: NDArray[np.float32], slope: NDArray[np.float32]) -> NDArray[np.float64]:
    return model.map_dph(t.astype(np.float64), slope.astype(np.float64) * 60.0 / model.block_s)


def _naive_error(model: Model) -> float:
    """Of the map as one would write it down with `float` and `expf`."""
    t, slope = _inputs(model)
    network, f = model.networks[0], np.float32
    center, half = model.scale.temperature_c
    z_t = (t - f(center)) / f(half)
    z_r = slope * f(60.0 / model.block_s) / f(model.scale.slope_c_per_min)
    total = f(network.w0) + f(network.linear[0]) * z_t + f(network.linear[1]) * z_r
    for (c_t, c_r), (w_t, w_r), weight in zip(network.centers, network.widths, network.weights, strict=True):
        a = (z_t - f((c_t - center) / half)) / f(w_t)
        b = (z_r - f(c_r / model.scale.slope_c_per_min)) / f(w_r)
        total = total + f(weight) * np.exp(-(a * a + b * b))
    assert total.dtype == np.float32
    return float(np.max(np.abs(total - _exact(model, t, slope))))


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
