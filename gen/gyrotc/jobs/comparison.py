"""Compare training methods on one data set, in the form of the paper's Table 1.

Methods train on the training runs and are judged on the test runs; without test runs, on spans (or runs) that were left
out in turn. Corrections are the maps in float64, with the input in force.
"""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from .. import __version__
from ..common.errors import InputError
from ..common.metrics import Averages, average_rows
from ..common.progress import Progress, Stages, silent
from ..common.threads import with_one_thread
from ..quality.judgement import judge
from ..recordings.fit_options import COMPARED, DEFAULTS, BuildOptions
from ..recordings.records import Dataset, Run
from ..results.evaluation import Comparison, Group, Method, Pooled
from ..train.data import TrainingData, joined
from ..train.fitting import front_end, power_ons, samples_of
from ..train.folds import folds
from ..train.methods import fit
from ..train.result import Fit, predict
from ..train.samples import Blocks

_JudgedOn = Literal["exam", "left_out"]


@dataclass(frozen=True, slots=True)
class _Held:
    """Samples of one run (or span) to judge on, and which training samples a fit for them may see."""

    environment: str
    samples: TrainingData
    seen: NDArray[np.bool_]
    from_s: float | None = None  # where its means begin: with the run, also where nothing is accepted yet


@with_one_thread
def compare(
    dataset: Dataset,
    options: BuildOptions = DEFAULTS,
    *,
    methods: Sequence[str] = COMPARED,
    progress: Progress = silent,
) -> Comparison:
    """Train and judge every method.

    Args:
        dataset: With at least one training run.
        options: Seed, block length and averaging; the others are each method's own.
        methods: Their names.
        progress: Takes note of every method.

    Returns:
        What `compare.json` holds.

    Raises:
        InputError: No training run, or no usable sample.
    """
    say = Stages(progress, {"reading": 0.05, "training": 0.95})
    say("reading")
    options = options.with_stated(dataset.fit)
    data, held, judged_on = _samples(dataset, options)
    _fit(methods[0], data, options)  # what a first call loads is not training time
    judged = []
    training = say.within("training", "training ")
    for k, method in enumerate(methods):
        training(method, k, len(methods))
        judged.append(_judged(method, data, held, options))
    reference = next((m for m in judged if m.id == "mrbf"), judged[0])
    return Comparison(
        gyrotc_version=__version__,
        serial=dataset.serial,
        axis=dataset.axis,
        block_s=options.block_s,
        average_s=options.average_s,
        seed=options.seed,
        judged_on=judged_on,
        noise_floor_dph=reference.noise_floor_dph,
        noise_floor_source="estimated",
        methods=tuple(judged),
    )


def _samples(dataset: Dataset, options: BuildOptions) -> tuple[TrainingData, list[_Held], _JudgedOn]:
    """All training samples, what is judged, and on what."""
    training: Sequence[Run] = [run for run in dataset.runs if run.role == "train"]
    if not training:
        raise InputError(str(dataset.folder), "no run has the role train", "at least one training run")
    judged = judge(dataset)
    training = judged.cut(training)
    front = front_end(training, options.block_s)
    blocks = [front.blocks(run, judged=judged) for run in training]
    parts = [samples_of(b, front.block_s, k) for k, b in enumerate(blocks)]
    data = joined(parts)
    if len(data) == 0:
        raise InputError(str(dataset.folder), "no usable sample", "at least one valid block of a training run")
    exam = [run for run in dataset.runs if run.role == "exam"]
    everything = np.ones(len(data), dtype=bool)
    if exam:
        held = [
            _Held(run.environment or run.file, samples_of(b, front.block_s, k), everything, b.begins_s)
            for k, (run, b) in enumerate((run, front.blocks(run, judged=judged)) for run in exam)
        ]
        return data, [h for h in held if len(h.samples)], "exam"
    left_out = _left_out(training, data, parts, blocks)
    return data, [h for h in left_out if h.seen.any()], "left_out"


def _left_out(
    training: Sequence[Run], data: TrainingData, parts: Sequence[TrainingData], blocks: Sequence[Blocks]
) -> list[_Held]:
    """Return the pieces of the training runs that are left out in turn."""
    found = []
    for fold in folds(data, power_ons(training)):
        seen = ~fold.near(data)
        if fold.kind in ("run", "power-on"):
            found += [
                _Held(training[k].environment or training[k].file, parts[k], seen, blocks[k].begins_s)
                for k in (span.run for span in fold.spans)
            ]
            continue
        [span] = fold.spans
        name = f"{training[span.run].file} {span.from_s:g} ... {span.to_s:g} s ({fold.kind})"
        found.append(_Held(training[span.run].environment or name, data.select(fold.held(data)), seen))
    return found


def _judged(method: str, data: TrainingData, held: Sequence[_Held], options: BuildOptions) -> Method:
    began = time.process_time()
    whole = _fit(method, data, options)
    seconds = time.process_time() - began
    judged: dict[str, list[Averages]] = {}
    for part in held:
        unseen = whole if part.seen.all() else _fit(method, data.select(part.seen), options)
        s = part.samples
        after = s.bias_dph - predict(unseen, s.temperature_c, s.slope_c_per_min)
        means = average_rows(
            s.time_s,
            s.temperature_c,
            s.bias_dph,
            after,
            scored=np.ones(len(s), dtype=bool),
            average_s=options.average_s,
            from_s=part.from_s,
        )
        judged.setdefault(part.environment, []).append(means)
    constant_dph = whole.fallback_dph
    total = Pooled.of([means for parts in judged.values() for means in parts], constant_dph)
    return Method(
        id=method,
        groups=tuple(
            Group(
                environment=name,
                samples=part.samples,
                before_rms_dph=part.before.rms_dph,
                before_std_dph=part.before.std_dph,
                after_rms_dph=part.after.rms_dph,
                after_std_dph=part.after.std_dph,
                improvement=part.improvement,
                improvement_about_zero=part.improvement_about_zero,
            )
            for name, part in ((name, Pooled.of(parts, constant_dph)) for name, parts in judged.items())
        ),
        exam_rms_dph=total.after.rms_dph,
        exam_std_dph=total.after.std_dph,
        before_rms_dph=total.before.rms_dph,
        improvement=total.improvement,
        improvement_about_zero=total.improvement_about_zero,
        centers=whole.n_centers,
        parameter_bytes=whole.parameter_bytes,
        sum_abs_weights_dph=whole.sum_abs_weights,
        noise_floor_dph=whole.noise_floor_dph,
        train_s=seconds,
    )


def _fit(method: str, data: TrainingData, options: BuildOptions) -> Fit:
    return fit(data, method=method, seed=options.seed, average_s=options.average_s)
