"""The gain of an extension on runs that its choice has not seen, with intervals.

Share of removable excess: (before² − after²)/(without any cause² − floor²), RMS of means over `average_s`, so that
shares of causes that were added one after the other have one total. Intervals come from drawing half-hours (for the
angle: hours) of the scored runs again, a paired bootstrap; half an hour is longer than what a map leaves stays alike.
Where there are few half-hours, twelfths of all.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from ..common.arrays import FloatArray, masked, parts_of
from ..common.metrics import HALF_HOUR_S, HOUR_S, MAD_TO_SIGMA, Averager, Averages, time_statistics, window_means
from ..mirror.history import FollowedHistory, follow_history
from ..mirror.table import Table
from ..model import Model
from ..recordings.records import Rows, Run
from ..results.base import Estimate
from ..results.diagnosed import GainOnUnseen
from ..tables.emission import quantise_all
from ..train.noise import steps_of, stretches
from ..verify.replay import replay_inputs
from .blocks import Records

_FEWEST_PIECES = 12  # a bootstrap of fewer pieces has limits that are single pieces
_SEED = 1  # of the draws
_DRAWS = 1000  # 25 draws lie beyond each limit of the middle 95 %
# Larger differences are clipped, in robust standard deviations, so that outliers do not raise the floor.
_CLIP_SIGMAS = 4.0


def emitted_means(models: Sequence[Model], runs: Sequence[Run], average_s: float) -> list[list[Averages]]:
    """Return the residuals of the emitted tables of each model, bit for bit, on the rows that all of them correct.

    A target is switched on with its gyro: where the file goes on from before the power-on of a run, the replay begins
    at the power-on.

    Temperatures of the means are NaN: in addition to the histories they would fill the memory.
    """
    tables = [next(iter(quantise_all(model, None).tables.values())) for model in models]
    found: list[list[Averages]] = [[] for _ in models]
    for run in runs:
        histories = [_followed(run, model, table) for model, table in zip(models, tables, strict=True)]
        rows = replace(_rows_since_power_on(run), temperature_c=np.zeros(0))
        inside = run.in_span(rows.time_s)
        averagers = [Averager(masked(rows.time_s, inside), average_s) for _ in models]
        for at in parts_of(len(rows)):
            span, answers = inside[at], [history.rows(at) for history in histories]
            scored = np.all([(answer.block_valid & answer.begun)[span] for answer in answers], axis=0)
            time, rate = rows.time_s[at][span], rows.rate_dph[at][span]
            unknown = np.full(time.size, np.nan)
            for averager, answer, table in zip(averagers, answers, tables, strict=True):
                averager.add(time, unknown, rate, rate - table.decode_bias(answer.bits)[span], scored)
        for means, averager in zip(found, averagers, strict=True):
            made = averager.averages()
            means.append(replace(made, temperature_c=np.full(made.time_s.size, np.nan)))
        del rows, histories  # before those of the next run are read
    return found


def _followed(run: Run, model: Model, table: Table) -> FollowedHistory:
    """Return the history of a run without its samples, made after the rows are freed, which take more memory.

    What a call of `sample` returns is therefore not known; corrections, and which blocks are valid, are.
    """
    rows = replace(_rows_since_power_on(run), rate_dph=np.zeros(0))
    channels, missed, per_block = replay_inputs(rows, run, model, table)
    del rows
    history = follow_history(table, channels, missed=missed, samples_per_block=per_block)
    stream, corrections = history.stream, history.corrections
    return replace(
        history,
        stream=replace(stream, samples=np.zeros(0, dtype=stream.samples.dtype)),
        corrections=replace(corrections, accepted=np.broadcast_to(np.bool_(True), corrections.accepted.shape)),
    )


def _rows_since_power_on(run: Run) -> Rows:
    rows = run.rows()
    return rows.from_row(run.first_powered(rows.time_s))


def floor_of(records: Records, left_dph: FloatArray, average_s: float) -> float:
    """Return the noise floor of means over `average_s`, deg/h.

    The floor is the Allan deviation of the residuals of the block means. Residuals of a correction would not do: on a
    quick ramp its delay is far above the noise. All pairs of neighbouring means are used, so the result does not
    depend on where the means begin.

    Args:
        records: Runs with the blocks that `left_dph` belongs to.
        left_dph: Block means less map and causes, shape (N,).
        average_s: Averaging time of the floor.
    """
    width = max(round(average_s / records.block_s), 1)
    run = np.repeat(np.arange(len(records.kept)), [kept.size for kept in records.kept])
    parts = stretches(left_dph, np.concatenate(records.kept).astype(float), run, 1.0)
    steps = np.abs(np.concatenate([steps_of(p, width) for p in parts if p.size >= 2 * width] or [left_dph]))
    near = np.minimum(steps, _CLIP_SIGMAS * MAD_TO_SIGMA * np.median(steps))
    return float(np.sqrt(np.mean(near**2) / 2.0 * width * records.block_s / average_s))


def gain_of(
    before: Sequence[Averages],
    after: Sequence[Averages],
    floor: float,
    average_s: float,
    *,
    whole_dph: float | None = None,
) -> GainOnUnseen:
    """Compare two sets of residuals on the same samples.

    `whole_dph`: RMS without any cause, of which shares are taken; None: `before` is without any.
    """
    b2, a2, weight = _pieces(before, after, average_s)
    total = weight.sum()
    rms_b, rms_a = float(np.sqrt(b2.sum() / total)), float(np.sqrt(a2.sum() / total))
    rng = np.random.default_rng(_SEED)
    drawn = rng.integers(0, weight.size, (_DRAWS, weight.size))
    n = weight[drawn].sum(axis=1)
    diff = (b2 - a2)[drawn].sum(axis=1) / n
    removed = np.sqrt(b2[drawn].sum(axis=1) / n) - np.sqrt(a2[drawn].sum(axis=1) / n)
    excess = (rms_b if whole_dph is None else whole_dph) ** 2 - floor**2
    share = low = high = None
    if excess > 0.02 * floor**2:
        shares = diff / excess
        share = (rms_b**2 - rms_a**2) / excess
        low, high = _middle_95(shares)
    low_removed, high_removed = _middle_95(removed)
    angles = [_pooled(runs, average_s, "angle_1h_arcsec") for runs in (before, after)]
    return GainOnUnseen(
        exam_rms_before_dph=rms_b,
        exam_rms_after_dph=rms_a,
        share_of_excess_removed=share,
        low=low,
        high=high,
        rms_removed_dph=Estimate(value=rms_b - rms_a, low=low_removed, high=high_removed),
        angle_1h_removed_arcsec=_angle_removed(before, after, average_s, angles, rng),
        angle_1h_before_arcsec=angles[0],
        angle_1h_after_arcsec=angles[1],
        rms_30min_before_dph=_pooled(before, average_s, "rms_30min_dph"),
        rms_30min_after_dph=_pooled(after, average_s, "rms_30min_dph"),
    )


def _pieces(
    before: Sequence[Averages], after: Sequence[Averages], average_s: float
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Sums of squares before and after, and number of samples, of half-hour pieces."""
    most = sum(x.after_dph.size for x in before) // _FEWEST_PIECES
    size = max(min(round(HALF_HOUR_S / average_s), most), 1)
    b2, a2, weight = [], [], []
    for x, y in zip(before, after, strict=True):
        cuts = np.arange(0, x.after_dph.size, size)
        b2.append(np.add.reduceat(x.after_dph**2, cuts))
        a2.append(np.add.reduceat(y.after_dph**2, cuts))
        weight.append(np.diff(np.append(cuts, x.after_dph.size)))
    return np.concatenate(b2), np.concatenate(a2), np.concatenate(weight).astype(float)


def _middle_95(draws: FloatArray) -> tuple[float, float]:
    low, high = np.quantile(draws, [0.025, 0.975])
    return float(low), float(high)


def _angle_removed(
    before: Sequence[Averages],
    after: Sequence[Averages],
    average_s: float,
    angles: Sequence[float | None],
    rng: np.random.Generator,
) -> Estimate | None:
    """Return the difference of the RMS angles after one hour, arcsec (1 deg/h is 1 arcsec/s); None for short runs."""
    was, remains = angles
    b, a = (np.concatenate([window_means(r, HOUR_S, average_s) for r in runs]) for runs in (before, after))
    if was is None or remains is None or b.size < 2:
        return None
    drawn = rng.integers(0, b.size, (_DRAWS, b.size))
    rms = [np.sqrt((x[drawn] ** 2).mean(axis=1)) for x in (b, a)]
    low, high = _middle_95(rms[0] - rms[1])
    return Estimate(value=was - remains, low=HOUR_S * low, high=HOUR_S * high)


def _pooled(runs: Sequence[Averages], average_s: float, name: str) -> float | None:
    """RMS over the runs of one of their figures."""
    values = [time_statistics(r, average_s)[name] for r in runs]
    squares = [v**2 for v in values if v is not None]
    return float(np.sqrt(np.mean(squares))) if squares else None
