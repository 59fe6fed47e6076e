"""One file of another form, from what `build` (or `fit` and `emit`) wrote.

Parameter files of autopilots hold the best cubic over temperature in their own arithmetic.
PX4 (TemperatureCompensation, `calc_thermal_offsets_3D`): x0 + x1 d + x2 d² + x3 d³ with d² and d³ multiplied first.
ArduPilot (AP_InertialSensor, `TCal::polynomial_eval`): (c0 + (c1 + c2 d) d) d 1e-6, the constant in the gyro's offset.
Both clip the temperature to their range and work in rad/s.
A unit of co-simulation (FMU, FMI 3.0) holds the emitted C: description, sources, a binary for this machine. The same
files give the same bytes: nothing in it depends on date, place or host but the binary, which depends on the compiler.
"""

from __future__ import annotations

import hashlib
import io
import platform
import sys
import zipfile
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Literal, cast, get_args
from xml.etree.ElementTree import Element, SubElement, indent, tostring

import numpy as np
from numpy.typing import NDArray

from ..common.errors import CheckFailed, InputError
from ..common.texts import c_code, c_environment, toml_comment
from ..jobs.release import axes_in, check_emitted
from ..model import Model, load_model, table_id
from ..results.files import check_replaceable, json_text, write_atomically, write_own
from ..results.folder import scratch_folder
from ..results.marker import check_intact
from ..tables.record import RECORD, read_options
from ..tables.rounding import channel_names, guard_of, sigma_cells
from ..tables.text import example_period_us
from ..verify.toolchain import all_targets, compile_c
from .grid import GRID, MapGrid, a2l_text, cdf_text, csv_text, grid_of, map_result

Autopilot = Literal["px4", "ardupilot"]
Words = NDArray[np.float32]

_RAD_S = np.pi / 180.0 / 3600.0  # of one deg/h
_SCALE = np.float32(1e-6)  # ArduPilot's, so that its parameters are easy to read
_ORDERS = 4  # of a cubic


@dataclass(frozen=True, slots=True)
class Cubic:
    """A cubic as an autopilot holds it.

    Attributes:
        autopilot: Whose arithmetic it is in.
        reference_c, lowest_c, highest_c: Temperatures in float32.
        x: Coefficients of d⁰ ... d³, rad/s (ArduPilot: from d¹ on in 1e-6 rad/s).
        rms_dph, largest_dph: What it loses against the map where training was, rates of temperature included.
        flat_dph: RMS of the map itself there.
    """

    autopilot: Autopilot
    reference_c: np.float32
    lowest_c: np.float32
    highest_c: np.float32
    x: tuple[np.float32, np.float32, np.float32, np.float32]
    rms_dph: float
    largest_dph: float
    flat_dph: float

    def offset(self, temperature_c: NDArray[np.floating]) -> Words:
        """What the autopilot subtracts, rad/s, in its own operations; shape as given."""
        seen = np.clip(np.asarray(temperature_c, dtype=np.float32), self.lowest_c, self.highest_c)
        return _evaluated(self.autopilot, seen - self.reference_c, self.x)


def _evaluated(autopilot: Autopilot, d: Words, x: tuple[np.float32, ...]) -> Words:
    if autopilot == "px4":
        square = d * d
        return np.asarray(x[0] + x[1] * d + x[2] * square + x[3] * (square * d), dtype=np.float32)
    return np.asarray(x[0] + (x[1] + (x[2] + x[3] * d) * d) * d * _SCALE, dtype=np.float32)


def best_cubic(model: Model, autopilot: Autopilot) -> Cubic:
    """Least squares over the cells where training was; each coefficient is rounded with the lower ones fitted anew.

    Raises:
        CheckFailed: ArduPilot corrects nothing where the middle of the range is not above 0 C.
    """
    t, r = model.trained_inputs()
    y = model.map_dph(t, r)
    low, high = (np.float32(edge) for edge in model.envelope.temperature_c)
    middle = (high + low) * np.float32(0.5)
    if autopilot == "ardupilot" and middle <= 0:
        raise CheckFailed(f"ArduPilot corrects nothing where the middle of the range is not above 0 C: {middle:.1f} C")
    d = (t.astype(np.float32) - middle).astype(np.float64)
    unit = np.array([1.0, *([1.0 if autopilot == "px4" else float(_SCALE)] * (_ORDERS - 1))])
    columns = d[:, None] ** np.arange(_ORDERS) * unit
    x = np.zeros(_ORDERS, dtype=np.float32)
    rest = y * _RAD_S
    for order in reversed(range(_ORDERS)):
        scale = np.abs(columns[:, : order + 1]).max(axis=0)
        found = np.linalg.lstsq(columns[:, : order + 1] / scale, rest, rcond=None)[0] / scale
        x[order] = np.float32(found[order])
        rest = rest - columns[:, order] * float(x[order])
    coefficients = (x[0], x[1], x[2], x[3])
    lost = _evaluated(autopilot, t.astype(np.float32) - middle, coefficients).astype(np.float64) / _RAD_S - y
    return Cubic(
        autopilot, middle, low, high, coefficients, float(np.sqrt(np.mean(lost**2))), float(np.abs(lost).max()),
        float(np.sqrt(np.mean(y**2))),
    )  # fmt: skip


AXES = ("x", "y", "z")
_REAL, _INTEGER = 9, 6  # MAV_PARAM_TYPE_REAL32, MAV_PARAM_TYPE_INT32


def parameters(
    serial: str, autopilot: Autopilot, cubics: Mapping[str, Cubic], notes: Sequence[str], device: int
) -> str:
    """The text of a parameter file; axes that are not there get zeros."""
    first = next(iter(cubics.values()))
    rows = _of_px4(first, cubics, device) if autopilot == "px4" else _of_ardupilot(first, cubics)
    lines = [f"# gyrotc: gyro {serial}, best cubic over temperature in float32", *(f"# {note}" for note in notes)]
    if autopilot == "px4":
        lines.append("# TC_G0_ID has to be CAL_GYRO0_ID of the vehicle (--device)" if not device else "#")
        body = (f"1\t1\t{name}\t{text}\t{kind}" for name, text, kind in rows)
    else:
        lines.append("# set INS_GYR_CAL to 0: a calibration at start would replace INS_GYROFFS")
        body = (f"{name},{text}" for name, text, _ in rows)
    return "\n".join([*(toml_comment(line, 300) for line in lines), *body]) + "\n"


def _text(value: np.float32) -> str:
    return f"{value:.9g}"  # gives the same float32 again


def _of(cubics: Mapping[str, Cubic], axis: str, order: int) -> np.float32:
    return cubics[axis].x[order] if axis in cubics else np.float32(0.0)


def _of_px4(first: Cubic, cubics: Mapping[str, Cubic], device: int) -> Iterator[tuple[str, str, int]]:
    yield "TC_G_ENABLE", "1", _INTEGER
    yield "TC_G0_ID", str(device), _INTEGER
    for order in range(4):
        for number, axis in enumerate(AXES):
            yield f"TC_G0_X{order}_{number}", _text(_of(cubics, axis, order)), _REAL
    yield "TC_G0_TREF", _text(first.reference_c), _REAL
    yield "TC_G0_TMIN", _text(first.lowest_c), _REAL
    yield "TC_G0_TMAX", _text(first.highest_c), _REAL


def _of_ardupilot(first: Cubic, cubics: Mapping[str, Cubic]) -> Iterator[tuple[str, str, int]]:
    yield "INS_TCAL1_ENABLE", "1", _INTEGER
    yield "INS_TCAL1_TMIN", _text(first.lowest_c), _REAL
    yield "INS_TCAL1_TMAX", _text(first.highest_c), _REAL
    for axis in AXES:
        yield f"INS_GYROFFS_{axis.upper()}", _text(_of(cubics, axis, 0)), _REAL
        for order in (1, 2, 3):
            yield f"INS_TCAL1_GYR{order}_{axis.upper()}", _text(_of(cubics, axis, order)), _REAL
    yield "INS_GYR1_CALTEMP", _text(first.reference_c), _REAL  # the offset is that of the middle


Format = Literal["px4", "ardupilot", "csv", "json", "a2l", "cdf", "fmu"]


@dataclass(frozen=True, slots=True)
class Exporting:
    """What an export goes by, beside its form.

    Attributes:
        axis_as: Axis of the autopilot for a result of a single axis.
        device: PX4's id of the gyro (`CAL_GYRO0_ID`).
        points: Temperatures and rates of temperature of a table.
        address: Where the table begins in the memory of the control unit (A2L).
    """

    axis_as: str = "x"
    device: int = 0
    points: tuple[int, int] = GRID
    address: int = 0


def export(folder: Path, format: Format, out: Path, options: Exporting = Exporting()) -> list[str]:
    """Writes one file; returns what is to be known of it, a line for each axis.

    Args:
        folder: What `build` wrote, also with `--axis all`.

    Raises:
        InputError: The folder has no model, or `out` holds what gyrotc did not write.
        CheckFailed: The other form cannot hold the correction, or what `folder` holds was changed.
    """
    check_replaceable(out)
    parts = [folder / name for name in axes_in(folder)] or [folder]
    for part in parts:
        check_intact(part, ("model.json", "c"), needed=False)
    models = [load_model(part / "model.json") for part in parts]
    if format == "fmu":
        data, lines = fmu(folder, models)
        write_atomically(out, data)
        return lines
    # The models whose maps the tables beside them compute (`emit --zero-at`)
    shifted = [
        read_options(part / "c").shifted(model) if (part / "c" / RECORD).is_file() else model
        for part, model in zip(parts, models, strict=True)
    ]
    if format in get_args(Autopilot):
        text, lines = _cubics(shifted, cast(Autopilot, format), options)
    else:
        text, lines = _tables(shifted, format, options)
    write_atomically(out, text)
    return lines


def _cubics(models: Sequence[Model], format: Autopilot, options: Exporting) -> tuple[str, list[str]]:
    if options.axis_as not in AXES:
        raise InputError("--axis-as", repr(options.axis_as), ", ".join(AXES))
    cubics = {model.axis or options.axis_as: best_cubic(model, format) for model in models}
    lost = [
        f"axis {axis}: the cubic is {c.rms_dph:.2e} deg/h RMS from the map, at most {c.largest_dph:.2e} deg/h; "
        f"the map takes off {c.flat_dph:.2e} deg/h"
        for axis, c in cubics.items()
    ]
    return parameters(models[0].serial, format, cubics, lost, options.device), lost


def _tables(models: Sequence[Model], format: Format, options: Exporting) -> tuple[str, list[str]]:
    grids = [grid_of(model, options.points) for model in models]
    lost = [_lost(grid) for grid in grids]
    if format == "csv":
        return csv_text(grids), lost
    if format == "json":
        return json_text(map_result(grids).content()), lost
    return a2l_text(grids, lost, options.address) if format == "a2l" else cdf_text(grids, lost), lost


def _lost(grid: MapGrid) -> str:
    axis = f"axis {grid.model.axis}: " if grid.model.axis else ""
    terms = [term.id for term in grid.model.terms]
    without = f"; without the terms {', '.join(terms)}" if terms else ""
    shape = f"{grid.temperature_c.size} x {grid.slope_c_per_min.size}"
    return (
        f"{axis}{shape} points; linear between them it is {grid.rms_dph:.2e} deg/h RMS from the map, at most "
        f"{grid.largest_dph:.2e} deg/h{without}"
    )


_HOST = "host-gcc-O2"
_PLATFORMS = {"x86_64": "x86_64-linux", "aarch64": "aarch64-linux"}  # FMI 3.0, section 2.5.1.4
_FLAGS, _LINK = ("-fPIC", "-fvisibility=hidden"), ("-shared", "-s")
_WHOLE = (1980, 1, 1, 0, 0, 0)  # the earliest date that a ZIP file has, for every file in it
_FIRST_INPUT, _OUTPUTS = 2, 3  # value references: docs/delivery.md, and fmu.c
_RAD_PER_S = "4.84813681109536e-06"  # 1 deg/h


def fmu(folder: Path, models: Sequence[Model]) -> tuple[bytes, list[str]]:
    """The whole file, and what is to be known of it.

    Args:
        folder: What `build` or `emit` wrote; its `c/` is compiled only as gyrotc emits it.
        models: Those of its axes.

    Raises:
        InputError: There is no emitted code.
        CheckFailed: It was changed, or holds no float32.
    """
    check_emitted(folder, "not exported")
    names = ["gtc.h", "gtc_config.h", "gtc.c", *(f"gtc_{m.id}.{end}" for m in models for end in ("h", "c"))]
    sources, whole = {name: (folder / "c" / name).read_bytes() for name in names}, hashlib.sha256()
    if any(b"gtc_f32_table_t" not in sources[f"gtc_{m.id}.h"] for m in models):
        raise CheckFailed("a table has no float32, which a unit of co-simulation computes in")
    for name, data in sources.items():
        whole.update(f"{name} {len(data)}\n".encode() + data)
    token = "{" + whole.hexdigest()[:32] + "}"  # another table is another unit
    inputs = ["temperature_c", *sorted({name for model in models for name in channel_names(model)})]
    sources["fmu.c"] = _wrapper(models, inputs, token)
    name = f"gtc_{models[0].id if len(models) == 1 else table_id(models[0].serial, None)}"
    files = {"modelDescription.xml": _description(models, name, inputs, token)}
    binary, platform = _binary(sources)
    if binary:
        files[f"binaries/{_here()}/{name}.so"] = binary
    files |= {f"sources/{file}": data for file, data in sources.items()}
    files["sources/buildDescription.xml"] = _build_description(name, sources)
    return _zipped(files), [f"inputs {', '.join(inputs)}; {platform}"]


def _wrapper(models: Sequence[Model], inputs: Sequence[str], token: str) -> bytes:
    """`fmu.c`; a table with fewer channels than the others reads the temperature for what it does not have."""
    rows = [[0, *(inputs.index(name) for name in channel_names(model))] for model in models]
    most = max(map(len, rows))
    text = c_environment().get_template("fmu.c.j2").render(
        models=list(models), n_inputs=len(inputs), most_channels=most, token=token,
        channels=[[*row, *[0] * (most - len(row))] for row in rows],
        starts=[c_code(f"{start:#.9g}F") for start in _starts(models, inputs)],
        period_us=example_period_us(models[0]),
    )  # fmt: skip
    return text.encode("ascii")


def _starts(models: Sequence[Model], inputs: Sequence[str]) -> list[float]:
    """Inputs that nobody set: the middle of the envelope, and what stands for a channel that is lost."""
    found = [round(sum(models[0].envelope.temperature_c) / 2.0, 1)]
    for name in inputs[1:]:
        found.append(next(guard_of(m, name).fallback for m in models if name in channel_names(m)))
    return found


def _description(models: Sequence[Model], name: str, inputs: Sequence[str], token: str) -> bytes:
    period_s = repr(example_period_us(models[0]) / 1e6)
    root = Element(
        "fmiModelDescription",
        {
            "fmiVersion": "3.0", "modelName": name, "generationTool": "gyrotc", "instantiationToken": token,
            "description": f"Bias of gyro {models[0].serial} from its temperature", "variableNamingConvention": "flat",
        },
    )  # fmt: skip
    SubElement(
        root, "CoSimulation",
        {"modelIdentifier": name, "canGetAndSetFMUState": "true", "canHandleVariableCommunicationStepSize": "true"},
    )  # fmt: skip
    units = SubElement(root, "UnitDefinitions")
    SubElement(SubElement(units, "Unit", {"name": "degC"}), "BaseUnit", {"K": "1", "offset": "273.15"})
    SubElement(SubElement(units, "Unit", {"name": "deg/h"}), "BaseUnit", {"rad": "1", "s": "-1", "factor": _RAD_PER_S})
    SubElement(SubElement(root, "LogCategories"), "Category", {"name": "logStatusError"})
    SubElement(root, "DefaultExperiment", {"startTime": "0", "stepSize": period_s})
    outputs = _variables(root, models, inputs)
    structure = SubElement(root, "ModelStructure")
    for kind in ("Output", "InitialUnknown"):
        for reference in outputs:
            SubElement(structure, kind, {"valueReference": str(reference)})
    return _xml(root)


def _variables(root: Element, models: Sequence[Model], inputs: Sequence[str]) -> list[int]:
    """The variables; returns the references of the outputs."""
    listed, used = SubElement(root, "ModelVariables"), set[str]()
    of_time = {"name": "time", "valueReference": "0", "causality": "independent", "variability": "continuous"}
    period = {
        "name": "sample_period_us", "valueReference": "1", "causality": "parameter", "variability": "fixed",
        "description": "From sample to sample, microseconds; a step takes one for each",
        "start": str(example_period_us(models[0])),
    }  # fmt: skip
    clock = (("Float64", of_time), ("UInt32", period))
    for kind, facts in (*clock, *_outputs(models, len(inputs)), *_inputs(models, inputs)):
        name = toml_comment(facts["name"], 200)
        if name in used:  # a recorded channel with the name of an output
            name = f"channel {facts['valueReference']} {name}"
        used.add(name)
        SubElement(listed, kind, facts | {"name": name})
    return [int(one.attrib["valueReference"]) for one in listed if one.attrib["causality"] == "output"]


def _outputs(models: Sequence[Model], n_inputs: int) -> Iterator[tuple[str, dict[str, str]]]:
    """Bias, status and, where the table states it, sigma of each axis."""
    given = {"causality": "output", "variability": "discrete"}
    for k, model in enumerate(models):
        of = f"_{model.axis}" if len(models) > 1 else ""
        rows = [
            ("Float32", f"bias{of}_dph", "Correction in force: compensated = measured - bias", {"unit": "deg/h"}),
            ("Int32", f"status{of}", "Bits of gtc.h: 0 is done", {}),
            ("Float32", f"sigma{of}_dph", "1 sigma of the compensated bias", {"unit": "deg/h"}),
        ]
        for n, (kind, name, text, unit) in enumerate(rows[: 3 if sigma_cells(model)[0] else 2]):
            reference = str(_FIRST_INPUT + n_inputs + _OUTPUTS * k + n)
            yield kind, {"name": name, "valueReference": reference, "description": text} | given | unit


def _inputs(models: Sequence[Model], inputs: Sequence[str]) -> Iterator[tuple[str, dict[str, str]]]:
    given = {"causality": "input", "variability": "discrete"}
    for k, start in enumerate(_starts(models, inputs)):
        text = f"{'As recorded' if k else 'Of the gyro'}; not a number: no reading"
        facts = {"name": inputs[k], "valueReference": str(_FIRST_INPUT + k), "description": text}
        yield "Float32", facts | given | {"start": f"{start:.9g}"} | ({} if k else {"unit": "degC"})


def _here() -> str | None:
    """The name that FMI has for this machine."""
    return _PLATFORMS.get(platform.machine()) if sys.platform == "linux" else None


def _binary(sources: Mapping[str, bytes]) -> tuple[bytes, str]:
    """The shared library, and which; empty where it cannot be made here."""
    target = all_targets()[_HOST]
    if _here() is None or target.missing():
        return b"", "sources only: the importer compiles them (C99, -ffp-contract=off)"
    shared = target.model_copy(update={"flags": (*target.flags, *_FLAGS), "link": (*target.link, *_LINK)})
    with scratch_folder() as work:
        for name, data in sources.items():
            write_own(work / name, data)
        compile_c(shared, [work / name for name in sources if name.endswith(".c")], work / "fmu.so", include=work)
        return (work / "fmu.so").read_bytes(), f"binary for {_here()}, and the sources"


def _build_description(name: str, sources: Mapping[str, bytes]) -> bytes:
    root = Element("fmiBuildDescription", {"fmiVersion": "3.0"})
    options = {"language": "C99", "compilerOptions": "-ffp-contract=off"}
    files = SubElement(SubElement(root, "BuildConfiguration", {"modelIdentifier": name}), "SourceFileSet", options)
    for file in (file for file in sources if file.endswith(".c")):
        SubElement(files, "SourceFile", {"name": file})
    return _xml(root)


def _xml(root: Element) -> bytes:
    indent(root, " ")
    text = f'<?xml version="1.0" encoding="UTF-8"?>\n{tostring(root, "unicode")}\n'
    return text.encode("utf-8")


def _zipped(files: Mapping[str, bytes]) -> bytes:
    """The description comes first, and as it is: so it can be determined who wrote the file (`results/files.py`)."""
    stream = io.BytesIO()
    with zipfile.ZipFile(stream, "w") as archive:
        for k, (name, data) in enumerate(files.items()):
            info = zipfile.ZipInfo(name, _WHOLE)
            info.external_attr = 0o644 << 16
            archive.writestr(info, data, zipfile.ZIP_DEFLATED if k else zipfile.ZIP_STORED)
    return stream.getvalue()
