"""A unit of co-simulation (FMU, FMI 3.0) with the emitted C inside: description, sources, a binary for this machine.

The same files give the same bytes: nothing in it depends on date, place or host but the binary, which depends on the
compiler.
"""

from __future__ import annotations

import hashlib
import io
import platform
import sys
import zipfile
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from xml.etree.ElementTree import Element, SubElement, indent, tostring

from ..common.errors import CheckFailed
from ..common.texts import c_code, c_environment, toml_comment
from ..jobs.axes import check_emitted
from ..model import Model, table_id
from ..store.files import write_own
from ..store.scratch import scratch_folder
from ..tables.rounding import channel_names, guard_of, sigma_cells
from ..tables.text import example_period_us
from ..verify.toolchain import all_targets, compile_c

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
    sources = _sources(folder / "c", models)
    inputs = ["temperature_c", *sorted({name for model in models for name in channel_names(model)})]
    token = _token(sources)
    sources["fmu.c"] = _wrapper(models, inputs, token)
    name = f"gtc_{models[0].id if len(models) == 1 else table_id(models[0].serial, None)}"
    files = {"modelDescription.xml": _description(models, name, inputs, token)}
    binary, platform = _binary(sources)
    if binary:
        files[f"binaries/{_here()}/{name}.so"] = binary
    files |= {f"sources/{file}": data for file, data in sources.items()}
    files["sources/buildDescription.xml"] = _build_description(name, sources)
    return _zipped(files), [f"inputs {', '.join(inputs)}; {platform}"]


def _sources(c: Path, models: Sequence[Model]) -> dict[str, bytes]:
    names = ["gtc.h", "gtc_config.h", "gtc.c", *(f"gtc_{m.id}.{end}" for m in models for end in ("h", "c"))]
    sources = {name: (c / name).read_bytes() for name in names}
    if any(b"gtc_f32_table_t" not in sources[f"gtc_{m.id}.h"] for m in models):
        raise CheckFailed("a table has no float32, which a unit of co-simulation computes in")
    return sources


def _token(sources: Mapping[str, bytes]) -> str:
    """The instantiation token: another table is another unit."""
    whole = hashlib.sha256()
    for name, data in sources.items():
        whole.update(f"{name} {len(data)}\n".encode() + data)
    return "{" + whole.hexdigest()[:32] + "}"


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
    SubElement(
        SubElement(units, "Unit", {"name": "deg/h"}),
        "BaseUnit",
        {"rad": "1", "s": "-1", "factor": _RAD_PER_S},
    )
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
    for kind, facts in (
        *_clock(example_period_us(models[0])),
        *_outputs(models, len(inputs)),
        *_inputs(models, inputs),
    ):
        name = toml_comment(facts["name"], 200)
        if name in used:  # a recorded channel with the name of an output
            name = f"channel {facts['valueReference']} {name}"
        used.add(name)
        SubElement(listed, kind, facts | {"name": name})
    return [int(one.attrib["valueReference"]) for one in listed if one.attrib["causality"] == "output"]


def _clock(period_us: int) -> Iterator[tuple[str, dict[str, str]]]:
    yield (
        "Float64",
        {"name": "time", "valueReference": "0", "causality": "independent", "variability": "continuous"},
    )
    yield (
        "UInt32",
        {
            "name": "sample_period_us", "valueReference": "1", "causality": "parameter", "variability": "fixed",
            "description": "From sample to sample, microseconds; a step takes one for each", "start": str(period_us),
        },
    )  # fmt: skip


def _outputs(models: Sequence[Model], n_inputs: int) -> Iterator[tuple[str, dict[str, str]]]:
    """Bias, status and, where the table states it, sigma of each axis."""
    given = {"causality": "output", "variability": "discrete"}
    for k, model in enumerate(models):
        of = f"_{model.axis}" if len(models) > 1 else ""
        rows = [
            (
                "Float32",
                f"bias{of}_dph",
                "Correction in force: compensated = measured - bias",
                {"unit": "deg/h"},
            ),
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
    """The description comes first, and as it is: so it can be determined who wrote the file (`store/files.py`)."""
    stream = io.BytesIO()
    with zipfile.ZipFile(stream, "w") as archive:
        for k, (name, data) in enumerate(files.items()):
            info = zipfile.ZipInfo(name, _WHOLE)
            info.external_attr = 0o644 << 16
            archive.writestr(info, data, zipfile.ZIP_DEFLATED if k else zipfile.ZIP_STORED)
    return stream.getvalue()
