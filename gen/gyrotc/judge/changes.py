"""What a build changed against an earlier one of the same gyro: recordings, map, figures, files.

A gyro that is calibrated again should give nearly the same map. Where it does not, the difference over the
envelope is the drift of the gyro, of its thermometer or of the procedure, and belongs into the report.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from .. import __version__
from ..errors import InputError
from ..inputs.stored import read_result
from ..model import Model, load_model

__all__ = ["Earlier", "changes_since", "load_earlier"]

_GRID = (61, 25)  # points of T and of dT/dt over the common envelope
_FIGURES = ("rms_dph", "std_dph", "max_abs_dph")


class Earlier:
    """An earlier result: its model and the JSON objects beside it (empty where a file is not there)."""

    def __init__(self, folder: Path) -> None:
        self.model = load_model(folder / "model.json")
        self.evaluation = read_result(folder / "evaluate.json", "evaluate", optional=True)
        self.manifest = read_result(folder / "manifest.json", "manifest", optional=True)


def load_earlier(folder: Path, serial: str, axis: str | None) -> Earlier:
    """Reads an earlier result folder of a gyro, of one of its axes where it has several.

    Raises:
        InputError: There is none, it is of another gyro or axis, or a file of it cannot be read.
    """
    if axis is not None and not (folder / "model.json").is_file() and (folder / axis).is_dir():
        folder = folder / axis
    if not (folder / "model.json").is_file():
        raise InputError(f"--previous {folder}", "has no model.json", "a folder that gyrotc build wrote")
    earlier = Earlier(folder)
    old = earlier.model
    if (old.serial, old.axis) != (serial, axis):
        raise InputError(f"--previous {folder}", f"is of {_name(old.serial, old.axis)}", _name(serial, axis))
    return earlier


def changes_since(
    earlier: Earlier, model: Model, evaluation: dict[str, Any], manifest: dict[str, Any]
) -> dict[str, Any]:
    """The JSON object of `changes.json`."""
    old = earlier.model
    return {
        "schema": "gyrotc.changes/1",
        "gyrotc_version": __version__,
        "serial": model.serial,
        "axis": model.axis,
        "same_model": old.hash == model.hash,
        "model_hash": {"before": old.hash, "after": model.hash},
        "recordings": _recordings(old, model),
        "map": _map(old, model),
        "envelope": {
            name: {"before": list(getattr(old.envelope, name)), "after": list(getattr(model.envelope, name))}
            for name in ("temperature_c", "slope_c_per_min")
        },
        "figures": dict(_figures(earlier, model, evaluation)),
        "findings": _sets(_ids(earlier.evaluation), _ids(evaluation)),
        "versions": dict(_versions(earlier.manifest, manifest)),
        "files": _files(earlier.manifest, manifest),
    }


def _name(serial: str, axis: str | None) -> str:
    return f"gyro {serial}" + (f", axis {axis}" if axis else "")


def _sets(before: set[str], after: set[str]) -> dict[str, list[str]]:
    return {"new": sorted(after - before), "gone": sorted(before - after)}


def _recordings(old: Model, new: Model) -> dict[str, list[str]]:
    """Names of recordings that came, went, or have other bytes."""
    before, after = ({d.file: d.sha256 for d in m.data} for m in (old, new))
    other = sorted(name for name in before.keys() & after.keys() if before[name] != after[name])
    return _sets(set(before), set(after)) | {"other_bytes": other}


def _map(old: Model, new: Model) -> dict[str, Any] | None:
    """How far the maps lie apart where both were calibrated, deg/h; None where nothing is common."""
    limits = []
    for name in ("temperature_c", "slope_c_per_min"):
        (a, b), (c, d) = getattr(old.envelope, name), getattr(new.envelope, name)
        limits.append((max(a, c), min(b, d)))
    if any(low > high for low, high in limits):
        return None
    t, slope = np.meshgrid(*(np.linspace(*span, n) for span, n in zip(limits, _GRID, strict=True)))
    apart = new.map_dph(t, slope) - old.map_dph(t, slope)
    worst = np.unravel_index(int(np.argmax(np.abs(apart))), apart.shape)
    floor = new.noise_floor_dph
    return {
        "rms_dph": float(np.sqrt(np.mean(apart**2))),
        "mean_dph": float(np.mean(apart)),
        "max_abs_dph": float(np.abs(apart[worst])),
        "at": {"temperature_c": float(t[worst]), "slope_c_per_min": float(slope[worst])},
        "rms_over_floor": float(np.sqrt(np.mean(apart**2))) / floor if floor else None,
    }


def _judged(evaluation: dict[str, Any]) -> tuple[str, dict[str, Any]] | None:
    for name in ("exam", "left_out", "train"):
        if evaluation.get(name):
            return name, evaluation[name]
    return None


def _figures(earlier: Earlier, model: Model, evaluation: dict[str, Any]) -> Iterator[tuple[str, Any]]:
    """Figures before and after; those of recordings only where both were judged on the same kind."""
    yield "centers", {"before": earlier.model.n_centers, "after": model.n_centers}
    yield "noise_floor_dph", {"before": earlier.model.noise_floor_dph, "after": model.noise_floor_dph}
    old, new = _judged(earlier.evaluation), _judged(evaluation)
    if old is None or new is None or old[0] != new[0]:
        return
    yield "judged_on", new[0]
    for name in _FIGURES:
        yield name, {"before": old[1]["after"].get(name), "after": new[1]["after"].get(name)}


def _ids(evaluation: dict[str, Any]) -> set[str]:
    return {finding["id"] for finding in evaluation.get("findings", ())}


def _versions(old: dict[str, Any], new: dict[str, Any]) -> Iterator[tuple[str, Any]]:
    """Programs whose version is another."""
    before = old.get("versions", {}) | {"gyrotc": old.get("gyrotc_version")}
    after = new.get("versions", {}) | {"gyrotc": new.get("gyrotc_version")}
    for name in sorted(before.keys() | after.keys()):
        if before.get(name) != after.get(name):
            yield name, {"before": before.get(name), "after": after.get(name)}


def _files(old: dict[str, Any], new: dict[str, Any]) -> dict[str, list[str]]:
    """Emitted files that came, went, or have other bytes."""
    before, after = ({k: v for k, v in m.get("files", {}).items() if k.startswith("c/")} for m in (old, new))
    other = sorted(name for name in before.keys() & after.keys() if before[name] != after[name])
    return _sets(set(before), set(after)) | {"other_bytes": other}
