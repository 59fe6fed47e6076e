"""Recordings in, a result out, in a few lines of Python: `gyrotc.load`, `gyrotc.Dataset.from_pandas`, `gyrotc.build`.

    import gyrotc
    data = gyrotc.load("RLG-0042")                                  # or Dataset.from_pandas(frame, rate_unit="deg/s")
    result = gyrotc.build(data, out="result", limits="product.toml")
    result.plot()                                                   # bias against temperature, in a notebook
    result.to_xarray()                                              # the map over temperature and its rate

`gyrotc.check`, `gyrotc.fit` and `gyrotc.jobs.diagnose` do what these commands do (`gyrotc.diagnose` is a package).

What the commands check is checked here, too: what is wrong raises `gyrotc.common.errors.InputError` with one message.
"""

from __future__ import annotations

import os
import weakref
from collections.abc import Mapping, Sequence
from contextlib import ExitStack
from dataclasses import dataclass, field, fields
from html import escape
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from ..common.errors import InputError, install_command, quoted
from ..common.progress import Progress, silent
from ..common.texts import file_stem
from ..model import Model
from ..pages.display import sci
from ..pages.report import thermal_picture
from ..pages.unit import UnitResults, unit_in
from ..quality.inspection import CheckResult
from ..recordings import records
from ..recordings.importers.job import ImportOptions, import_files
from ..recordings.importers.map_file import Map
from ..recordings.loading import load as _load
from ..results.evaluation import Evaluation
from ..results.folder import scratch_folder
from ..train.fitting import FitOptions, Fitted
from .calibration import BuildRequest, Built
from .calibration import build as _build
from .fitting import fit as _fit
from .inspection import check as _check

__all__ = ["Dataset", "Picture", "Result", "build", "check", "fit", "load"]

_Place = str | os.PathLike[str]
_GRID = (121, 41)  # points of a map over temperature and over its rate: a step of about 1 C and 0.25 C/min
_COLUMNS = "repeat(auto-fit,minmax(min(100%,25em),1fr))"
_IN_ROWS = f"<style>.panels{{display:grid;grid-template-columns:{_COLUMNS};gap:1em}}</style>"


class Dataset(records.Dataset):
    """Recordings of one axis of one gyro: what `load` gives; its fields are those of `records.Dataset`."""

    @classmethod
    def from_pandas(
        cls,
        frames: Any,
        *,
        rate_unit: str,
        temperature_unit: str | None = None,
        time_unit: str | None = None,
        serial: str = "unit",
        exam: str | None = None,
        columns: Mapping[str, str] | None = None,
        axis: str | None = None,
        folder: _Place | None = None,
        **stated: Any,
    ) -> Dataset:
        """Make a data set of recordings in memory, read as `gyrotc import` reads files.

        Args:
            frames: A DataFrame, or one for each run by name; columns are known by their names, an index of times is
                a column, too.
            rate_unit: Of the rates: "deg/h", "deg/s", "rad/s", ...
            temperature_unit, time_unit: "degC", "K", ..., "s", "ms", ...; None: as the name of the column says.
            serial: Of the gyro.
            exam: Name of the run that judges the correction and is not trained on; None: none.
            columns: Name of the column by role (`time`, `temperature`, `rate`, `rate_x`, ...) where it is not known.
            axis: Axis of three-axis recordings.
            folder: Where the data set is written; None: a folder for temporary files, gone with this object.
            **stated: What `dataset.toml` states besides: `earth_rate`, `latitude_deg`, `description`, `meta`.

        Raises:
            InputError: A column or unit that is not known, or values that contradict their unit.
        """
        runs = {"run": frames} if hasattr(frames, "columns") else dict(frames)
        if exam is not None and (exam not in runs or len(runs) < 2):
            raise InputError("exam", quoted(exam), f"one of several runs: {', '.join(map(str, runs))}")
        if exam is not None:
            runs |= {exam: runs.pop(exam)}  # the last run is the exam
        stated_units = {"rate": rate_unit, "temperature": temperature_unit, "time": time_unit}
        units = {kind: unit for kind, unit in stated_units.items() if unit}
        named = {role: (name,) if role == "time" else name for role, name in (columns or {}).items()}
        chosen = Map.model_validate({"units": units, "columns": named} | stated)
        with ExitStack() as stack:
            scratch = stack.enter_context(scratch_folder())
            place = Path(folder) if folder is not None else scratch / "data"
            files = [scratch / f"{file_stem(str(name))}.parquet" for name in runs]
            for file, frame in zip(files, runs.values(), strict=True):
                if type(frame.index).__name__ != "RangeIndex":  # it does not only count: a column
                    frame = frame.reset_index(names=frame.index.name or "time")  # noqa: PLW2901
                pq.write_table(pa.Table.from_pandas(frame, preserve_index=False), file)
            import_files(files, place, chosen, ImportOptions(serial=serial, exam=exam is not None))
            made = load(place, axis=axis)
            weakref.finalize(made, stack.pop_all().close)
        return made

    def _repr_html_(self) -> str:
        rows = "".join(
            f"<tr><td>{escape(run.file)}</td><td>{run.role}</td><td>{run.n_rows}</td><td>{run.row_period_s:g}</td></tr>"
            for run in self.runs
        )
        head = "<tr><th>run</th><th>role</th><th>rows</th><th>period, s</th></tr>"
        return f"<table><caption>{escape(self.serial)}</caption>{head}{rows}</table>"


def load(folder: _Place, *, axis: str | None = None) -> Dataset:
    """Read a data set and check every file.

    Args:
        folder: The data set, as `gyrotc import` or a person has written it (docs/recordings.md).
        axis: Axis of three-axis recordings: "x", "y" or "z".

    Raises:
        InputError: Something is wrong; the first thing found is reported.
    """
    found = _load(Path(folder), axis=axis)
    return Dataset(**{one.name: getattr(found, one.name) for one in fields(records.Dataset)})


def build(
    dataset: records.Dataset | _Place,
    out: _Place | None = None,
    *,
    limits: _Place | None = None,
    targets: Sequence[str] = (),
    numerics: Sequence[str] | None = None,
    extend: bool = False,
    progress: Progress = silent,
    **options: Any,
) -> Result:
    """Fit, emit C, prove it on targets, judge it and write the report, as `gyrotc build` does.

    Args:
        dataset: What `load` gave, or the folder of recordings of one rate.
        out: Folder of the result; None: one for temporary files, gone with the result.
        limits: Limits of the product (docs/limits.md).
        targets, numerics, extend: As of the command.
        progress: Called at every stage with its name, and with how much is done of how much: `(stage, done, total)`.
        **options: `method`, `seed`, `centers`, `rho`, `block_s`, `average_s`, `channels`, as of the command.

    Raises:
        InputError: Bad recordings or arguments; `out` is untouched.
    """
    data = dataset if isinstance(dataset, records.Dataset) else load(dataset)
    with ExitStack() as stack:
        place = Path(out) if out is not None else stack.enter_context(scratch_folder()) / "result"
        request = BuildRequest(
            fit=FitOptions(**options),
            axis=data.axis,
            numerics=numerics,
            targets=targets,
            extend=extend,
            limits=_path(limits),
        )
        [built] = _build(data.folder, place, request, progress=progress)
        result = Result(place, built)
        weakref.finalize(result, stack.pop_all().close)
    return result


def fit(
    dataset: records.Dataset | _Place, out: _Place | None = None, *, progress: Progress = silent, **options: Any
) -> Fitted:
    """Train a model, as `gyrotc fit` does.

    Args:
        dataset: What `load` gave, or the folder of recordings of one rate.
        out: Folder for `model.json` and `training.json`; None: no files.
        progress: As for `build`.
        **options: As for `build`.

    Raises:
        InputError: Bad recordings or arguments; `out` is untouched.
    """
    data = dataset if isinstance(dataset, records.Dataset) else load(dataset)
    return _fit(data.folder, _path(out), FitOptions(**options), axis=data.axis, progress=progress)


def check(
    folder: _Place, *, axis: str | None = None, previous: _Place | None = None, progress: Progress = silent
) -> CheckResult:
    """Return all errors and warnings about a data set, as `gyrotc check` reports them.

    Args:
        folder: The data set, which may be wrong.
        axis: Axis of three-axis recordings; None: every one.
        previous: An earlier result of this gyro: are sign and axes as they were?
        progress: As for `build`.

    Raises:
        InputError: The earlier result cannot be read, or is of another gyro.
    """
    return _check(Path(folder), axis=axis, previous=_path(previous), progress=progress)


def _path(place: _Place | None) -> Path | None:
    return None if place is None else Path(place)


class Picture(str):
    """SVG that a notebook shows."""

    __slots__ = ()

    def _repr_html_(self) -> str:
        return _IN_ROWS + self


@dataclass(frozen=True)
class Result:
    """Result of `build`.

    Attributes:
        folder: The result: C files in `c/`, `model.json`, `report.html`, ...
        built: Model, and what every stage found.
    """

    folder: Path
    built: Built = field(repr=False)

    @property
    def model(self) -> Model:
        """The model; `model.map_dph(temperature_c, slope_c_per_min)` is its map in deg/h."""
        return self.built.model

    @property
    def evaluation(self) -> Evaluation:
        """Figures before and after, for each run and together."""
        return self.built.evaluation

    @property
    def decision(self) -> str | None:
        """PASS, CONDITIONAL PASS or FAIL; None without limits where nothing failed."""
        return self.built.unit.decision

    @property
    def _unit(self) -> UnitResults:
        return unit_in(self.folder)

    def _facts(self) -> list[tuple[str, str]]:
        unit, model = self._unit, self.model
        proven = [f"{one.name} {one.numeric}" for one in self.built.verification.targets if one.status == "pass"]
        found = [("unit", model.serial + (f", axis {model.axis}" if model.axis else ""))]
        if unit.judged:
            before, after = unit.judged.before.rms_dph, unit.judged.after.rms_dph
            found += [(f"RMS, deg/h, {unit.judged_on}", f"{sci(before)} → {sci(after)}")]
        found += [("correction", f"{model.method}, {model.n_centers} centers")]
        found += [("bit for bit", ", ".join(proven) or "nowhere")]
        found += [("verdict", self.decision or "no limits")]
        return found

    def __repr__(self) -> str:
        return f"Result({'; '.join(f'{name}: {value}' for name, value in self._facts())})"

    def _repr_html_(self) -> str:
        rows = "".join(f"<tr><th>{escape(n)}</th><td>{escape(v)}</td></tr>" for n, v in self._facts())
        return f"<table>{rows}</table>{self.plot()._repr_html_()}"

    def plot(self) -> Picture:
        """Bias against temperature before and after, with the map and its U, and what remains; for a notebook."""
        return Picture(thermal_picture(self.folder, self._unit) or "")

    def to_xarray(self, shape: tuple[int, int] = _GRID) -> Any:
        """The map over its envelope as an `xarray.Dataset`.

        Args:
            shape: Number of temperatures and of rates.

        Returns:
            `bias`, deg/h, over `temperature`, C, and `slope`, C/min.

        Raises:
            ModuleNotFoundError: xarray is not installed; the message says what to install.
        """
        try:
            import xarray
        except ModuleNotFoundError as error:
            found = f"Result.to_xarray needs xarray: {install_command('netcdf')}"
            raise ModuleNotFoundError(found, name="xarray") from error
        model = self.model
        t = np.linspace(*model.envelope.temperature_c, shape[0])
        r = np.linspace(*model.envelope.slope_c_per_min, shape[1])
        bias = model.map_dph(*np.meshgrid(t, r, indexing="ij"))
        return xarray.Dataset(
            {"bias": (("temperature", "slope"), bias, {"units": "deg/h", "long_name": "bias of the map"})},
            coords={
                "temperature": ("temperature", t, {"units": "degC"}),
                "slope": ("slope", r, {"units": "degC/min", "long_name": "rate of change of temperature"}),
            },
            attrs={"serial": model.serial, "model": model.hash},
        )
