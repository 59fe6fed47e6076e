"""Measure what channels gain on simulated gyros that nothing was tuned on.

Every world draws its own gyro: conductances, thermometers, differences of nodes, losses and expansion. Set 1 of the
scenario `signals` trains, set 2, two weeks later, judges. The oracle knows the true bias: what it leaves is noise.
"""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from gyrotc.causes import Scene
from gyrotc.model import Model
from gyrotc.recordings import Dataset, Rows, joined_runs, load
from gyrotc.simulate import read, read_truth, simulate
from gyrotc.tables import applied_of, quantise
from gyrotc.train import (
    FitOptions,
    TrainingData,
    average_samples,
    fit,
    fit_dataset,
    front_end,
    joined,
    power_ons,
    predict,
    samples_of,
    seen_by_target,
)
from numpy.typing import NDArray

from .campaigns import Settings, say
from .page import Figure, ResultsTable, figures_table
from .records import Record

Floats = NDArray[np.float64]

_WORLDS = 3  # seven minutes each
_SEEDS = 1000, 10**6  # drawn between; the method was tried on seeds below
_USELESS = 4  # channels that wander and mean nothing
_AIM = 0.95  # of the oracle's gain
_GPR_POINTS = 600  # its cost goes with the third power; with twice as many the RMS changed by less than 1 %


def scenario_of(seed: int) -> str:
    """A gyro of its own on the ground of `signals`."""
    rng = np.random.default_rng([seed, 14])
    _, plan = read("signals")

    def about(value: float, spread: float = 0.3) -> float:
        return float(value * np.exp(rng.normal(0.0, spread)))

    lines = ['extends = "signals"']
    for name, node in plan.gyro.node.items():
        lines += [f"[gyro.node.{name}]", f"heat_capacity_j_per_k = {about(node.heat_capacity_j_per_k)}"]
        if node.to:
            lines.append(f"to = {{{', '.join(f'{k} = {about(v)}' for k, v in node.to.items())}}}")
    for one in plan.thermometer:
        lines += ["[[thermometer]]", f'name = "{one.name}"', f'node = "{one.node}"']
        lines += [f"lag_s = {about(one.lag_s)}", f"offset_c = {rng.normal(0.0, 0.5)}"]
        lines += [f"noise_c = {one.noise_c}", f"resolution_c = {one.resolution_c}"]
    for d in plan.difference:
        sign = rng.choice([-1.0, 1.0])
        lines += ["[[difference]]", f'node = "{d.node}"', f'against = "{d.against}"']
        lines += [f"dph_per_c = {sign * about(d.dph_per_c)}", f"saturation_c = {rng.uniform(6.0, 20.0)}"]
        lines += [f"growth_per_c = {rng.normal(0.0, 0.004)}"]
    lines += ["[laser]", 'mirror_node = "mirror"', f"null_dph_per_ppm = {rng.choice([-1, 1]) * about(1e-4)}"]
    lines += [f"null_growth_per_c = {rng.normal(0.0, 0.003)}", f"stroke_dph = {rng.normal(0.0, 5e-4)}"]
    lines += [f"contamination_ppm = {about(6.0)}", f"expansion_ppm_per_c = {rng.normal(0.0, 0.03)}"]
    lines += [f"mirror_nm_per_c = {rng.normal(0.0, 4.0)}", f"walk_ppm = {about(20.0)}"]
    for k in range(_USELESS):
        lines += ["[[channel]]", f'name = "useless_{k}"', f"wander_sigma = {about(1.0)}", "noise = 0.01"]
        lines += [f"wander_tau_s = {about(3000.0, 1.0)}", f"per_air_c = {rng.normal(0.0, 0.02)}"]
    return "\n".join(lines) + "\n"


def world(seed: int, folder: Path) -> dict[str, Any]:
    """Figures of one gyro."""
    (folder / "world.toml").write_text(scenario_of(seed), "utf-8")
    simulate(folder / "world.toml", seed=seed, out=folder / "data")
    whole = load(folder / "data")
    dataset = replace(whole, channels=tuple(n for n in whole.channels if not n.startswith("useless")))
    exam = [run for run in whole.runs if run.role == "exam"]
    truth = read_truth(folder / "data")
    assert truth is not None
    noise = np.concatenate([truth.mean_noise_dph(run.file, 100.0)[1:] for run in exam])
    plain = fit_dataset(dataset, FitOptions()).model
    fitted = fit_dataset(dataset, FitOptions(channels=True))
    beside = fit_dataset(whole, FitOptions(channels=True))
    taken = [row.name for row in fitted.training.channels or () if row.verdict == "taken"]
    extra = [row.name for row in beside.training.channels or () if row.verdict == "taken"]
    rows = [run.rows() for run in exam]
    lost = {
        name: rms_of(fitted.model, [without(r, name) for r in rows], folder)
        for name in dataset.channels
        if any(name in one.split(" - ") for one in taken)
    }
    if lost:
        gone = rows
        for name in lost:
            gone = [without(r, name) for r in gone]
        lost["all"] = rms_of(fitted.model, gone, folder)
    return {
        "seed": seed,
        "oracle": float(np.sqrt(np.mean(noise**2))),
        "plain": rms_of(plain, rows, folder),
        "channels": rms_of(fitted.model, rows, folder),
        "useless": rms_of(beside.model, rows, folder),
        "useless_taken": sum(name.startswith("useless") for name in extra),
        "taken": taken,
        "lost": lost,
        "bytes": {"one thermometer": _bytes(plain), "with channels": _bytes(fitted.model)},
        "operations": {"one thermometer": _operations(plain), "with channels": _operations(fitted.model)},
        "shapes": {row.name: row.shape for row in fitted.training.channels or () if row.shape},
        **_others(dataset, fitted.model),
    }


def without(rows: Rows, name: str) -> Rows:
    return replace(rows, channels={**rows.channels, name: np.full(len(rows), np.nan)})


def rms_of(model: Model, runs: list[Rows], folder: Path) -> float:
    """RMS of 100-s means of rows of 10 s, without the first, in which the front end starts."""
    model.save(folder / "model.json")
    applied = applied_of(folder / "model.json")
    rest = [r.rate_dph - applied.correction_dph(r, 10.0) for r in runs]
    means = np.concatenate([x[: len(x) // 10 * 10].reshape(-1, 10).mean(axis=1)[1:] for x in rest])
    return float(np.sqrt(np.mean(means**2)))


def _bytes(model: Model) -> int:
    return int(quantise(model, "f32").parameter_bytes)


def _operations(model: Model) -> int:
    """Multiplications of a map call: six to a Gaussian with its exponential, and one to a channel."""
    bells = 2 * sum(term.id == "auxiliary_curve" for term in model.terms)
    return 6 * (model.n_centers + bells) + len(model.terms) + 2


def _seen(dataset: Dataset, role: str) -> tuple[TrainingData, dict[str, Floats], NDArray[np.int64]]:
    runs = joined_runs([run for run in dataset.runs if run.role == role])
    front = front_end(runs, 10.0)
    samples, columns = [], []
    for k, run in enumerate(runs):
        blocks = front.blocks(run)
        samples.append(samples_of(blocks, front.block_s, k))
        columns.append(seen_by_target(dataset, run.rows(), blocks))
    whole = {name: np.concatenate([c[name] for c in columns]) for name in columns[0]}
    return joined(samples), whole, power_ons(runs)


def _others(dataset: Dataset, model: Model) -> dict[str, Any]:
    """What the loss is made of, and peers on all channels."""
    train, inputs, _ = _seen(dataset, "train")
    exam, others, _ = _seen(dataset, "exam")
    peers = {}
    for name, run in _PEERS.items():
        x, of = _table(train, inputs)
        z, judged = _table(exam, others)
        center, spread = x.mean(axis=0), x.std(axis=0)
        answer, size, operations = run((x - center) / spread, (of.bias_dph - of.bias_dph.mean()) / of.bias_dph.std())
        left = judged.bias_dph - of.bias_dph.mean() - of.bias_dph.std() * answer((z - center) / spread)
        peers[name] = {"rms": _means_rms(judged, left), "bytes": size, "operations": operations}
    return {"left": _left(model, exam, others), "peers": peers}


def _table(data: TrainingData, inputs: Mapping[str, Floats]) -> tuple[Floats, TrainingData]:
    means = average_samples(data, 50.0)
    raw = [average_samples(replace(data, bias_dph=v), 50.0).bias_dph for v in inputs.values()]
    return np.stack([means.temperature_c, means.slope_c_per_min, *raw], axis=1), means


def _means_rms(data: TrainingData, left: Floats) -> float:
    means = average_samples(replace(data, bias_dph=left), 100.0).bias_dph
    return float(np.sqrt(np.mean(means**2)))


def _left(model: Model, exam: TrainingData, inputs: Mapping[str, Floats]) -> dict[str, float]:
    """RMS on the exam in float64: with the model, and with the exam's own map in place of the model's."""
    t, rng = exam.temperature_c, np.random.default_rng(0)
    beside = exam.bias_dph
    for term in model.terms:
        assert term.cause.bias is not None and term.channel is not None
        scene = Scene(exam.time_s, exam.time_s, t, t, t, inputs[term.channel], 0.0)
        beside = beside - term.cause.bias(scene, term.parameters, rng)
    own = fit(replace(exam, bias_dph=beside), method="mrbf")
    return {
        "map": _means_rms(exam, beside - model.map_dph(t, exam.slope_c_per_min)),
        "own map": _means_rms(exam, beside - predict(own, t, exam.slope_c_per_min)),
    }


Answer = tuple[Callable[[Floats], Floats], int, int]


def _gpr(x: Floats, y: Floats) -> Answer:
    from sklearn.gaussian_process import GaussianProcessRegressor
    from sklearn.gaussian_process.kernels import RBF, ConstantKernel, WhiteKernel

    kernel = ConstantKernel() * RBF(np.full(x.shape[1], 3.0), (0.1, 1e6)) + WhiteKernel(0.3)
    use = np.random.default_rng(0).permutation(len(x))[:_GPR_POINTS]
    found = GaussianProcessRegressor(kernel, random_state=0).fit(x[use], y[use])
    n, d = len(use), x.shape[1]
    return lambda z: np.asarray(found.predict(z)), 4 * n * (d + 1), n * (2 * d + 2)


def _boosting(x: Floats, y: Floats) -> Answer:
    from sklearn.ensemble import GradientBoostingRegressor

    found = GradientBoostingRegressor(n_estimators=200, max_depth=3, subsample=0.5, random_state=0).fit(x, y)
    nodes = sum(tree[0].tree_.node_count for tree in found.estimators_)
    return lambda z: np.asarray(found.predict(z)), 8 * nodes, 3 * 200


def _mlp(x: Floats, y: Floats) -> Answer:
    from sklearn.neural_network import MLPRegressor

    found = MLPRegressor(
        hidden_layer_sizes=(24,),
        activation="tanh",
        alpha=1e-2,
        early_stopping=True,
        max_iter=400,
        random_state=0,
    )
    found.fit(x, y)
    weights = sum(c.size for c in (*found.coefs_, *found.intercepts_))
    return lambda z: np.asarray(found.predict(z)), 4 * weights, weights


_PEERS = {
    "Gaussian process, a length for each input": _gpr,
    "gradient boosting, 200 trees": _boosting,
    "network of 24 tanh": _mlp,
}


def measure(settings: Settings) -> Record:
    """Train and judge each simulated gyro with one thermometer, with channels, with useless ones, and by peers."""
    drawn = int(np.random.default_rng().integers(*_SEEDS)) if settings.seed is None else settings.seed
    found = []
    for seed in range(drawn, drawn + (1 if settings.quick else _WORLDS)):
        say(f"gyro {seed}")
        with tempfile.TemporaryDirectory(prefix="gyrotc-signals-") as work:
            found.append(world(seed, Path(work)))
    gains = [(w["plain"] ** 2 - w["channels"] ** 2) / (w["plain"] ** 2 - w["oracle"] ** 2) for w in found]
    lost = [rms / w["plain"] - 1.0 for w in found for rms in w["lost"].values()]
    over = {name: [w[key] / w["oracle"] for w in found] for name, key in _OWN.items()}
    over |= {name: [w["peers"][name]["rms"] / w["oracle"] for w in found] for name in _PEERS}
    return {
        "seed": drawn,
        "worlds": len(found),
        "gain": float(np.mean(gains)),
        "reached": sum(gain >= _AIM for gain in gains),
        "useless_taken": sum(w["useless_taken"] for w in found),
        "lost_worst": max(lost, default=0.0),
        "over_oracle": {name: float(np.median(ratios)) for name, ratios in over.items()},
        "gyros": found,
    }


_OWN = {"gyrotc, one thermometer": "plain", "gyrotc with channels": "channels"}
_TEXT = """
{worlds} simulated gyros with three further temperature sensors and two signals of the laser are trained on six runs and
judged on six others two weeks later. The heat conductances, sensors and laser of each gyro are random. Gain: share of
the possible reduction of the mean square error, compared with one temperature sensor.
"""


def table(record: Record) -> ResultsTable:
    """Return what channels gain, what a lost channel costs, and other methods."""
    rows = [
        ("mean gain", Figure(record["gain"], ".1%", at_least=_AIM)),
        (f"gyros that reach this gain, of {record['worlds']}", Figure(record["reached"], at_least=record["worlds"])),
        ("channels without information that are used", Figure(record["useless_taken"], at_most=0)),
        (
            "RMS with a channel lost for the whole test, against one temperature sensor, worst",
            Figure(record["lost_worst"], "+.1%", at_most=0.02),
        ),
    ]
    rows += [
        (f"RMS ÷ noise, median: {name}", Figure(ratio, ".3f")) for name, ratio in record.get("over_oracle", {}).items()
    ]
    return figures_table(_TEXT.format(**record), rows)
