"""`gyrotc diagnose --out`: the diagnosis with its pictures, its page, the extended model and the extended scenario.

Data flows one way: `diagnose` finds, `diagnosis_plots` draws, `diagnosis_page` writes the page from what
stands in the folder.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

from ..common.arrays import Progress
from ..common.texts import toml_comment, toml_key, toml_value
from ..diagnose.result import Diagnosis, diagnose
from ..model import Model
from ..pages.diagnosis_page import PICTURES, write_diagnosis_page
from ..pages.diagnosis_plots import draw
from ..recordings.records import Dataset
from ..results.diagnosed import Diagnosed, NamedCause
from ..store.files import write_atomically
from ..store.folder import result_folder
from ..store.jsontext import json_text
from ..train.fitting import FitOptions

__all__ = ["diagnose_into", "extended_scenario", "save"]


_MODEL, _SCENARIO = "model-extended.json", "scenario-extended.toml"


def diagnose_into(
    out: Path,
    dataset: Dataset,
    *,
    model: Model | None = None,
    options: FitOptions | None = None,
    progress: Progress | None = None,
    accept_events: bool = False,
) -> Diagnosis:
    """Diagnoses a data set and fills `out`: `diagnose.json`, `report.html`, pictures, the extended model.

    Raises:
        InputError: As `diagnose` and `result_folder`.
    """
    with result_folder(out, "diagnose", inputs=[dataset.folder]) as stage:
        stage.of(dataset.serial, dataset.axis)
        found = diagnose(
            dataset, model=model, options=options, progress=progress, accept_events=accept_events
        )
        return save(stage.folder, found, progress)


def save(out: Path, found: Diagnosis, progress: Progress | None = None) -> Diagnosis:
    """Writes a diagnosis into a folder; its result then names the files."""
    if progress:
        progress("drawing")
    result = found.result
    if result.extended is not None and found.model is not None:
        found.model.save(out / _MODEL)
        result = result.model_copy(update={"extended": result.extended.model_copy(update={"model": _MODEL})})
    scenario = extended_scenario(result)
    if scenario is not None:
        write_atomically(out / _SCENARIO, scenario)
        result = result.model_copy(update={"scenario": _SCENARIO})
    drawn = draw(found)
    for name, svg in drawn.items():
        write_atomically(out / PICTURES / f"{name}.svg", svg)
    result = result.model_copy(update={"pictures": tuple(f"{PICTURES}/{name}.svg" for name in drawn)})
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
        lines += [
            "",
            "[noise]",
            *(f"{toml_key(name)} = {toml_value(value)}" for name, value in noise.items()),
        ]
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
