"""Fit a model to a data set: front end, training, envelope and coverage, and the figures of `training.json`.

Joins the stages recordings → mirror → train → model; computes nothing of its own beyond the choice of
block, window and limits.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .. import __version__
from ..common.arrays import FloatArray
from ..common.errors import InputError
from ..common.inputs import MOST_HELD
from ..common.metrics import Averages
from ..common.progress import Progress, Stages, silent
from ..model import Model
from ..quality.event_findings import rows_used
from ..quality.judgement import Judged, judge, judge_runs
from ..recordings.fit_options import AUTO, SIMPLE, BuildOptions
from ..recordings.loading import calibration_day
from ..recordings.plausibility import earth_rate_warning
from ..recordings.records import Dataset, Rows, Run
from ..results.base import Finding
from ..results.evaluation import Pooled
from ..results.rows import RowsUsed
from ..results.training import CandidateModel, DeclaredUnits, MapMeans, NoiseTerms, Training
from .channels import chosen_channels, readings_alone, seen_by_target, with_channels
from .data import TrainingData, cleaned_samples, joined, scaling_of
from .methods import fit
from .networks import snapped
from .noise import noise_terms, sensitivities, stretches
from .plausibility import AGREE_S, longest_same_s, stuck_after_s
from .prior.earlier import posterior_of_process
from .prior.given import Prior
from .prior.unit_means import means_of_unit
from .prior.use import known_map
from .process import Process, TrainingHistory, fit_process, smooth
from .result import Fit, predict
from .samples import Blocks, run_blocks
from .simple import LeastSquares, powers_of_method
from .uncertainty import coverage, rezero_dph, uncertainty_of

__all__ = [
    "HOLD_S",
    "FitOptions",
    "Fitted",
    "Read",
    "fit_dataset",
    "front_end",
    "map_method",
    "model_of",
    "power_ons",
    "samples_of",
    "training_of",
    "units_of",
]

_SLOPE_WINDOW_S = 100.0  # as long as the paper's means
HOLD_S = 300.0  # at 5 C/min a held temperature is then off by 25 C: longer is no holding
_MAX_RATE_C_PER_MIN = 30.0  # of a product's thermometer: chambers of stress screening move air by 15 to 30
_MAX_STEP_C = 1.0  # beside the rate: room for resolution and noise of a coarse thermometer
# Gathered means are kept to this share of their noise, and their inputs to a tenth of what sensors resolve.
_MEANS_SHARE = 0.01
_MEANS_C_DECIMALS, _MEANS_C_PER_MIN_DECIMALS, _MAX_DECIMALS = 3, 4, 12
_COUNT_DIGITS = 4  # of the number of means, which may be a small share of one
_MIN_SAMPLES = 8  # two to a parameter of a plane, and two to spare
_NOT_GENERAL = ("does_not_generalise", "no_temperature_information")


@dataclass(frozen=True, slots=True, kw_only=True)
class FitOptions(BuildOptions):
    """Options of a fit: `[fit]` of a data set, and the prior of the unit.

    `prior` is what is known of the unit before its runs: a lot, or an earlier model.

    Raises:
        InputError: A value is out of its range; the message names it as it was stated.
    """

    prior: Prior | None = None


@dataclass(frozen=True, slots=True)
class Fitted:
    """A model, and what `training.json` says of it."""

    model: Model
    training: Training


@dataclass(frozen=True, slots=True)
class FrontEnd:
    """Settings of the front end; they become part of the model."""

    block_s: float
    slope_blocks: int
    max_step_c: float
    max_rate_c_per_min: float
    hold_blocks: int
    stuck_s: float = 0.0
    lead_blocks: int = 1
    agree_s: float = AGREE_S

    def blocks(self, run: Run, rows: Rows | None = None, judged: Judged | None = None) -> Blocks:
        """Run over a run.

        Args:
            rows: Those of its file, where they are in memory already.
            judged: Judgement of its rows and of those of the other runs; None: they are judged alone.
        """
        rows = run.rows() if rows is None else rows
        judged = judge_runs([run]) if judged is None else judged
        return run_blocks(
            rows,
            run,
            judged.usable(run, rows),
            block_s=self.block_s,
            slope_blocks=self.slope_blocks,
            max_step_c=self.max_step_c,
            max_rate_c_per_min=self.max_rate_c_per_min,
            stuck_s=self.stuck_s,
            agree_s=self.agree_s,
            hold_blocks=self.hold_blocks,
            lead_blocks=self.lead_blocks,
        )


def front_end(runs: Sequence[Run], block_s: float) -> FrontEnd:
    """Block rounded to whole median row periods (at least one), window of about 100 s, limits of belief.

    Raises:
        InputError: Whole rows make a block that is longer than any may be.
    """
    period = float(np.median([run.row_period_s for run in runs]))
    rounded = BuildOptions(block_s=max(1, round(block_s / period)) * period).block_s
    return FrontEnd(
        block_s=rounded,
        slope_blocks=int(np.clip(round(_SLOPE_WINDOW_S / rounded), 2, 20)),
        max_step_c=_MAX_STEP_C,
        max_rate_c_per_min=_MAX_RATE_C_PER_MIN,
        hold_blocks=min(max(1, round(HOLD_S / rounded)), MOST_HELD),
    )


def samples_of(blocks: Blocks, block_s: float, run: int) -> TrainingData:
    """Training samples of one run: what was in force during each valid block, and the block's mean rate."""
    used = blocks.used
    n = int(used.sum())
    return TrainingData(
        temperature_c=blocks.temperature_c[used].astype(np.float64),
        slope_c_per_min=blocks.slope_c[used].astype(np.float64) * (60.0 / block_s),
        bias_dph=blocks.rate_dph[used],
        weight=blocks.rows[used].astype(np.float64),
        run=np.full(n, run, dtype=np.int64),
        time_s=blocks.start_s[used],
        duration_s=np.full(n, block_s),
    )


# As `gyrotc fit -v` measures them on data of `gyrotc simulate paper`.
_STAGES = {"judging rows": 0.85, "reading": 0.05, "training": 0.1}


def fit_dataset(
    dataset: Dataset,
    options: FitOptions,
    *,
    judged: Judged | None = None,
    read: Read | None = None,
    progress: Progress = silent,
) -> Fitted:
    """Fit a model to the training runs of a data set.

    Args:
        judged: Judgement of the rows of its runs; None: they are judged here.
        read: What the front end made of the training runs, where it is known.
        progress: Takes note of every stage.

    Raises:
        InputError: No training run, or too few usable samples.
        TrainingFailed: The model of map and noise, which says what a correction leaves, cannot be solved.
    """
    if options.prior is not None:
        options.prior.check_axis(dataset.axis)
    runs = [run for run in dataset.runs if run.role == "train"]
    if not runs:
        raise InputError(str(dataset.folder), "no run has the role train", "at least one training run")
    say = Stages(progress, _STAGES)
    if read is None:
        if judged is None:
            say("judging rows")
            judged = judge(dataset)
        read = _read(dataset, judged.cut(runs), options, judged, say)
    front = front_end(read.runs, options.block_s)
    data, power_on = read.data, power_ons(read.runs)
    if data.bias_dph.size < _MIN_SAMPLES:
        raise InputError(
            str(dataset.folder),
            f"{data.bias_dph.size} usable samples of {front.block_s:g} s",
            f"at least {_MIN_SAMPLES}",
        )
    say("training")
    choice = None
    if options.channels:
        choice = chosen_channels(dataset, data, power_on, read.channels, options.average_s)
    added = choice.added if choice else np.zeros(len(data))
    data = replace(data, bias_dph=data.bias_dph - added)
    fitted = _judged(data, _fit(data, options, power_on=power_on, serial=dataset.serial), options.average_s)
    process = fitted.process or fit_process(cleaned_samples(data), fitted.scaling, power_on)
    fitted = replace(fitted, process=process)
    front = replace(front, stuck_s=stuck_after_s(read.longest_same_s))
    model = model_of(dataset, runs, data, fitted, front, options, added)
    training = training_of(dataset, read.runs, data, fitted, front, options)
    content: dict[str, Any] = {
        "rows": read.rows,
        "means": _means(data, fitted),
    }
    content |= {"lot": fitted.lot} if fitted.lot else {}
    content |= {"prior": fitted.prior} if fitted.prior else {}
    content["known"] = fitted.known or known_map(posterior_of_process(process, fitted.scaling))
    if choice:
        content["channels"] = choice.rows
        model = with_channels(model, choice, runs, data, HOLD_S) if choice.trial.chosen else model
    return Fitted(model, training.model_copy(update=content))


@dataclass(frozen=True, slots=True)
class Read:
    """Training runs after the front end.

    Attributes:
        runs: The runs that the samples number, as `Judged.cut` gives them.
        data: Training samples.
        channels: What the target would see of each recorded channel, shape (samples,).
        rows: Count of the rows that were used and left out.
        longest_same_s: Longest time for which a reading of the thermometer stayed the same, s.
    """

    runs: tuple[Run, ...]
    data: TrainingData
    channels: dict[str, FloatArray]
    rows: RowsUsed
    longest_same_s: float


def _read(dataset: Dataset, runs: tuple[Run, ...], options: FitOptions, judged: Judged, say: Progress) -> Read:
    """Read the training runs."""
    front = front_end(runs, options.block_s)
    parts, columns = [], []
    longest_s = 0.0
    for k, run in enumerate(runs):
        say("reading", k, len(runs))
        rows = run.rows()
        blocks = front.blocks(run, rows, judged)
        longest_s = max(longest_s, longest_same_s(blocks.stream.samples, run.row_period_s))
        parts.append(samples_of(blocks, front.block_s, k))
        rows = readings_alone(rows)
        columns.append(seen_by_target(dataset, rows, blocks) if options.channels else {})
        del blocks, rows  # before those of the next run are made: a file of 100 Hz fills memory
    whole = {name: np.concatenate([part[name] for part in columns]) for name in columns[0]}
    return Read(runs, joined(parts), whole, rows_used(judged, runs), longest_s)


def map_method(method: str) -> str:
    """The method whose map stands for a correction where a map must stand: beside effects, in a diagnosis."""
    return "mrbf" if method in (AUTO, *SIMPLE, "mrbf_t") else method


def power_ons(runs: Sequence[Run]) -> NDArray[np.int64]:
    """Number of the power-on of each stretch: a file is one recording, without a power-on within it."""
    keys = [(run.file, run.power_on_s) for run in runs]
    return np.array([sorted(set(keys), key=str).index(key) for key in keys], dtype=np.int64)


def _means(data: TrainingData, fitted: Fit) -> MapMeans:
    """Return what a lot is learnt from, in as many digits as its noise leaves."""
    samples = cleaned_samples(data)
    found, mean_s = means_of_unit(samples, scaling_of(samples), fitted.process)

    resolution = max(_MEANS_SHARE * found.sigma_dph, 10.0**-_MAX_DECIMALS)  # recordings may have no noise at all
    decimals = math.ceil(-math.log10(resolution))

    def rounded(values: NDArray[np.float64], decimals: int) -> tuple[float, ...]:
        return tuple(np.round(values, decimals).tolist())

    return MapMeans(
        temperature_c=rounded(found.temperature_c, _MEANS_C_DECIMALS),
        slope_c_per_min=rounded(found.slope_c_per_min, _MEANS_C_PER_MIN_DECIMALS),
        bias_dph=rounded(found.bias_dph, decimals),
        count=tuple(float(f"{count:.{_COUNT_DIGITS}g}") for count in found.count),
        sigma_dph=found.sigma_dph,
        mean_s=mean_s,
    )


def _fit(
    data: TrainingData, options: FitOptions, *, power_on: NDArray[np.int64] | None = None, serial: str = ""
) -> Fit:
    return fit(
        data,
        method=options.method,
        seed=options.seed,
        centers=options.centers,
        rho=options.rho,
        average_s=options.average_s,
        power_on=power_on,
        prior=options.prior,
        serial=serial,
    )


def _judged(data: TrainingData, fitted: Fit, average_s: float) -> Fit:
    """Return a fit that was asked for by name with what it leaves on history that it has not seen.

    Corrections by least squares and the map of the Gaussian model are left out by subtraction. Nothing is known of the
    others, which would have to be fitted again.
    """
    if fitted.folds or fitted.known or fitted.method not in (*SIMPLE, "mrbf"):
        return fitted
    history = TrainingHistory.of(cleaned_samples(data), fitted.scaling, fitted.power_on)
    history, smooth_map = history.without_outliers(smooth(history.count))
    found = smooth_map if fitted.method == "mrbf" else LeastSquares(history.power_ons, powers_of_method(fitted.method))
    left_out = [averages for [averages] in history.unseen([found], average_s)]
    process = fitted.process or Process.of(history, smooth_map)
    return replace(fitted, process=process, folds=history.folds, left_out=left_out)


def model_of(
    dataset: Dataset,
    runs: Sequence[Run],
    data: TrainingData,
    fitted: Fit,
    front: FrontEnd,
    options: FitOptions,
    added: NDArray[np.float64] | float = 0.0,
) -> Model:
    """The model that `model.json` holds: the fit with front end, coverage, uncertainty and facts of the data.

    `added`: what terms, which are not in it yet, add to the map at each sample, deg/h.
    """
    meta = dict(dataset.meta)
    if dataset.description:
        meta["description"] = dataset.description
    if (day := calibration_day(meta, (run.started for run in runs))) is not None:
        meta["calibrated_on"] = day
    meta["environments"] = sorted({run.environment for run in runs if run.environment})
    meta["earth_rate"] = _earth_rate(dataset)
    mean = float(np.average(data.bias_dph, weights=data.weight))
    warnings = [*dataset.warnings, earth_rate_warning(dataset.earth_rate, mean)]
    if fitted.lot is not None:
        meta["lot"] = f"{fitted.lot.checksum[:16]}: {fitted.lot.text}"
    if fitted.prior is not None:
        meta["prior"] = fitted.prior.text
    meta["warnings"] = [warning for warning in warnings if warning]
    known = uncertainty_of(data, fitted, block_s=front.block_s, added=added)
    return Model.from_dict(
        {
            "schema": "gyrotc.model/1",
            "serial": dataset.serial,
            "axis": dataset.axis,
            "method": fitted.method,
            "block_s": front.block_s,
            "slope_blocks": front.slope_blocks,
            "lead_blocks": front.lead_blocks,
            "scale": fitted.scale,
            "envelope": fitted.envelope,
            "coverage": coverage(data, fitted),
            "networks": [snapped(n, fitted.scale) for n in fitted.networks],
            "fallback_dph": fitted.fallback_dph,
            "hold_blocks": front.hold_blocks,
            "stuck_s": front.stuck_s,
            "agree_s": front.agree_s,
            "max_step_c": front.max_step_c,
            "max_rate_c_per_min": front.max_rate_c_per_min,
            "noise_floor_dph": fitted.noise_floor_dph,
            "noise_floor_source": "estimated",
            "average_s": options.average_s,
            "uncertainty_dph": known,
            "rezero_dph": rezero_dph(known["rules"]),
            "data": [_data_file(run) for run in dataset.runs],
            "seed": options.seed,
            "meta": meta,
        }
    )


def _earth_rate(dataset: Dataset) -> str:
    """Return in words what was done about Earth's rate, with the standard uncertainties of computed terms."""
    terms = {f"{run.earth.rate_dph:.4f} +- {run.earth.sigma_dph:.4f}" for run in dataset.runs if run.earth is not None}
    if terms:
        return f"computed and taken off: {', '.join(sorted(terms))} deg/h (1 sigma)"
    return dataset.earth_rate or "not stated"


def _data_file(run: Run) -> dict[str, Any]:
    span = None if run.from_s is None and run.to_s is None else (run.from_s, run.to_s)
    return {"file": run.file, "sha256": run.sha256, "span": span, "role": run.role}


def training_of(
    dataset: Dataset,
    runs: Sequence[Run],
    data: TrainingData,
    fitted: Fit,
    front: FrontEnd,
    options: FitOptions,
    left_out: Sequence[Averages] | None = None,
) -> Training:
    """Return what `training.json` holds.

    Args:
        runs: The runs that samples and folds number, as `Judged.cut` gives them.
        left_out: What the correction leaves on pieces that it has not seen, if it is known better than to the fit.
    """
    left_out = fitted.left_out if left_out is None else left_out
    return Training(
        gyrotc_version=__version__,
        serial=dataset.serial,
        axis=dataset.axis,
        units=units_of(dataset),
        method=fitted.method,
        seed=options.seed,
        samples=int(data.bias_dph.size),
        block_s=front.block_s,
        average_s=options.average_s,
        centers=fitted.n_centers,
        parameter_bytes=fitted.parameter_bytes,
        sum_abs_weights_dph=fitted.sum_abs_weights,
        predicted_rms_ratio=fitted.predicted_rms_ratio,
        prediction_withheld=fitted.withheld,
        noise_floor_dph=fitted.noise_floor_dph,
        spans=tuple(span for fold in fitted.folds for span in fold.results(runs)),
        left_out=Pooled.of(left_out) if left_out else None,
        left_out_spans=tuple(Pooled.of([a]) for a in left_out),
        noise=_noise(data, fitted, front.block_s),
        sensitivity=sensitivities(data.temperature_c, data.slope_c_per_min, data.bias_dph, data.weight),
        candidates=tuple(CandidateModel(**row) for row in fitted.candidates),
        reason=fitted.reason,
        generalises=_generalises(fitted),
        findings=tuple(Finding(**f) for f in fitted.findings),
        curves=dict(fitted.curves),
    )


def units_of(dataset: Dataset) -> DeclaredUnits:
    """Return the declared units, and the contradictions that the user overruled."""
    return DeclaredUnits(declared=dict(dataset.units), trusted=tuple(dataset.trusted))


def _generalises(fitted: Fit) -> bool | None:
    """Test whether the correction holds on history that it has not seen; None for a named method."""
    if any(f["id"] in _NOT_GENERAL for f in fitted.findings):
        return False
    return True if fitted.candidates else None


def _noise(data: TrainingData, fitted: Fit, block_s: float) -> NoiseTerms:
    """Noise terms of what the map leaves, from means over a block."""
    residual = data.bias_dph - predict(fitted, data.temperature_c, data.slope_c_per_min)
    return noise_terms(stretches(residual, data.time_s, data.run, block_s), block_s)
