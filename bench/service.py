"""Learning in service beside what others do: `python -m bench.service docs [--recordings FOLDER]`, `make service`.

Simulated laser gyros: missions of hours with stops of minutes, a table with an error of its own, a turn-on offset, an
ageing map. Measured gyro: power-ons in FOLDER, one left out in turn, a stop every 60, 300, 900 s, or one at the start.
The peers are written from their published behaviour.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from gyrotc.lot.service import Corrector, LearningUnit, PowerOn, Service, Spoil, fitted_spread, missions, served
from gyrotc.model import BiasSpread, Learning
from gyrotc.tables.emit import MONTH_H, data_sheet_spread, service_prior
from gyrotc.mirror.learning import ServicePrior
from numpy.typing import NDArray
from results import recorded, write
from results import table as markdown

Floats = NDArray[np.float64]

_AGEING = 2e-4  # deg/h in a month, of the constant; half of it in the map's shape
_CELLS = [(te, on, arw) for te in (2e-4, 2e-3) for on in (1e-4, 3e-4) for arw in (1.2e-4, 5e-4, 2e-3)]
AUTHORITY = 0.03  # deg/h: three times what a gyro of this class may read
_AXES, _SEED = 8, 100  # of the draw on the page


class Nothing:
    """The table alone."""

    def __init__(self, axes: int) -> None:
        self.y = np.zeros(axes)

    def power_on(self, clock_s: float, temp_c: float) -> None:
        pass

    def rest(self, clock_s: float, time_s: float, temp_c: float, rate: Floats, var: float, last_s: float) -> None:
        pass

    def shift(self, clock_s: float, time_s: float, temp_c: float) -> tuple[Floats, Floats]:
        return self.y, np.zeros_like(self.y)


class Hold(Nothing):
    """The last rest's mean."""

    def rest(self, clock_s: float, time_s: float, temp_c: float, rate: Floats, var: float, last_s: float) -> None:
        self.y = np.array(rate)


class Rezero(Nothing):
    """A constant by a Kalman filter: a part that drifts, and one drawn anew at each power-on."""

    def __init__(self, axes: int, table: float, turn_on: float) -> None:
        self.x, self.turn_on, self.table = np.zeros((2, axes)), turn_on, table
        self.p, self.clock_s = np.diag([table**2, 0.0]), 0.0

    def power_on(self, clock_s: float, temp_c: float) -> None:
        self.x[1] = 0.0
        self.p = np.diag([self.p[0, 0], self.turn_on**2])

    def rest(self, clock_s: float, time_s: float, temp_c: float, rate: Floats, var: float, last_s: float) -> None:
        self.p[0, 0] += _AGEING**2 / MONTH_H * (clock_s - self.clock_s) / 3600.0
        self.clock_s = clock_s
        both = self.p.sum(axis=1)
        gain = both / (both.sum() + var)
        self.x += gain[:, None] * (rate - self.x.sum(axis=0))
        self.p -= np.outer(gain, both)

    def shift(self, clock_s: float, time_s: float, temp_c: float) -> tuple[Floats, Floats]:
        return self.x.sum(axis=0), np.full(self.x.shape[1], np.sqrt(self.p.sum() + self.table**2))


class _AndroidAxis:
    """The over-temperature calibration of Android's context hub: a point in each bin of 0.75 C, 40 at most, and a line
    through them weighted by age; the correction is the latest point, else the nearest, else the last correction, each
    carried along the line. Limits of slope and intercept are left out, which are those of a telephone's sensor.
    """

    def __init__(self, jump: float) -> None:
        self.points: dict[int, tuple[float, float, float]] = {}
        self.slope, self.intercept, self.jump = 0.0, None, jump
        self.fitted_s, self.latest, self.last = -1e12, 0, (0.0, 0.0)

    def rest(self, clock_s: float, temp_c: float, rate: float) -> None:
        at = int(temp_c // 0.75)
        if at not in self.points and len(self.points) >= 40:
            del self.points[min(self.points, key=lambda k: self.points[k][2])]
        self.points[at], self.latest = (temp_c, rate, clock_s), at
        self._fit(clock_s)
        self.shift(clock_s, temp_c)

    def _fit(self, clock_s: float) -> None:
        self.fitted_s = clock_s
        if len(self.points) < 5:
            return
        t, o, at = np.array(list(self.points.values())).T
        w = np.select([clock_s - at < 300, clock_s - at < 900], [10.0, 0.1], 0.04)
        w /= w.sum()
        mean, level = w @ t, w @ o
        self.slope = float((w * (t - mean)) @ (o - level) / max((w * (t - mean)) @ (t - mean), 1e-9))
        self.intercept = float(level - self.slope * mean)

    def shift(self, clock_s: float, temp_c: float) -> float:
        if not self.points:
            return 0.0
        if clock_s - self.fitted_s > 30:
            self._fit(clock_s)
        carried = self.last[0] + self.slope * (temp_c - self.last[1])
        line = None if self.intercept is None else self.slope * temp_c + self.intercept
        t, o, at = self.points[self.latest]
        if clock_s - at < 60:
            y = o + self.slope * (temp_c - t)
        else:
            near_t, near_o, near_at = min(self.points.values(), key=lambda p: abs(p[0] - temp_c))
            if abs(near_t - temp_c) < 0.75:
                y = near_o + self.slope * (temp_c - near_t)
                test = line if clock_s - near_at >= 12 * 3600 else carried
                if line is not None and test is not None and abs(test - y) >= self.jump:
                    y = test
            else:
                y = line if clock_s - at >= 12 * 3600 and line is not None else carried
        self.last = (y, temp_c)
        return y


class Android(Nothing):
    def __init__(self, axes: int, jump: float) -> None:
        self.axes = [_AndroidAxis(jump) for _ in range(axes)]

    def rest(self, clock_s: float, time_s: float, temp_c: float, rate: Floats, var: float, last_s: float) -> None:
        for axis, value in zip(self.axes, rate, strict=True):
            axis.rest(clock_s, temp_c, float(value))

    def shift(self, clock_s: float, time_s: float, temp_c: float) -> tuple[Floats, Floats]:
        y = np.array([axis.shift(clock_s, temp_c) for axis in self.axes])
        return y, np.zeros_like(y)


def data_sheet_prior(table: float, turn_on: float, arw: float) -> ServicePrior:
    """From what a data sheet says: the table's error, turn-on offsets, ageing; noise as of a mean over an hour."""
    spread = data_sheet_spread(table, turn_on, _AGEING)
    learning = Learning(spread=spread, reference_c=10.0, authority_dph=AUTHORITY, noise_deg_per_sqrt_h=arw, span_c=1e6)
    return service_prior(learning, (-40.0, 60.0))


def _rms(errors: Floats) -> Floats:
    return np.asarray(np.sqrt(np.mean(errors**2, axis=0)))


def laser(axes: int, seeds: Sequence[int], cells: Sequence[tuple[float, float, float]]) -> list[dict[str, Any]]:
    """RMS of every method in every cell, median and worst of the axes, deg/h; error over sigma of the learner."""
    rows = []
    for table, turn_on, arw in cells:
        found: dict[str, list[Floats]] = {}
        ratio: list[Floats] = []
        for seed in seeds:
            service = missions(np.random.default_rng(seed), axes, Service(table, turn_on, _AGEING))
            methods: Mapping[str, Corrector] = {
                "table": Nothing(axes), "hold": Hold(axes), "re-zero": Rezero(axes, table, turn_on),
                "Android": Android(axes, 3 * max(table, turn_on, arw)),
                "learned": LearningUnit(data_sheet_prior(table, turn_on, arw), axes),
            }  # fmt: skip
            for name, method in methods.items():
                errors, sigmas = served(service, method, np.random.default_rng(seed + 1), arw)
                found.setdefault(name, []).append(_rms(errors))
                if name == "learned":
                    ratio.append((errors / sigmas).ravel())
        z = np.concatenate(ratio)
        rows.append({
            "table": table, "turn_on": turn_on, "arw": arw,
            "rms": {n: [float(np.median(r := np.concatenate(v))), float(r.max())] for n, v in found.items()},
            "over_sigma": float(np.sqrt(np.mean(z**2))), "within_2": float(np.mean(np.abs(z) < 2)),
        })  # fmt: skip
    return rows


_NOISE = 15.0  # deg/h of a mean over 10 s of the measured sensor
_SKIP_S = 70.0  # of a power-on, whose first readings are spikes
_EVERY_S = (60.0, 300.0, 900.0, np.inf)
_GUESS = BiasSpread(  # of a consumer's MEMS: deg/h, C, s
    level=3000.0, slope=100.0, shape=100.0, turn_on=2000.0, turn_on_slope=100.0, warm_up=1000.0, warm_up_s=600.0,
    memory=1000.0, memory_s=1e5, memory_c=12.0,
)  # fmt: skip


@dataclass(frozen=True)
class _Measured:
    """Means over 10 s of one power-on."""

    time_s: Floats
    temp_c: Floats
    rate: Floats

    def stops(self, every_s: float) -> list[int]:
        found = [0]
        for i in range(1, len(self.time_s)):
            if self.time_s[i] - self.time_s[found[-1]] >= every_s - 1e-6:
                found.append(i)
        return found

    def past(self, less: Floats) -> PowerOn:
        at = self.stops(60.0)
        return PowerOn(self.time_s[at], self.temp_c[at], self.rate[at] - less)


def _read(path: Path) -> _Measured:
    table = np.genfromtxt(path, delimiter=",", skip_header=1)
    _, at = np.unique(np.floor(table[:, 0] / 10.0), return_inverse=True)
    count = np.bincount(at)
    means = np.stack([np.bincount(at, weights=c) / count for c in table.T], axis=1)
    means = means[(count >= 5) & (means[:, 0] >= _SKIP_S)]
    return _Measured(means[:, 0], means[:, 1], means[:, 2:])


def _replayed(
    run: _Measured,
    method: Corrector,
    every_s: float,
    table: Floats,
    clock_s: float = 0.0,
    spoil: Spoil | None = None,
) -> tuple[Floats, Floats]:
    """Errors and sigmas between the stops."""
    stops = set(run.stops(every_s))
    errors, sigmas = [], []
    method.power_on(clock_s, float(run.temp_c[0]))
    for i, (time_s, temp_c) in enumerate(zip(run.time_s, run.temp_c, strict=True)):
        rate = run.rate[i] - table[i]
        if i in stops:
            given = rate if spoil is None else spoil(i, rate, _NOISE**2)
            method.rest(clock_s + time_s, float(time_s), float(temp_c), given, _NOISE**2, 10.0)
            continue
        y, sigma = method.shift(clock_s + time_s, float(time_s), float(temp_c))
        errors.append(rate - y)
        sigmas.append(np.hypot(sigma, _NOISE))
    return np.array(errors), np.array(sigmas)


class _EachAxis:
    """The unit of each axis with its own scale of the spread."""

    def __init__(self, priors: Sequence[ServicePrior]) -> None:
        self.axes = [LearningUnit(prior, 1) for prior in priors]

    def power_on(self, clock_s: float, temp_c: float) -> None:
        for axis in self.axes:
            axis.power_on(clock_s, temp_c)

    def rest(self, clock_s: float, time_s: float, temp_c: float, rate: Floats, var: float, last_s: float) -> None:
        for axis, value in zip(self.axes, rate, strict=True):
            axis.rest(clock_s, time_s, temp_c, np.array([value]), var, last_s)

    def shift(self, clock_s: float, time_s: float, temp_c: float) -> tuple[Floats, Floats]:
        found = [axis.shift(clock_s, time_s, temp_c) for axis in self.axes]
        return np.concatenate([y for y, _ in found]), np.concatenate([sigma for _, sigma in found])


def measured(folder: Path, spoil: Spoil | None = None) -> list[dict[str, Any]]:
    """RMS between stops of every method and interval, median and worst of all axes, one power-on left out in turn."""
    runs = {path.name: _read(path) for path in sorted(folder.glob("run-*.csv"))}
    envelope, center = (-40.0, 85.0), 45.0  # C: where the sensor may be used, and a room's warm device
    rms: dict[tuple[str, float], list[Floats]] = {}
    ratio: dict[float, list[Floats]] = {}
    for name, run in runs.items():
        past = [other for key, other in runs.items() if key != name]
        temp_c, rate = (np.concatenate([getattr(p, part) for p in past]) for part in ("temp_c", "rate"))
        mean = rate.mean(axis=0)
        cubic = np.stack([np.polynomial.Polynomial.fit(temp_c, r, 3)(run.temp_c) for r in rate.T], axis=1)
        flat = np.tile(mean, (len(run.time_s), 1))
        spread, scale = fitted_spread(_GUESS, [[p.past(mean) for p in past]], envelope, center, _NOISE)
        noise = _NOISE * np.sqrt(10.0) / 60.0  # deg/√h
        known = Learning(
            spread=spread, reference_c=center, authority_dph=1e5, noise_deg_per_sqrt_h=noise, span_c=1e6,
            jump_sigma=8.0, agreeing_rests=2, agreeing_power_ons=1,
        )  # fmt: skip
        priors = [service_prior(known.model_copy(update={"spread": spread.scaled(s)}), envelope) for s in scale]
        for every_s in _EVERY_S:
            android, clock_s = Android(3, 144.0), 0.0
            learned = _EachAxis(priors)
            for p in past:
                _replayed(p, android, 60.0, np.zeros_like(p.rate), clock_s)
                _replayed(p, learned, 60.0, np.tile(mean, (len(p.time_s), 1)), clock_s)
                clock_s += p.time_s[-1] + 4 * 3600.0
            for key, method, table in (
                ("table", Nothing(3), flat), ("cubic (ArduPilot)", Nothing(3), cubic),
                ("cubic, re-zero", Hold(3), cubic), ("hold", Hold(3), 0.0 * flat), ("Android", android, 0.0 * flat),
                ("learned", learned, flat),
            ):  # fmt: skip
                errors, sigmas = _replayed(run, method, every_s, table, clock_s, spoil)
                rms.setdefault((key, every_s), []).append(_rms(errors))
                if key == "learned":
                    ratio.setdefault(every_s, []).append((errors / sigmas).ravel())
    return [
        {
            "every_s": every_s if np.isfinite(every_s) else None,
            "rms": {
                key: [float(np.median(r := np.concatenate(found))), float(r.max())]
                for (key, at), found in rms.items()
                if at == every_s
            },
            "over_sigma": float(np.sqrt(np.mean(np.concatenate(ratio[every_s]) ** 2))),
        }
        for every_s in _EVERY_S
    ]


_WRONG: dict[str, Callable[[np.random.Generator, Floats, float], Floats]] = {
    "none": lambda draw, rate, var: rate,
    "10 % slow turns, 0.01 to 10 deg/s": lambda draw, rate, var: _some(
        draw, 0.1, rate, draw.choice([-1, 1], len(rate)) * 3600 * 10 ** draw.uniform(-2, 1, len(rate))
    ),
    "30 % slow turns": lambda draw, rate, var: _some(
        draw, 0.3, rate, draw.choice([-1, 1], len(rate)) * 3600 * 10 ** draw.uniform(-2, 1, len(rate))
    ),
    "10 % with up to 10 deg/h of Earth's rate": lambda draw, rate, var: _some(
        draw, 0.1, rate, draw.uniform(-10, 10, len(rate))
    ),
    "30 % with ten times the noise": lambda draw, rate, var: _some(
        draw, 0.3, rate, draw.normal(0, 10 * np.sqrt(var), len(rate))
    ),
    "all with up to 10 deg/h of Earth's rate": lambda draw, rate, var: rate + draw.uniform(-10, 10, len(rate)),
}


def _some(draw: np.random.Generator, share: float, rate: Floats, wrong: Floats) -> Floats:
    return rate + wrong * (draw.random() < share)


def wrong_rests(axes: int, seed: int) -> list[dict[str, Any]]:
    """Error over that of the table alone, and the largest shift, where rests are none."""
    rows = []
    for name, wrong in _WRONG.items():
        row: dict[str, Any] = {"rests": name, "ratio": [], "largest": 0.0}
        for error, turn_on, arw in ((2e-4, 3e-4, 1.2e-4), (2e-3, 3e-4, 5e-4), (2e-4, 1e-4, 2e-3)):
            service = missions(np.random.default_rng(seed), axes, Service(error, turn_on, _AGEING))
            draw = np.random.default_rng(seed + 2)
            method = _Watched(data_sheet_prior(error, turn_on, arw), axes)
            spoil: Spoil = lambda _, rate, var, draw=draw, wrong=wrong: wrong(draw, rate, var)  # noqa: E731
            left, _ = served(service, method, np.random.default_rng(seed + 1), arw, spoil)
            plain, _ = served(service, Nothing(axes), np.random.default_rng(seed + 1), arw)
            row["ratio"].append(float(np.sqrt(np.mean(left**2) / np.mean(plain**2))))
            row["largest"] = max(row["largest"], method.largest)
        rows.append(row)
    return rows


class _Watched(LearningUnit):
    """Keeps the largest |shift|."""

    largest = 0.0

    def shift(self, clock_s: float, time_s: float, temp_c: float) -> tuple[Floats, Floats]:
        y, sigma = super().shift(clock_s, time_s, temp_c)
        self.largest = max(self.largest, float(np.abs(y).max()))
        return y, sigma


def section(record: dict[str, Any]) -> str:
    """Tables of the campaign."""
    names = list(record["laser"][0]["rms"])
    laser_rows = [
        [f"{r['table']:g}, {r['turn_on']:g}, {r['arw']:g}"]
        + [f"{1e4 * r['rms'][n][0]:.2f} ({1e4 * r['rms'][n][1]:.2f})" for n in names]
        + [f"{r['over_sigma']:.2f}"]
        for r in record["laser"]
    ]
    parts = [
        "## Learning in service (`make service`)",
        "Simulated laser gyros, seven months: RMS of the error under way in 1e-4 deg/h, median (worst axis). Cells: "
        "error of the table, turn-on offset in deg/h, angle random walk as deg/h of a mean over an hour.",
        markdown(["cell", *names, "error / sigma "], laser_rows),
        "Rests that are none: error over that of the table alone in three of the cells, and the largest shift "
        f"(authority {AUTHORITY:g} deg/h).",
        markdown(
            ["rests", "ratios", "largest, deg/h "],
            [[r["rests"], ", ".join(f"{x:.2f}" for x in r["ratio"]), f"{r['largest']:.4f}"] for r in record["wrong"]],
        ),
    ]
    if record.get("measured"):
        names = list(record["measured"][0]["rms"])
        parts += [
            "A measured consumer's MEMS, four power-ons, one left out in turn, three axes: RMS, deg/h, median (worst).",
            markdown(
                ["stop every, s", *names, "error / sigma "],
                [
                    [f"{r['every_s']:g}" if r["every_s"] else "once"]
                    + [f"{r['rms'][n][0]:.0f} ({r['rms'][n][1]:.0f})" for n in names]
                    + [f"{r['over_sigma']:.2f}"]
                    for r in record["measured"]
                ],
            ),
        ]
    return "\n".join(f"{part}\n" for part in parts)


def main() -> int:
    parser = argparse.ArgumentParser(prog="python -m bench.service")
    parser.add_argument("docs", type=Path)
    parser.add_argument(
        "--recordings", type=Path, help="folder of run-*.csv, a power-on each; without: as recorded before"
    )
    chosen = parser.parse_args()
    before = recorded(chosen.docs, "service") or {}
    found = {
        "axes": _AXES,
        "laser": laser(_AXES, [_SEED], _CELLS),
        "wrong": wrong_rests(_AXES, _SEED),
        "measured": measured(chosen.recordings) if chosen.recordings else before.get("measured"),
    }
    write(chosen.docs, "service", found, section)
    return 0


if __name__ == "__main__":
    sys.exit(main())
