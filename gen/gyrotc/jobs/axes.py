"""Join the axes of one gyro: one folder of C files with the runtime once, a table for each axis, and one page."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from pathlib import Path

from .. import __version__
from ..common.errors import CheckFailed, InputError
from ..model import Model, load_model
from ..pages.report import axes_page
from ..results.base import NUMERICS
from ..results.files import write_atomically, write_own
from ..results.folder import scratch_folder
from ..results.marker import read_marker
from ..results.release import JointVerification, Verification
from ..results.templates import c_templates
from ..tables.record import RECORD, joint_record_text
from ..tables.runtime import RUNTIME_FILES, joint_needs, needs_of, runtime_texts
from ..tables.text import example_period_us, example_samples
from ..verify.emitted import file_entries
from ..verify.toolchain import all_targets, compile_c, run_program

AXES = ("x", "y", "z")
_HOST = "host-gcc-O2"


def join_axes(folder: Path, axes: Sequence[str]) -> None:
    """Fill `folder/c` and `folder/report.html` from `folder/<axis>`.

    Proves that all tables link and pass their self-tests in one image.

    Raises:
        CheckFailed: The image does not link, or a table does not pass its self-test in it.
    """
    models = {axis: load_model(folder / axis / "model.json") for axis in axes}
    c = folder / "c"
    c.mkdir()
    for name, data in joint_texts(models, _sources(folder, axes)).items():
        write_own(c / name, data)
    _run_together(c, [m.id for m in models.values()])
    write_atomically(folder / "report.html", axes_page(folder, axes))


def _sources(folder: Path, axes: Sequence[str]) -> dict[str, dict[str, bytes]]:
    """Return the files of the `c/` of each axis by name."""
    return {
        axis: {p.name: p.read_bytes() for p in sorted((folder / axis / "c").iterdir()) if p.is_file()} for axis in axes
    }


def joint_texts(models: Mapping[str, Model], sources: Mapping[str, Mapping[str, bytes]]) -> dict[str, bytes]:
    """Return all files of the `c/` of a unit by name.

    The axes may have different arithmetics: a product's may be refused for one axis, which then has the other. `main.c`
    uses the first that each has, as its own `main.c` does.

    Args:
        models: Models by axis.
        sources: Files of each axis's own `c/` by name.
    """
    numerics = {axis: _numerics_in(sources[axis].get(f"gtc_{model.id}.h", b"")) for axis, model in models.items()}
    held = [n for n in NUMERICS if any(n in of_axis for of_axis in numerics.values())]
    texts = runtime_texts(joint_needs(needs_of(model) for model in models.values()), held)
    for axis, model in models.items():
        own = (f"gtc_{model.id}.", f"gtc_{model.id}_")
        texts |= {name: data for name, data in sources[axis].items() if name.startswith(own)}
    first = next(iter(models.values()))
    used = {axis: next(iter(of_axis), NUMERICS[0]) for axis, of_axis in numerics.items()}
    main = (
        c_templates()
        .get_template("main_axes.c.j2")
        .render(
            axes=[{"model": model, "numeric": used[axis]} for axis, model in models.items()],
            numerics=[n for n in NUMERICS if n in used.values()],
            temperature_c=sum(first.envelope.temperature_c) / 2,
            period_us=example_period_us(first),
            samples=example_samples(first),
        )
    )
    texts["main.c"] = main.encode("ascii")
    texts[RECORD] = joint_record_text(models, texts)
    return texts


def _numerics_in(header: bytes) -> list[str]:
    """Return the arithmetics of the tables that a header declares, in its order."""
    return [n for n in re.findall(r"^extern const gtc_(\w+)_table_t ", header.decode("latin-1"), re.M) if n in NUMERICS]


def axes_in(folder: Path) -> tuple[str, ...]:
    """Return the axes of a result of several; none where the folder has a model of its own."""
    if (folder / "model.json").is_file():
        return ()
    return tuple(axis for axis in AXES if (folder / axis / "model.json").is_file())


def refuse_parts_of_two(folder: Path, models: Mapping[str, Model]) -> None:
    """Refuse a result whose axes were not built together from recordings of one gyro, or are not all there.

    Args:
        folder: The result; messages name it.
        models: Models by the axis that their folder stands for; "": of one rate.

    Raises:
        InputError: An axis is missing or not the one that its folder names, or serials, days or recordings differ.
    """
    marker = read_marker(folder)
    for part in marker.parts if marker else ():
        if part in AXES and part not in models:
            raise InputError(str(folder / part), "is missing", "all axes, as build wrote them")
    first = next(iter(models.values()))
    for axis, model in models.items():
        if (model.axis or "") != axis:
            raise InputError(str(folder / axis), f"holds axis {model.axis}", "each axis once, in its own folder")
        for what, one, other in (
            ("serial", first.serial, model.serial),
            ("day of the calibration", first.calibrated_on, model.calibrated_on),
            ("recordings", first.data, model.data),
        ):
            if one != other:
                found = f"axes {first.axis} and {axis} differ in {what}: they are parts of two units"
                raise InputError(str(folder), found, "axes that were built together from recordings of one gyro")


def verify_axes(
    folder: Path,
    results: Mapping[str, Verification],
) -> JointVerification:
    """Verify the axes of a unit; return the content of its `verify.json`: their results, and the files in `folder/c`.

    These must be those of the axes' own folders, which `results` judges.

    Raises:
        InputError: There is no emitted folder, or a model cannot be read.
    """
    models = {axis: load_model(folder / axis / "model.json") for axis in results}
    refuse_parts_of_two(folder, models)
    if not (folder / "c").is_dir():
        raise InputError(str(folder / "c"), "is not there", "the files of all axes, as build wrote them")
    texts = joint_texts(models, _sources(folder, tuple(results)))
    emitted = tuple(file_entries(folder / "c", texts))
    wrong = sum(file.status == "fail" for file in emitted)
    return JointVerification(
        gyrotc_version=__version__,
        serial=next(iter(results.values())).serial,
        axis=None,
        passed=sum(one.passed for one in results.values()),
        failed=sum(one.failed for one in results.values()) + wrong,
        missing=sum(one.missing for one in results.values()),
        emitted=emitted,
        axes=dict(results),
    )


def _run_together(c: Path, ids: Sequence[str]) -> None:
    target = all_targets()[_HOST]
    with scratch_folder() as work:
        program = work / "main"
        sources = ["main.c", *(name for name in RUNTIME_FILES if name.endswith(".c") and (c / name).is_file())]
        compile_c(target, [c / n for n in (*sources, *(f"gtc_{i}.c" for i in ids))], program, include=c)
        done = run_program(target, program)
    if done.returncode != 0:
        raise CheckFailed(f"the image of all axes ended with status {done.returncode}")
