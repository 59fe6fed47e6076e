"""A lot of small three-axis units through one programme of temperatures, and faults planted in it."""

from __future__ import annotations

import shutil
from collections.abc import Callable
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from recordings import write_csv

Array = NDArray[np.float64]

AXES = ("x", "y", "z")
FAULTS = (
    "sign_reversed",
    "axes_exchanged",
    "step",
    "thermometer_offset",
    "noise",
    "scale",
    "outliers",
    "warm_up",
    "thermometer_late",
    "copy_of_other",
)  # fmt: skip; the copy last, for it takes a unit without fault
RUN_FAULTS = ("run_reversed", "run_outlier")
"""What a unit's own runs show, by the rules of `check`; the reason of the first is `sign_reversed`."""
_ROW_S, _HOURS = 20.0, 2.0
_NOISE_DPH = 2e-3  # of a row
_PROGRAMMES = ((-30.0, 60.0), (60.0, -30.0), (20.0, 50.0), (0.0, -25.0), (-10.0, 40.0), (45.0, 5.0))  # C
_SHAPES = {"x": (8e-3, 3e-3, 0.0), "y": (-4e-3, -2e-3, 2e-3), "z": (2e-3, 0.0, -4e-3)}  # deg/h: 1, T, T²


class Lot:
    """Units with a bias of their own about that of their axis; `planted` holds the results that each fault concerns."""

    def __init__(self, seed: int, units: int) -> None:
        self.draw = np.random.default_rng(seed)
        self.time_s = np.arange(0.0, 3600.0 * _HOURS, _ROW_S)
        self.units = [f"IMU-{k:04d}" for k in range(units)]
        self.planted: dict[str, set[str]] = {}
        self.runs: dict[str, list[dict[str, Array]]] = {name: self._unit() for name in self.units}

    def _unit(self) -> list[dict[str, Array]]:
        own = {a: np.array(_SHAPES[a]) * (1.0 + 0.1 * self.draw.normal(size=3)) for a in AXES}
        runs = []
        for first, last in _PROGRAMMES:
            share = np.clip(self.time_s / self.time_s[-1] * 1.4 - 0.2, 0.0, 1.0)
            temperature = first + (last - first) * share + 0.02 * self.draw.normal(size=share.size)
            u = (temperature + 0.3 * self.draw.normal() - 15.0) / 45.0
            run = {"time_s": self.time_s, "temperature_c": temperature}
            for a in AXES:
                noise = _NOISE_DPH * self.draw.normal(size=u.size)
                run[f"rate_{a}_dph"] = own[a][0] + own[a][1] * u + own[a][2] * u**2 + noise
            runs.append(run)
        return runs

    def plant(self, fault: str, unit: str) -> None:
        """A fault into a unit, which is noted with the results that it concerns."""
        axis = str(self.draw.choice(AXES))
        reported = getattr(self, f"_{fault}")(unit, axis) or {f"{unit}-{axis}"}
        self.planted.setdefault(fault, set()).update(reported)

    def _all(self, unit: str, column: str, change: Callable[[Array], Array]) -> None:
        for run in self.runs[unit]:
            run[column] = change(run[column])

    def _sign_reversed(self, unit: str, axis: str) -> None:
        self._all(unit, f"rate_{axis}_dph", lambda rate: -rate)

    def _axes_exchanged(self, unit: str, axis: str) -> set[str]:
        other = str(self.draw.choice([a for a in AXES if a != axis]))
        for run in self.runs[unit]:
            one, two = f"rate_{axis}_dph", f"rate_{other}_dph"
            run[one], run[two] = run[two], run[one]
        return {f"{unit}-{axis}", f"{unit}-{other}"}

    def _copy_of_other(self, unit: str, _: str) -> set[str]:
        taken = {name[:-2] for names in self.planted.values() for name in names} | {unit}
        source = next(name for name in self.units if name not in taken)
        self.runs[unit] = [dict(run) for run in self.runs[source]]
        return {f"{name}-{a}" for name in (unit, source) for a in AXES}

    def _step(self, unit: str, axis: str) -> None:
        number, hours = int(self.draw.integers(len(_PROGRAMMES))), float(self.draw.uniform(0.3, 0.7) * _HOURS)
        size = self.draw.choice([-1.0, 1.0]) * self.draw.uniform(1.0, 3.0) * _NOISE_DPH
        run = self.runs[unit][number]
        run[f"rate_{axis}_dph"] = run[f"rate_{axis}_dph"] + size * (self.time_s > 3600.0 * hours)
        self.step = (f"run-{number + 1:02d}.csv", 3600.0 * hours)

    def _thermometer_offset(self, unit: str, _: str) -> set[str]:
        shift = self.draw.choice([-1.0, 1.0]) * self.draw.uniform(2.0, 8.0)
        self._all(unit, "temperature_c", lambda temperature: temperature + shift)
        return {f"{unit}-{a}" for a in AXES}

    def _noise(self, unit: str, axis: str) -> None:
        more = self.draw.uniform(2.0, 4.0) * _NOISE_DPH
        self._all(unit, f"rate_{axis}_dph", lambda rate: rate + more * self.draw.normal(size=rate.size))

    def _scale(self, unit: str, axis: str) -> None:
        factor = self.draw.choice([0.5, 1.5, 2.0, 3.6, 15.0])
        self._all(unit, f"rate_{axis}_dph", lambda rate: factor * rate)

    def _warm_up(self, unit: str, axis: str) -> None:
        fades = self.draw.choice([-1.0, 1.0]) * self.draw.uniform(2.0, 4.0) * _NOISE_DPH * np.exp(-self.time_s / 900.0)
        self._all(unit, f"rate_{axis}_dph", lambda rate: rate + fades)

    def _thermometer_late(self, unit: str, _: str) -> set[str]:
        share = 1.0 - np.exp(-_ROW_S / self.draw.uniform(200.0, 600.0))

        def late(temperature: Array) -> Array:
            found = temperature.copy()
            for k in range(1, found.size):
                found[k] = found[k - 1] + share * (temperature[k] - found[k - 1])
            return found + 0.02 * self.draw.normal(size=found.size)

        self._all(unit, "temperature_c", late)
        return {f"{unit}-{a}" for a in AXES}

    def _run_reversed(self, unit: str, axis: str) -> None:
        run = self.runs[unit][int(self.draw.integers(len(_PROGRAMMES)))]
        run[f"rate_{axis}_dph"] = -run[f"rate_{axis}_dph"]

    def _run_outlier(self, unit: str, axis: str) -> None:
        run = self.runs[unit][int(self.draw.integers(len(_PROGRAMMES)))]
        run[f"rate_{axis}_dph"] = run[f"rate_{axis}_dph"] + self.draw.choice([-1.0, 1.0]) * 5.0 * _NOISE_DPH

    def _outliers(self, unit: str, axis: str) -> None:
        def spoiled(rate: Array) -> Array:
            where = self.draw.choice(rate.size, size=6, replace=False)
            spikes = np.zeros(rate.size)
            spikes[where] = self.draw.choice([-1.0, 1.0], size=6) * 30.0 * _NOISE_DPH
            return rate + spikes

        self._all(unit, f"rate_{axis}_dph", spoiled)

    def write(self, folder: Path) -> None:
        """A data set for each unit."""
        shutil.rmtree(folder, ignore_errors=True)
        for name, runs in self.runs.items():
            text = f'schema = 1\nserial = "{name}"\nearth_rate = "none"\n'
            for k, run in enumerate(runs, 1):
                write_csv(folder / name / f"run-{k:02d}.csv", run)
                text += f'[[run]]\nfile = "run-{k:02d}.csv"\nenvironment = "programme {k}"\n'
            (folder / name / "dataset.toml").write_text(text)
