"""`gyrotc diagnose`: the diagnosis in a folder, with pictures, page, extended model and scenario."""

from __future__ import annotations

import math
from collections.abc import Iterator
from contextlib import nullcontext
from dataclasses import replace
from pathlib import Path
from typing import Any

from ..common.progress import Progress, Stages, silent
from ..common.texts import toml_comment, toml_key, toml_value
from ..common.threads import with_one_thread
from ..diagnose.diagnosis import Diagnosis
from ..diagnose.diagnosis import diagnose as _diagnose
from ..diagnose.series import series_of
from ..pages.diagnosis import PICTURES, SERIES, diagnosis_pictures, write_diagnosis_page
from ..quality.judgement import Judged
from ..recordings.loading import asked_axes, load
from ..recordings.records import Dataset
from ..results.diagnosed import Diagnosed, NamedCause
from ..results.files import write_atomically
from ..results.folder import result_folder
from ..results.json_text import json_text
from ..train.fitting import FitOptions
from .applied import applied_in

_MODEL, _SCENARIO = "model-extended.json", "scenario-extended.toml"


@with_one_thread
def diagnose(
    source: Path,
    out: Path | None = None,
    options: FitOptions | None = None,
    *,
    axis: str | None = None,
    progress: Progress = silent,
) -> dict[str, Diagnosed]:
    """Return the diagnosis of each axis of recordings by its name; "" where they have one rate or one axis is named.

    Args:
        source: Folder of recordings.
        out: Folder of the result, of several axes in `out/x`, `out/y`, `out/z`; None: no files.
        options: As for `fit`, without an earlier model; None: all at their defaults.
        axis: Axis of three-axis recordings; None or "all": every one.
        progress: Takes note of every stage.

    Raises:
        InputError: Bad recordings or arguments, or a file in `out` that gyrotc did not write; `out` is untouched.
    """
    applied = applied_in(source)
    axes = asked_axes(source, axis)
    several = len(axes) > 1 or axis == "all"
    of_axes = Stages(progress, dict.fromkeys(map(str, axes), 1.0))
    results: dict[str, Diagnosed] = {}
    with result_folder(out, "diagnose", inputs=[source]) if out and several else nullcontext() as stage:
        for name in axes:
            dataset = load(source, axis=name, applied=applied)
            into = stage.folder / str(name) if stage else out
            say = of_axes.within(str(name), f"{name}: " if several else "")
            result = diagnose_dataset(dataset, into, options=options, progress=say).result
            results[str(name) if several else ""] = result
    return results


def diagnose_dataset(
    dataset: Dataset,
    out: Path | None = None,
    *,
    options: FitOptions | None = None,
    progress: Progress = silent,
    judged: Judged | None = None,
) -> Diagnosis:
    """Diagnose a data set and write the result into a folder.

    Args:
        out: Folder that gets `diagnose.json`, `report.html`, pictures and the extended model; None: no files.
        options: As for `fit`, without an earlier model.
        progress: Takes note of every stage.
        judged: Judgement of the rows of the runs; None: they are judged here.

    Raises:
        InputError: As `gyrotc.diagnose.diagnose` and `result_folder`.
    """
    chosen = (options or FitOptions()).with_stated(dataset.fit)
    with result_folder(out, "diagnose", inputs=[dataset.folder]) if out else nullcontext() as stage:
        if stage:
            stage.of(dataset.serial, dataset.axis)
        say = Stages(progress, {"diagnosing": 0.96, "drawing": 0.04})
        found = _diagnose(dataset, options=chosen, progress=say.within("diagnosing"), judged=judged)
        if stage is None:
            return found
        say("drawing")
        return _saved(stage.folder, found)


def _saved(out: Path, found: Diagnosis) -> Diagnosis:
    """Write a diagnosis into a folder; its result then names the files."""
    result, names = found.result, dict[str, Any]()
    if result.extended is not None and found.model is not None:
        found.model.save(out / _MODEL)
        names["extended"] = result.extended.model_copy(update={"model": _MODEL})
    scenario = extended_scenario(result)
    if scenario is not None:
        write_atomically(out / _SCENARIO, scenario)
        names["scenario"] = _SCENARIO
    series = series_of(found)
    drawn = {} if series is None else diagnosis_pictures(result, series)
    for name, svg in drawn.items():
        write_atomically(out / PICTURES / f"{name}.svg", svg)
    names["pictures"] = tuple(f"{PICTURES}/{name}.svg" for name in drawn)
    if series is not None:
        write_atomically(out / SERIES, json_text(series.content()))
        names["series"] = SERIES
    result = result.model_copy(update=names)
    write_atomically(out / "diagnose.json", json_text(result.content()))
    write_diagnosis_page(out)
    return replace(found, result=result)


def extended_scenario(result: Diagnosed) -> str | None:
    """A scenario file whose gyro has the causes that were found; None where none was.

    Profiles are the packaged ones: who knows the chamber's programme puts it in their place.
    """
    causes = [cause for cause in result.physical if cause.parameters]
    if not causes:
        return None
    lines = [
        f"# Causes that gyrotc diagnose found in {toml_comment(result.serial)}, with their fitted parameters.",
        "# The profiles are those of the scenario named here; put your chamber's in their place.",
        'extends = "separating"',
        f"title = {toml_value('the separating profiles with what was found in ' + result.serial)}",
    ]
    noise = result.estimated_noise
    if noise:
        lines += ["", "[noise]", *(f"{toml_key(name)} = {toml_value(value)}" for name, value in noise.items())]
    for cause in causes:
        lines += _cause(cause)
    return "\n".join(lines) + "\n"


def _cause(cause: NamedCause) -> Iterator[str]:
    values = {name: p.value for name, p in cause.parameters.items()}
    if cause.channel is not None:
        yield from ("", "[[channel]]", f"name = {toml_value(cause.channel)}")
        yield f"level = {toml_value(values.get('reference', 0.0))}"
    yield from ("", "[[cause]]", f"id = {toml_value(cause.id)}")
    if cause.channel is not None:
        yield f"channel = {toml_value(cause.channel)}"
    for name, value in values.items():
        if math.isfinite(value):
            yield f"{toml_key(name)} = {toml_value(value)}"
