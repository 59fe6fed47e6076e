"""Instructions, bytes and errors of the map of the C runtime, counted in emulators.

Two models whose centers have individual widths in both inputs; every build that is counted has first answered the board
test bit for bit.
"""

from __future__ import annotations

import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any
from unittest import mock

import numpy as np
from gyrotc.common import CheckFailed
from gyrotc.mirror import Table, answers, evaluate_map
from gyrotc.model import Coverage, Envelope, Model, Network, Scale
from gyrotc.tables import emit, emitted_tables, make_vectors, vectors
from gyrotc.verify import Job, Target, all_targets, board_entries, compile_objects, compiler_version, symbols, visit_all
from numpy.typing import NDArray

from ..campaigns import say

GRIDS = {6: (3, 2), 64: (8, 8)}
LEVELS = ("-O2", "-O3 -fira-region=one", "-Os")
CORES = ("cortex-m0", "cortex-m3", "cortex-m4f", "cortex-m7")
_SUM = 0.02  # of the weights' magnitudes, deg/h
_VECTORS = 1000  # random ones; directed vectors and the history come on top
_EVERY = {6: 1, 64: 32}  # slices of slopes that are visited: every one, one in 32
_POINTS = 1_000_000


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


def instructions(*, quick: bool = False) -> dict[str, Any]:
    """Return instructions, bytes and errors of both models in both arithmetics.

    Args:
        quick: One model, core and level of the compiler, without errors.

    Raises:
        CheckFailed: A build gives other bits than the reference; an emulator is missing.
    """
    costs: list[dict[str, Any]] = []
    errors: list[dict[str, Any]] = []
    models = ((6, False), (6, True), (64, False))
    for n, coverage in models[:1] if quick else models:
        with (
            tempfile.TemporaryDirectory(prefix="gyrotc-") as work,
            mock.patch.object(vectors, "N_RANDOM", _VECTORS),
        ):
            job = _job(grid_model(n, coverage=coverage), Path(work))
            for core in CORES[2:3] if quick else CORES:
                for level in LEVELS[:1] if quick else LEVELS:
                    say(f"{n} centers{', coverage' * coverage}, {core} {level}")
                    costs += [{"coverage": coverage} | cost for cost in _costs(job, core, level, n)]
            if not (coverage or quick):
                say(f"{n} centers, errors")
                errors += _errors(job, n)
    return {
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
    """Return the bytes of the functions that the map is made of and of its lookup table, by arithmetic."""
    found = {}
    for numeric in job.tables:
        with tempfile.TemporaryDirectory(prefix="gyrotc-") as work:
            objects = compile_objects(target, [job.c_folder / f"gtc_{numeric}.c"], Path(work), include=job.c_folder)
            size = {s.name: s.size for s in symbols(target, *objects)}
        map_bytes = sum(size.get(name, 0) for name in (f"gtc_{numeric}_map", *_OF_MAP))
        found[numeric] = {"map_bytes": map_bytes, "lookup_bytes": size["exp2_table"]}
    return found


#: Functions that the map calls; a compiler that expands one in place leaves no symbol of it.
_OF_MAP = (
    "map_value",
    "locate",
    "position_of",
    "network_value",
    "gaussian",
    "exp2_of_minus",
    "within_authority",
    "is_covered",
)


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
