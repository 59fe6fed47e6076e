"""`gyrotc diagnose`: the diagnosis with pictures, page and extended model; repeated ones come from the cache.

Diagnosis finds, the page draws what it found and is written from what stands in the folder. What was diagnosed before
is neither computed nor drawn, and nothing that does so is loaded. What a diagnosis depends on makes its name in the
cache: the bytes of the recordings and of their description, the options, every file of gyrotc and the versions of what
computes and draws beside it.
"""

from __future__ import annotations

import functools
import hashlib
import json
import math
import platform
from collections.abc import Iterator, Sequence
from contextlib import nullcontext
from dataclasses import asdict, dataclass, replace
from importlib.metadata import version
from pathlib import Path, PurePosixPath
from typing import TYPE_CHECKING, Any

from .. import _core
from ..common.arrays import Progress
from ..common.texts import toml_comment, toml_key, toml_value
from ..model import Model
from ..recordings.description import FILE
from ..recordings.records import Dataset
from ..results import cache
from ..results.base import checked_result
from ..results.diagnosed import Diagnosed, NamedCause
from ..results.files import digest_of, json_text, write_atomically
from ..results.folder import result_folder
from ..results.training import Training
from ..train.fitting import FitOptions

if TYPE_CHECKING:
    from ..diagnose.diagnosis import Diagnosis

_MODEL, _SCENARIO = "model-extended.json", "scenario-extended.toml"


def _saved(out: Path, found: Diagnosis, progress: Progress | None = None) -> Diagnosis:
    """Writes a diagnosis into a folder; its result then names the files."""
    from ..diagnose.diagnosis import series_of
    from ..pages.diagnosis import PICTURES, SERIES, draw, write_diagnosis_page

    if progress:
        progress("drawing")
    result, names = found.result, dict[str, Any]()
    if result.extended is not None and found.model is not None:
        found.model.save(out / _MODEL)
        names["extended"] = result.extended.model_copy(update={"model": _MODEL})
    scenario = extended_scenario(result)
    if scenario is not None:
        write_atomically(out / _SCENARIO, scenario)
        names["scenario"] = _SCENARIO
    series = series_of(found)
    drawn = {} if series is None else draw(result, series)
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


_LIBRARIES = ("numpy", "scipy", "jinja2", "pydantic", "pyarrow")
_REPORT, _RESULT = "report.html", "diagnose.json"
_KINDS = (".html", ".json", ".svg", ".toml")


@dataclass(frozen=True)
class Kept:
    """A diagnosis as it was written.

    Attributes:
        result: What `diagnose.json` holds.
        files: Texts of its files by path within the folder; none where it was made without a folder.
        training: What `training.json` says of the extended model, where one is shipped.
    """

    result: Diagnosed
    files: dict[str, str]
    training: Training | None = None


def diagnosed(
    dataset: Dataset,
    out: Path | None = None,
    *,
    model: Model | None = None,
    options: FitOptions | None = None,
    progress: Progress | None = None,
    accept_events: bool = False,
    fresh: bool = False,
) -> Kept:
    """Diagnoses a data set, or takes what an earlier call found of the same.

    Args:
        out: Folder that gets `diagnose.json`, `report.html`, pictures and the extended model; None: no files.
        options: As for `fit`, without an earlier model.
        fresh: Diagnoses anew in any case.

    Raises:
        InputError: As `diagnose` and `result_folder`.
    """
    name = _name(dataset, model, options, accept_events=accept_events, files=out is not None)
    found = None if fresh else cache.kept(name, _unpacked)
    if found is None:
        from ..diagnose.diagnosis import diagnose

        with result_folder(out, "diagnose", inputs=[dataset.folder]) if out else nullcontext() as stage:
            if stage:
                stage.of(dataset.serial, dataset.axis)
            made = diagnose(dataset, model=model, options=options, progress=progress, accept_events=accept_events)
            made = _saved(stage.folder, made, progress) if stage else made
        names = _written(made.result) if out else ()
        files = {path: (out / path).read_bytes().decode("utf-8") for path in names} if out else {}
        found = Kept(made.result, files, made.training)
        cache.keep(name, _packed(found))
        return found
    if progress:
        progress("taking what was found before")
    if out is not None:
        _write(out, dataset, found.files)
    return found


def _write(out: Path, dataset: Dataset, files: dict[str, str]) -> None:
    """The folder as a diagnosis leaves it."""
    with result_folder(out, "diagnose", inputs=[dataset.folder]) as stage:
        stage.of(dataset.serial, dataset.axis)
        for path, text in files.items():
            if path != _REPORT:
                write_atomically(stage.folder / path, text)
        with result_folder(stage.folder, "report", kind="", entries=(_REPORT,)) as page:
            write_atomically(page.folder / _REPORT, files[_REPORT])


def _written(result: Diagnosed) -> Sequence[str]:
    """Paths of the files that a diagnosis wrote, as its result names them."""
    extended = result.extended.model if result.extended is not None else None
    more = (*(result.pictures or ()), result.series, extended, result.scenario)
    return (_RESULT, _REPORT, *(path for path in more if path is not None))


def _packed(found: Kept) -> bytes:
    training = found.training.content() if found.training else None
    held = {"result": found.result.content(), "files": found.files, "training": training}
    return json.dumps(held).encode("ascii")


def _unpacked(content: bytes) -> Kept | None:
    """None where it is no diagnosis with the files that its result names."""
    held = json.loads(content)
    result, files = checked_result(held["result"], Diagnosed, "what was kept"), held["files"]
    training = held["training"] and checked_result(held["training"], Training, "what was kept")
    plain = all(isinstance(text, str) and _is_plain(path) for path, text in files.items())
    return Kept(result, files, training) if plain and set(files) in ({*_written(result)}, set()) else None


def _is_plain(path: str) -> bool:
    """Whether a path leads to a file within the folder, of a kind that a diagnosis writes."""
    pure = PurePosixPath(path)
    return not pure.is_absolute() and ".." not in pure.parts and pure.suffix in _KINDS


def _name(
    dataset: Dataset, model: Model | None, options: FitOptions | None, *, accept_events: bool, files: bool
) -> str:
    """Name of a diagnosis among what is kept: a hash of all that it depends on."""
    description = dataset.folder / FILE
    prior = options.prior if options is not None else None
    depends: dict[str, Any] = {
        "code": _code(),
        "description": hashlib.sha256(description.read_bytes()).hexdigest() if description.is_file() else None,
        "recordings": [[run.file, run.sha256, run.role] for run in dataset.runs],
        "stated": [dataset.serial, dataset.axis, dataset.applied_table, dataset.trusted, dataset.warnings],
        "model": None if model is None else digest_of(model.to_dict()),
        "options": None if options is None else asdict(replace(options, prior=None)),
        "prior": None if prior is None else prior.key,
        "accept_events": accept_events,
        "files": files,
    }
    return f"{digest_of(depends)}.diagnosis"


@functools.cache
def _code() -> str:
    """Hash of gyrotc's files, and the versions of what it computes and draws with."""
    digest = hashlib.sha256(platform.python_version().encode())
    for library in _LIBRARIES:
        digest.update(f"{library} {version(library)}\n".encode())
    package = Path(__file__).parents[1]
    own = sorted(p for p in package.rglob("*") if p.is_file() and p.suffix != ".pyc")
    for path in (*own, Path(_core.__file__)):
        content = path.read_bytes()
        digest.update(f"{path.name} {len(content)}\n".encode() + content)
    return digest.hexdigest()
