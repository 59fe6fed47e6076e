"""Changes of a rate that neither temperature, its rate, nor noise explains: one search in one likelihood (`fits`).

Every place of every run is tried for a step, a transition of a duration, a departure that comes back, and a drift that
begins. What is clear is fitted, all changes found are placed anew beside one another, those that are not clear any more
are dropped, and the search goes on in what is left; then the noise is estimated anew beside what was found, and all is
done once more. The level is controlled over all places of all runs together (Bonferroni): chance makes a change in one
of two hundred sets. See Basseville and Nikiforov, Detection of Abrupt Changes, 1993, 2.2 and 4.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Literal, NamedTuple

import numpy as np
from scipy.special import stdtrit

from ..common.arrays import FloatArray, parts_of
from ..common.statistics import CHI2_95_ONE, NORMAL_95, noise_of
from .findings import ValueWithLimits
from .fits import (
    LEAST_ENERGY,
    LONGEST_GAP_S,
    Regression,
    RowArrays,
    RunCells,
    RunFit,
    SmoothFit,
    WhiteRuns,
    gains_of_pairs,
    knots_and_noise,
    likeliest_noise,
    maps_of,
    own_energy,
    run_cells,
)

RateChangeKind = Literal["step", "transition", "drift", "gain"]
_Tried = tuple[str, float]
"""Shape that the search tries: kind, and how long it lasts, s."""

_STEP: _Tried = ("step", 0.0)

FALSE_ALARMS = 0.005  # sets of which one has a change by chance
_CELL_S, _COARSE_S = 10.0, 60.0  # of the search, and of the noise's estimate
_MOST_CELLS = 150_000  # of all runs: longer ones have longer cells
_STEP_S = 30.0  # what takes no longer is a step
# From a step to ten minutes, where a drift begins
_DURATIONS_S = (0.0, 30.0, 60.0, 90.0, 120.0, 180.0, 300.0, 450.0, 600.0)
_TRIED_S = (0.0, 150.0, 600.0)  # durations of the search: a place found is then tried for all
_BACK_S = (120.0, 240.0, 480.0, 960.0, 1920.0, 3840.0)  # after which a departure comes back: octaves
_MARGIN = 1.25  # beyond chance: memories of the temperature leave kinks that no noise makes; chosen on recordings
_KINDS = 4.0  # kinds of change, as looks: shapes of one kind are nearly one
_INDEPENDENT = 5.0  # cells to a degree of freedom of a scale from a median of what is correlated
_LEAST_CELLS = 60  # beside the columns that are fitted: fewer do not show what noise makes
_MOST = 12  # changes of a run that are fitted: more are what it always does
_AROUND_S = 240.0  # in which a place is sought anew
_EDGE = 3  # cells at the ends of a run in which a change cannot be distinguished from noise
_LEAST_LENGTH = 4 * _EDGE  # in cells: a shorter run has hardly a place for a change
_HOUR_S = 3600.0  # by definition
_PLACED_95 = 7.35  # of a likelihood ratio of places: Hansen, Econometrica 68 (2000) 575, table 1
_NEAR_CELLS = 8  # on either side of a step, in which its rows are looked at
_PLACES = 240  # that are tried around a change
_PARTS = (0.0, -0.75, -0.5, -0.25, 0.25, 0.5, 0.75)  # of a cell, that a change may begin beside its edge
_GAIN_S = 1200.0  # from an end of a run, within which the curve does not show a gain
_GAIN_PLACES = 60  # of a run that are tried for one; then it is placed anew
_LEAST_GAIN = 0.1  # of a change of gain: smaller ones are what terms and temperatures of runs do to a slope
_AT_STEP = 4.0  # standard errors of a gain at a step that is known: one in 16,000 by chance
_LEAST_OTHERS = 2  # of two runs nobody knows which one differs
_TOGETHER = 2**15  # values that are looked at together: as many as a cache holds
_ROUNDS = 3  # in which all changes of a run are placed anew


@dataclass(frozen=True, slots=True)
class Change:
    """A change of the rate of one run.

    Attributes:
        run: Number of the run.
        kind: A step is over within 30 s or one row.
        time_s: Of a step its first row behind, of a transition its middle, of a drift its beginning; 95 % limits, for
            a transition with its duration.
        duration_s: Of a transition, else 0.
        size: deg/h, of a drift deg/h each hour, of a gain the factor; 95 % limits.
        sigmas: Size over its standard error.
        gap_s: Length of the gap in the rows that it falls into, else 0.
        restarts: True if the gyro was switched on anew in that gap.
    """

    run: int
    kind: RateChangeKind
    time_s: ValueWithLimits
    duration_s: float
    size: ValueWithLimits
    sigmas: float
    gap_s: float = 0.0
    restarts: bool = False

    def falls_into(self, gap_s: tuple[float, float]) -> bool:
        """Test whether it happened while rows were missing; `gap_s`: times of the rows on both sides of the gap."""
        return self.gap_s > 0.0 and self.time_s[1] <= gap_s[0] and gap_s[1] <= self.time_s[2]


@dataclass(frozen=True, slots=True)
class _At:
    """A change as the search has it: beginning (s), duration (s)."""

    run: int
    kind: RateChangeKind
    begin_s: float
    duration_s: float = 0.0

    @property
    def middle_s(self) -> float:
        return self.begin_s + 0.5 * self.duration_s

    def columns(self, time_s: FloatArray, cell_s: float, curve: FloatArray) -> list[FloatArray]:
        """Return what a change of size 1 adds to cells with these means of time; of a gain first its own step.

        Args:
            curve: The map along the run, deg/h, that a gain changes.
        """
        if self.kind == "gain":
            behind = np.asarray(time_s >= self.begin_s, dtype=np.float64)
            return [behind, curve * behind]
        return [self.column(time_s - self.begin_s, cell_s)]

    def column(self, since: FloatArray, cell_s: float) -> FloatArray:
        """Return what a step, a transition or a drift of size 1 adds to cells at these times since its beginning, s."""
        if self.kind == "drift":
            return np.asarray(np.maximum(since, 0.0) / _HOUR_S)
        if self.duration_s <= cell_s:
            return np.asarray(np.clip((since - 0.5 * self.duration_s) / cell_s + 0.5, 0.0, 1.0))
        return np.asarray(np.clip(since / self.duration_s, 0.0, 1.0))


def cell_length(total_s: float) -> float:
    """Return the length of the cells in which runs of so many seconds in all are searched, s."""
    return max(_CELL_S, total_s / _MOST_CELLS)


def changes_in_cells(cells: Sequence[RunCells], rows_of: Callable[[int], RowArrays]) -> list[Change]:
    """Return the changes of all runs, by run in order of time.

    Args:
        cells: Means over cells of each run (`cell_length`).
        rows_of: Gives time, temperature and rate of the rows of a run that may be used; called for runs with changes.
    """
    long = [k for k, one in enumerate(cells) if len(one) > _LEAST_LENGTH and np.ptp(one.rate_dph) > 0.0]
    fine = [cells[k] for k in long]
    coarse = [run_cells((one.time_s, one.temperature_c, one.rate_dph), max(_COARSE_S, one.cell_s)) for one in fine]
    if sum(len(one) for one in coarse) < _LEAST_CELLS:
        return []
    knots_c, noise = knots_and_noise(coarse)
    found: list[_At] = []
    curves: list[FloatArray] = [np.zeros((2, 1))] * len(fine)
    for _ in range(2):
        if found:
            beside = [_columns(one, k, found, curves) for k, one in enumerate(coarse)]
            noise, _ = likeliest_noise(Regression(coarse, maps_of(coarse, knots_c)), beside, noise)
        regression = Regression(fine, maps_of(fine, knots_c))
        search = _Search(regression.white(noise.in_cells(min(one.cell_s for one in fine))), curves)
        found = search.found(found)
        if not found:
            return []
    changes = (search.change(at, found, rows_of(long[at.run])) for at in found)
    known = [replace(one, run=long[one.run]) for one in changes if one is not None]
    gains = [one for one in known if one.kind == "gain"]
    kept = [one for one in known if one in gains or not any(_within(one, gain) for gain in gains)]
    return sorted(kept, key=lambda one: (one.run, one.time_s[0]))


def paired(changes: Sequence[Change]) -> Iterator[tuple[Change, Change | None]]:
    """Yield the changes of a run; a step that comes back with the step that takes it back."""
    k = 0
    while k < len(changes):
        one, back = changes[k], changes[k + 1] if k + 1 < len(changes) else None
        comes_back = one.gap_s == 0.0 and back is not None and back.gap_s == 0.0 and _undoes(one, back)
        yield one, back if comes_back else None
        k += 2 if comes_back else 1


def _undoes(one: Change, back: Change) -> bool:
    """Test whether the second step takes the first one back, by their intervals."""
    if {one.kind, back.kind} - {"step", "transition"}:
        return False
    low, high = sorted((-back.size[1], -back.size[2]))
    own_low, own_high = sorted(one.size[1:])
    return one.size[0] * back.size[0] < 0.0 and low <= own_high and own_low <= high


def _within(one: Change, gain: Change) -> bool:
    """Test whether a change is the step that a change of gain makes."""
    return one.run == gain.run and one.time_s[1] <= gain.time_s[2] and gain.time_s[1] <= one.time_s[2]


def _columns(cells: RunCells, run: int, changes: Sequence[_At], curves: Sequence[FloatArray]) -> FloatArray | None:
    """Return the columns of the changes of a run, shape (k, n), if there are any.

    Args:
        curves: Times and the map along each run, shape (2, n).
    """
    t = cells.time_s
    own = [at for at in changes if at.run == run]
    curve = np.interp(t, *curves[run]) if own else t
    return np.stack([c for at in own for c in at.columns(t, cells.cell_s, curve)]) if own else None


def _over_s(cells: RunCells) -> float:
    """Return the longest time of a step, s: two rows that are means may hold it."""
    return max(_STEP_S, 2.0 * cells.cell_s)


@dataclass(frozen=True, slots=True)
class _Looked:
    """Statistics of a run at the places of the search.

    Attributes:
        sizes: Sizes over errors of changes at every cell, shape (n,), by what is tried.
        gains: Changes of gain that are tried, those at known steps last.
        with_step, alone: Squares of their sizes over errors, each with its step and beside it.
    """

    sizes: dict[_Tried, FloatArray]
    gains: list[_At]
    with_step: FloatArray
    alone: FloatArray


class _Search:
    """Runs with the noise that their changes are judged against."""

    def __init__(self, runs: WhiteRuns, curves: list[FloatArray]) -> None:
        self._runs, self._cells, self._curves = runs, runs.regression.cells, curves
        self._looks = _KINDS * sum(len(one) for one in self._cells)
        chance = -float(stdtrit(self._looks / _KINDS / _INDEPENDENT, FALSE_ALARMS / 2.0 / self._looks))
        self._limit = _MARGIN * chance
        # What noise makes of a change of size over error 1: of each shape, and how much more of each run
        self._scale: dict[_Tried, float] = {}
        self._louder: list[float] = []

    def found(self, known: Sequence[_At]) -> list[_At]:
        """Return all clear changes, placed and fitted together, known ones first."""
        found = list(known)
        for run in sorted({at.run for at in known}):
            if self._scale:
                self._fit_curves(found)
            else:
                self._measure(found)
            found = self._placed_anew(run, found)
        for _ in range(_MOST):
            new = list(self._clearest(found))
            before = set(found)
            for gain in [at for at in new if at.kind == "gain"]:  # its own step goes with it
                found = [at for at in found if at.run != gain.run or abs(at.middle_s - gain.begin_s) > _AROUND_S]
            for run in sorted({at.run for at in new}):
                found = self._placed_anew(run, found + [at for at in new if at.run == run])
            if before == set(found):
                break
        return found

    def _measure(self, found: Sequence[_At]) -> list[_Looked]:
        """Return what the runs show beside what was found; the first time also what noise makes of each shape."""
        fit, looked, rests = self._fit_curves(found), list[_Looked](), list[FloatArray]()
        for k in range(len(self._cells)):
            of_run = fit.of_run(k)
            rests.append(of_run.rest)
            looked.append(_looked(of_run, self._curves[k][1], self._gains_to_try(k, found)))
        if not self._scale:
            for shape in dict.fromkeys(shape for of_run in looked for shape in of_run.sizes):
                overall = noise_of(np.concatenate([of_run.sizes[shape] for of_run in looked if shape in of_run.sizes]))
                self._scale[shape] = max(overall, fit.sigma)
            white = noise_of(np.concatenate(rests))
            self._louder = [max(noise_of(rest) / max(white, 1e-300), 1.0) for rest in rests]
        return looked

    def _fit_curves(self, found: Sequence[_At]) -> SmoothFit:
        """Fit all runs beside what was found, and keep the map along each run."""
        fit = self._fit(found)
        self._curves[:] = [np.stack([one.time_s, fit.curve(k)]) for k, one in enumerate(self._cells)]
        return fit

    def _fit(self, changes: Sequence[_At]) -> SmoothFit:
        return self._runs.fit([_columns(one, k, changes, self._curves) for k, one in enumerate(self._cells)])

    def _clearest(self, found: Sequence[_At]) -> Iterator[_At]:
        """Yield the clearest change of each run if it is clear; both steps of a departure that comes back."""
        for k, looked in enumerate(self._measure(found)):
            if sum(at.run == k for at in found) >= _MOST:
                continue
            tried = list(looked.sizes)
            far = np.abs([z / (self._louder[k] * self._scale[shape]) for shape, z in looked.sizes.items()])
            for at in found:
                if at.run == k:
                    far[:, np.abs(self._cells[k].time_s - at.middle_s) <= self._separation_s(k)] = 0.0
            gain = self._clearest_gain(looked, k, found)
            if gain is not None and gain[0] > float(far.max()) ** 2 + self._limit:
                yield gain[1]
                continue
            s, place = np.unravel_index(int(np.argmax(far)), far.shape)
            if far[s, place] > self._limit:
                cells = self._cells[k]
                begin = float(cells.time_s[place]) - 0.5 * cells.cell_s
                kind, length = tried[s]
                if kind == "back":
                    yield _At(k, "step", begin)
                    yield _At(k, "step", begin + round(length / cells.cell_s) * cells.cell_s)
                elif kind == "drift":
                    yield _At(k, "drift", begin + 0.5 * cells.cell_s)
                else:
                    yield _At(k, "step", begin, length)

    def _differ(self, one: _At, other: _At) -> bool:
        """Test whether two changes of a run are distinct."""
        apart = abs(one.middle_s - other.middle_s) > self._separation_s(one.run)
        return apart or {one.kind, other.kind} == {"gain", "drift"}

    def _separation_s(self, run: int) -> float:
        """Least separation of two changes, s: nearer ones are one."""
        return max(2.0 * _STEP_S, 3.0 * self._cells[run].cell_s)

    def _shows_gain(self, run: int, time_s: float) -> bool:
        t = self._cells[run].time_s
        return bool(t[0] + _GAIN_S <= time_s <= t[-1] - _GAIN_S)

    def _gains_at_steps(self, run: int, found: Sequence[_At]) -> list[_At]:
        """Return changes of gain at the known steps of a run."""
        steps = [at.middle_s for at in found if at.run == run and at.kind == "step"]
        return [_At(run, "gain", s) for s in steps if self._shows_gain(run, s)]

    def _gains_to_try(self, run: int, found: Sequence[_At]) -> list[_At]:
        """Return changes of gain at places in all of a run and, last, at the steps that are known.

        Two other runs at least say what the curve is.
        """
        cells = self._cells[run]
        edge = max(round(_GAIN_S / cells.cell_s), 1)  # a change of gain has a row before it
        every = max(round(0.25 * _GAIN_S / cells.cell_s), (len(cells) - 2 * edge) // _GAIN_PLACES, 1)
        places = cells.time_s[edge : len(cells) - edge : every].tolist()
        known = any(at.run == run and at.kind == "gain" for at in found)
        if len(self._cells) <= _LEAST_OTHERS or known or not places:
            return []
        return [*(_At(run, "gain", s) for s in places), *self._gains_at_steps(run, found)]

    def _clearest_gain(self, looked: _Looked, run: int, found: Sequence[_At]) -> tuple[float, _At] | None:
        """Return the likeliest change of gain of a run and what it gains with its step, if one is clear."""
        if not looked.gains:
            return None
        noise = self._white(run) ** 2
        places = len(looked.gains) - len(self._gains_at_steps(run, found))
        least = np.full(len(looked.gains), self._limit)
        least[places:] = _AT_STEP
        clear = np.where(looked.alone / noise > least**2, looked.with_step / noise, 0.0)
        best = int(np.argmax(clear))
        if clear[best] == 0.0:
            return None
        return (np.inf if best >= places else float(clear[best])), looked.gains[best]

    def _placed_anew(self, run: int, found: list[_At]) -> list[_At]:
        """All changes of a run, each at its best place beside the others; without those that are not clear then."""
        others, own = [at for at in found if at.run != run], [at for at in found if at.run == run]
        fit = self._fit(others).of_run(run)
        for _ in range(_ROUNDS):
            before = list(own)
            for k, at in enumerate(before):
                own[k] = self._best(at, self._beside(fit, own[:k] + own[k + 1 :]))
            own = self._at_steps(fit, own)
            if before == own:
                break
        while own:
            own = [at for k, at in enumerate(own) if all(self._differ(at, o) for o in own[:k])]
            gains = [self._alone(self._beside(fit, own[:k] + own[k + 1 :]), at) for k, at in enumerate(own)]
            over = [g - (_AT_STEP if at.kind == "gain" else self._limit) ** 2 for g, at in zip(gains, own, strict=True)]
            if min(over) > 0.0:
                break
            del own[int(np.argmin(over))]
        return others + own

    def _at_steps(self, fit: RunFit, own: list[_At]) -> list[_At]:
        """Put each gain at the step that it may cause: then one step fewer has to be clear."""
        for gain in [at for at in own if at.kind == "gain"]:
            for step in [at for at in own if at.kind == "step" and self._shows_gain(at.run, at.middle_s)]:
                rest = [at for at in own if at not in (gain, step)]
                moved, beside = replace(gain, begin_s=step.middle_s), self._beside(fit, rest)
                both = self._gains(beside, [step])[0] + self._gains(self._beside(beside, [step]), [gain])[0]
                if both - self._gains(beside, [moved])[0] < self._limit**2:
                    return self._at_steps(fit, [*rest, moved])
        return own

    def _best(self, at: _At, fit: RunFit) -> _At:
        """Return the likeliest place and duration of a change; `fit`: beside the other changes of the run.

        Of steps and transitions it is what is more likely, each of both kinds being as likely beforehand and all
        durations of a kind alike; a drift where it is nearly as likely as they are.
        """
        cells = self._cells[at.run]
        reach = _HOUR_S if at.kind in ("drift", "gain") else max(_AROUND_S, at.duration_s, 3.0 * cells.cell_s)
        near = cells.time_s[np.abs(cells.time_s - at.middle_s) <= reach]
        near = near[:: max(len(near) // _PLACES, 1)] - 0.5 * cells.cell_s
        if at.kind == "gain":
            every = max(len(near) // _GAIN_PLACES, 1)
            place = self._best_gain(at, near[::every], fit)
            near = cells.time_s[np.abs(cells.time_s - place.begin_s) <= every * cells.cell_s]
            return self._best_gain(place, near, fit)
        durations = [d for d in _DURATIONS_S if d == 0.0 or d > cells.cell_s]
        shapes = [replace(at, kind="drift", duration_s=0.0)] if at.kind == "drift" else []
        shapes += [replace(at, kind="step", duration_s=d) for d in durations]
        local = _StepGains(fit, float(near[0]) - max(durations), float(near[-1]) + max(durations))
        white = self._white(at.run) ** 2

        def gains_of(shape: _At, begins_s: list[float]) -> FloatArray:
            if shape.kind == "drift":
                return self._gains(fit, [replace(shape, begin_s=s) for s in begins_s])
            return local.of(shape, begins_s) / white

        best: list[tuple[float, _At]] = []
        for shape in shapes:
            begins = [float(t) - 0.5 * shape.duration_s for t in near]
            begin = begins[int(np.argmax(gains_of(shape, begins)))]
            begins = [begin + d * cells.cell_s for d in _PARTS]
            gains = gains_of(shape, begins)
            best.append((float(gains.max()), replace(shape, begin_s=begins[int(np.argmax(gains))])))
        most = max(gain for gain, _ in best)
        if at.kind == "drift":
            gain, drift = best.pop(0)
            if gain >= most - CHI2_95_ONE:
                return drift
        over = [pair for pair in best if pair[1].duration_s <= _over_s(cells)]
        lasting = best[len(over) :]
        mean = [np.mean([np.exp(0.5 * (gain - most)) for gain, _ in kind]) for kind in (over, lasting) if kind]
        steps = len(mean) == 1 or mean[0] >= mean[1]
        return max(over if steps else lasting, key=lambda pair: pair[0])[1]

    def _best_gain(self, at: _At, places_s: FloatArray, fit: RunFit) -> _At:
        """Return the likeliest of a change of gain and the same at other places."""
        tried = [at] + [replace(at, begin_s=float(t)) for t in places_s if self._shows_gain(at.run, t)]
        return tried[int(np.argmax(self._gains(fit, tried)))]

    def _gains(self, fit: RunFit, tried: Sequence[_At]) -> FloatArray:
        """Return twice the gain of log-likelihood of each of some changes of one kind and run; of a gain with its step.

        Args:
            fit: Beside the other changes of the run.
        """
        run = tried[0].run
        if tried[0].kind == "gain":
            backwards = fit.backwards()
            gains = _gains_of(fit, (np.cumsum(backwards, axis=1), backwards), self._curves[run][1], tried)[0]
        else:
            inner, energy = fit.amplitudes(self._of(tried, run))
            gains = inner**2 / np.maximum(energy, 1e-300)
        return np.asarray(gains / self._white(run) ** 2)

    def _alone(self, fit: RunFit, at: _At) -> float:
        """Return twice the gain of log-likelihood of one change; of a gain without its step."""
        inner, energy = self._amplitude(fit, at)
        return inner**2 / max(energy, 1e-300) / self._white(at.run) ** 2

    def _amplitude(self, fit: RunFit, at: _At) -> tuple[float, float]:
        """Return the inner product and the energy of a change; of a gain beside its step."""
        columns = self._of([at], at.run)
        inner, energy = fit.beside(columns[:-1]).amplitudes(columns[-1:])
        return float(inner[0]), float(energy[0])

    def _beside(self, fit: RunFit, others: Sequence[_At]) -> RunFit:
        return fit.beside(self._of(others, others[0].run)) if others else fit

    def _of(self, changes: Sequence[_At], run: int) -> FloatArray:
        columns = _columns(self._cells[run], run, changes, self._curves)
        assert columns is not None
        return columns

    def _white(self, run: int) -> float:
        """Standard deviation of what is white of a run."""
        return self._louder[run] * self._scale[_STEP]

    def change(self, at: _At, found: Sequence[_At], rows: RowArrays) -> Change | None:
        """The change with its limits; None where it falls into a gap over which the noise may move as far."""
        cells, others = self._cells[at.run], [o for o in found if o is not at and o.run == at.run]
        fit, white = self._fit([o for o in found if o.run != at.run]), self._white(at.run)
        of_run = self._beside(fit.of_run(at.run), others)
        inner, energy = self._amplitude(of_run, at)
        size, error = inner / energy, white / float(np.sqrt(energy))
        kind, duration, gap_s = at.kind, 0.0, self._gap_at(at) if at.kind == "step" else 0.0
        if gap_s > 0.0:
            noise = self._runs.noise
            error = float(np.hypot(error, white * np.sqrt(noise.level * gap_s / noise.cell_s)))
            if gap_s > LONGEST_GAP_S or abs(size) < self._limit * error:
                return None
            time = _across_gap(at, rows, gap_s + cells.cell_s)
        elif kind in ("drift", "gain"):
            time = self._begins(at, of_run)
        else:
            near = rows[2] - np.interp(rows[0], cells.time_s, fit.curve(at.run))
            time = _placed(at, near, rows[0], _NEAR_CELLS * cells.cell_s)
            if at.duration_s > _over_s(cells):
                kind, duration = "transition", at.duration_s
                half = 0.5 * duration + cells.cell_s
                time = at.middle_s, at.middle_s - half, at.middle_s + half
        sigmas = abs(size) / error
        if kind == "gain":
            if abs(size) < _LEAST_GAIN:
                return None
            size += 1.0
        limits = size, size - NORMAL_95 * error, size + NORMAL_95 * error
        return Change(at.run, kind, time, duration, limits, sigmas, gap_s)

    def _gap_at(self, at: _At) -> float:
        """Length of the gap in the rows that a change lies in, s; 0: none."""
        t, cell_s = self._cells[at.run].time_s, self._cells[at.run].cell_s
        gaps = [(float(t[k]), gap) for k, gap in self._cells[at.run].behind_gap]
        return next((gap for end, gap in gaps if end - gap - cell_s < at.middle_s <= end + cell_s), 0.0)

    def _begins(self, at: _At, fit: RunFit) -> ValueWithLimits:
        """The beginning of a drift, or the place of a change of gain, with the times that are nearly as likely.

        A cell more on either side: it may be in the midst of one, and rows bear the time of their end or their start.
        """
        t, cell_s = self._cells[at.run].time_s, self._cells[at.run].cell_s
        near = t[np.abs(t - at.begin_s) < _HOUR_S]
        if at.kind == "gain":
            near = np.array([s for s in near if self._shows_gain(at.run, s)] or [at.begin_s])
        gains = self._gains(fit, [replace(at, begin_s=float(s)) for s in near])
        likely = near[gains >= gains.max() - (_PLACED_95 if at.kind == "gain" else CHI2_95_ONE)]
        return float(near[int(np.argmax(gains))]), float(likely[0]) - 2.0 * cell_s, float(likely[-1]) + cell_s


def _across_gap(at: _At, rows: RowArrays, around_s: float) -> ValueWithLimits:
    """First row behind the longest gap near a change, and the rows on both sides of it."""
    first, end = np.searchsorted(rows[0], (at.middle_s - around_s, at.middle_s + around_s))
    behind = int(first) + int(np.argmax(np.diff(rows[0][first : max(end, first + 2)]))) + 1
    return float(rows[0][behind]), float(rows[0][behind - 1]), float(rows[0][behind])


def _placed(at: _At, rate: FloatArray, time: FloatArray, around_s: float) -> ValueWithLimits:
    """First row behind a step, and the times between which it lies: where two levels leave least of rows."""
    first, end = np.searchsorted(time, (at.middle_s - around_s, at.middle_s + around_s))
    y, t = rate[first:end], time[first:end]
    n = len(y)
    inside = np.flatnonzero(np.abs(t - at.middle_s) <= 0.5 * around_s)
    inside = inside[(inside > 0) & (inside < n)]
    if len(inside) == 0:
        return at.middle_s, at.middle_s - around_s, at.middle_s + around_s
    y = y - y.mean()
    total = np.concatenate([[0.0], np.cumsum(y)])
    left = np.array([y @ y - total[k] ** 2 / k - (total[n] - total[k]) ** 2 / (n - k) for k in inside])
    best = int(np.argmin(left))
    noise = max(float(left[best]) / max(n - 2, 1), 1e-300)
    likely = inside[left <= left[best] + _PLACED_95 * noise]
    k = int(inside[best])
    # One row more on either side: a row that is a mean may hold the step, and bear the time of its end or its start
    return float(t[k]), float(t[max(likely[0] - 2, 0)]), float(t[min(likely[-1] + 1, n - 1)])


def _looked(fit: RunFit, curve: FloatArray, gains: list[_At]) -> _Looked:
    """Return what a run shows of changes at every cell, no more than fit into it, and of some changes of gain.

    The filter does not change with time: the inner products of steps at all places, and the sums of these, are those of
    every other shape.
    """
    n, cell_s = len(fit.cells), fit.cells.cell_s
    shapes = _shapes(n, cell_s)
    backwards = fit.backwards()
    begun = np.cumsum(backwards, axis=1)
    white = fit.white(np.stack([shape.values for shape in shapes]))
    energy = np.cumsum(white**2, axis=1)
    left = energy.copy()
    for part in parts_of(len(fit.fitted), max(_TOGETHER // n, 1)):
        for k, held in enumerate(_held(begun[part], shapes)):
            left[k] -= np.einsum("ij,ij->j", held, held)
    sizes = {}
    for k, inner in enumerate(_held(begun[-1:], shapes)):
        good, shape = left[k] > LEAST_ENERGY * energy[k], shapes[k]
        good[: _EDGE + round(shape.tried[1] / cell_s)] = False
        good[n - _EDGE :] = False
        sizes[shape.tried] = np.where(good, inner[0] / np.sqrt(np.where(good, left[k], 1.0)), 0.0)[::-1]
    return _Looked(sizes, gains, *_gains_of(fit, (begun, backwards), curve, gains))


class _Shape(NamedTuple):
    """A shape that the search tries: its values at the cells from its first one on are piecewise linear.

    Attributes:
        tried: What it is.
        values: Shape (n,).
        first, each, last: By how much it steps at its first cell, at each behind it, and at the last that changes it.
        behind: How many cells that one is behind the first.
    """

    tried: _Tried
    values: FloatArray
    first: float
    each: float
    last: float
    behind: int


def _shapes(n: int, cell_s: float) -> list[_Shape]:
    """Return the shapes that fit into so many cells."""
    ages = np.arange(0.5, n) * cell_s
    values: dict[_Tried, FloatArray] = {
        ("step", d): np.clip(ages / max(d, cell_s) + 0.5 * (d == 0.0), 0.0, 1.0) for d in _TRIED_S
    }
    for length in _BACK_S:
        behind = round(length / cell_s)
        if 2 <= behind < n:
            values["back", length] = np.asarray(np.arange(n) < behind, dtype=np.float64)
    values["drift", 0.0] = np.arange(0.0, n) * cell_s / _HOUR_S
    found = []
    for tried, shape in values.items():
        steps = np.diff(shape, prepend=0.0)
        last = int(np.flatnonzero(steps)[-1])
        found.append(_Shape(tried, shape, float(steps[0]), float(steps[1]), float(steps[last]), last))
    return found


def _held(begun: FloatArray, shapes: Sequence[_Shape]) -> Iterator[FloatArray]:
    """Yield the inner products of rows with each shape that begins at each cell, the last cell first, shape (k, n).

    Args:
        begun: Those of a step, shape (k, n).
    """
    rows, n = begun.shape
    pad = 1 + max(shape.behind for shape in shapes if shape.behind < n - 1)
    begun = np.concatenate([np.zeros((rows, pad)), begun], axis=1)
    total = np.cumsum(begun, axis=1)
    for shape in shapes:
        held, behind = shape.first * begun[:, pad:], shape.behind
        if behind >= n - 1:
            held += shape.each * total[:, pad - 1 : -1]
        elif behind > 0:
            held += shape.last * begun[:, pad - behind : -behind]
            if behind > 1 and shape.each != 0.0:
                held += shape.each * (total[:, pad - 1 : -1] - total[:, pad - behind : -behind])
        yield held


def _gains_of(
    fit: RunFit, sums: tuple[FloatArray, FloatArray], curve: FloatArray, tried: Sequence[_At]
) -> tuple[FloatArray, FloatArray]:
    """Return squares of sizes over errors of changes of gain of a curve, with their steps and beside them.

    Args:
        sums: Inner products with steps and with single cells (`RunFit.backwards`).
    """
    begun = np.searchsorted(fit.cells.time_s, [at.begin_s for at in tried])
    last_first = len(curve) - 1 - begun
    gain = np.cumsum(sums[1] * curve[::-1], axis=1)[:, last_first]
    return gains_of_pairs(sums[0][:, last_first], gain, fit.gain_products(curve, begun))


class _StepGains:
    """Gains of log-likelihood of steps and transitions near a place; what they have in common is computed once."""

    def __init__(self, fit: RunFit, from_s: float, to_s: float) -> None:
        """Prepare; `from_s`, `to_s`: before and behind all that is tried."""
        self._cell_s, time = fit.cells.cell_s, fit.cells.time_s
        first, end = np.searchsorted(time, (from_s - self._cell_s, to_s + self._cell_s)).tolist()
        first, end = min(first, len(time) - 1), min(end + 1, len(time))
        self._time = time[first:end]
        self._products = fit.step_products(first, end)
        begun = np.cumsum(fit.backwards(), axis=1)[:, len(time) - end : len(time) - first][:, ::-1]
        self._held, self._inner = begun[:-1], begun[-1]

    def of(self, shape: _At, begins_s: Sequence[float]) -> FloatArray:
        """Return squares of sizes over errors of a shape that begins at some times."""
        since = self._time - np.array(begins_s)[:, None]
        steps = np.diff(shape.column(since, self._cell_s), axis=1, prepend=0.0)
        raw = np.einsum("ij,ij->i", steps @ self._products, steps)
        energy = own_energy(raw, self._held @ steps.T)
        return np.asarray((steps @ self._inner) ** 2 / np.maximum(energy, 1e-300))
