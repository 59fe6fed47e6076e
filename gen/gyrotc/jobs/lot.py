"""`gyrotc lot`: from the folder of a fleet to what its units share."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from .. import __version__
from ..common.arrays import FloatArray
from ..common.errors import InputError
from ..common.progress import Progress, silent
from ..common.threads import with_one_thread
from ..model import Model, load_model
from ..results.base import read_optional, read_result
from ..results.fleet import AtRest, CrossValidation, FleetSummary, Lot, LotCluster, LotUnit
from ..results.json_text import digest_of
from ..results.marker import check_intact
from ..results.training import Training
from ..train.prior.learn import LEAST_UNITS, Envelope, Learned, fold_count, learn_prior
from ..train.prior.unit_means import UnitMeans, means_of
from ..train.prior.use import file_numbers, prior_of, process_result
from ..train.process import MEAN_S

_CELLS = (33, 13)  # of the occupancy: as fine as the coverage of a table; odd, so that rest has cells of its own
_CURVE = 21  # points of the lot to be read


@dataclass(frozen=True, slots=True)
class CalibratedUnit:
    """A fully calibrated unit of a fleet: what a lot needs of its `training.json`, which is large.

    Attributes:
        model: Its model.
        means: Of its training runs.
        mean_s: Their length, s.
        by_itself: It was calibrated without a lot or an earlier model.
    """

    model: Model
    means: UnitMeans
    mean_s: float
    by_itself: bool


def load_lot(path: Path) -> Lot:
    """Read a lot and check its checksum.

    Raises:
        InputError: It is no lot, or was changed since gyrotc wrote it.
    """
    if not path.exists():
        raise InputError(f"--lot {path}", "does not exist", "the file that gyrotc lot wrote")
    lot = read_result(path, Lot)
    if lot.checksum != checksum_of(lot):
        found = "is not that of the other fields: the file was changed or damaged"
        raise InputError(f"{path}, field checksum", found, "the file as gyrotc wrote it")
    prior_of(lot, str(path))
    return lot


def checksum_of(lot: Lot) -> str:
    """SHA-256 of the canonical form without its checksum."""
    return digest_of({key: value for key, value in lot.content().items() if key != "checksum"})


@with_one_thread
def lot_of(fleet: Path, *, axis: str | None = None, progress: Progress = silent) -> Lot:
    """Learn a lot from the folder that `gyrotc fleet` (or several calls of `build`) wrote.

    Args:
        axis: Axis of three-axis gyros: each axis is a lot of its own.
        progress: Takes note of every stage.

    Raises:
        InputError: Fewer than three units, or units of several axes and none is named.
    """
    units, left_out = calibrated_units(fleet, axis)
    means, envelope = [u.means for u in units], _envelope([u.model for u in units])
    found = learn_prior(means, envelope, progress)
    kept = [u for u, inside in zip(units, found.inside, strict=True) if inside]
    names = [(u.model.serial, u.model.hash) for u in units]
    return lot_from(
        names,
        means,
        found,
        envelope,
        axis=units[0].model.axis,
        mean_s=float(np.median([u.mean_s for u in kept])),
        between_dph=float(np.sqrt(np.mean([u.model.between_dph**2 for u in kept]))),
        left_out=left_out,
    )


def calibrated_units(fleet: Path, axis: str | None) -> tuple[list[CalibratedUnit], str]:
    """Return the units of one axis in the order of their folders, and how many others were left out and why."""
    if not fleet.is_dir():
        raise InputError(str(fleet), "is no folder", "what gyrotc fleet wrote")
    summary = read_optional(fleet / "fleet.json", FleetSummary)
    folders = sorted(p.parent for p in fleet.glob("*/training.json"))
    listed = {unit.name: unit for unit in summary.serials} if summary else None
    places = [place for place in folders if listed is None or place.name in listed]
    units = [calibrated_unit(place) for place in places if not (listed and listed[place.name].barred)]
    axes = sorted({str(u.model.axis) for u in units if u.model.axis})
    if axis is None and axes:
        raise InputError("--axis", f"units of the axes {', '.join(axes)}", "one of them: each is a lot of its own")
    of_axis = [u for u in units if u.model.axis == axis]
    chosen = [u for u in of_axis if u.by_itself]
    distinct = {u.model.serial: u for u in chosen}
    counts = {
        "not in fleet.json": len(folders) - len(places),
        "barred by a finding of the fleet": len(places) - len(units),
        "of another axis": len(units) - len(of_axis),
        "calibrated with a lot or an earlier model": len(of_axis) - len(chosen),
        "with the serial of another folder": len(chosen) - len(distinct),
    }
    left_out = ", ".join(f"{count} {reason}" for reason, count in counts.items() if count)
    if len(distinct) < LEAST_UNITS:
        found = f"{len(distinct)} calibrated units" + (f", {left_out}" if left_out else "")
        raise InputError(str(fleet), found, f"{LEAST_UNITS} at least")
    return [*distinct.values()], left_out


def calibrated_unit(place: Path) -> CalibratedUnit:
    """Return what a lot learns from the result of a unit.

    Raises:
        InputError: A file was changed, is missing, or does not say enough.
    """
    check_intact(place, ("training.json", "model.json"), needed=False)
    where, model = place / "training.json", load_model(place / "model.json")
    training = read_result(where, Training)
    means = means_of(training.means, where)
    assert training.means is not None  # else it is refused
    return CalibratedUnit(model, means, training.means.mean_s, training.lot is None and training.prior is None)


def _envelope(models: Sequence[Model]) -> Envelope:
    """Return the envelope of all units."""
    t = np.array([m.envelope.temperature_c for m in models])
    r = np.array([m.envelope.slope_c_per_min for m in models])
    return (float(t.min()), float(t.max())), (float(r.min()), float(r.max()))


def lot_from(
    names: Sequence[tuple[str, str]],
    units: Sequence[UnitMeans],
    found: Learned,
    envelope: Envelope,
    *,
    axis: str | None = None,
    mean_s: float = MEAN_S,
    between_dph: float = 0.0,
    left_out: str = "",
) -> Lot:
    """The file of a lot that was learnt.

    Args:
        names: Serial and hash of the model of each unit.
        units: What it was learnt from.
        found: What was learnt.
        envelope: Ranges of T (C) and dT/dt (C/min).
        axis: Of the gyros.
        mean_s: Length of the means behind `units`, s.
        between_dph: Standard deviation of the constant from power-on to power-on, deg/h.
        left_out: How many units of the folder the lot was not learnt from, and why; empty: it was from all.
    """
    state, cluster = found.state, iter(found.state.cluster.tolist())
    inside = [u for u, kept in zip(units, found.inside, strict=True) if kept]
    lot = Lot(
        gyrotc_version=__version__,
        axis=axis,
        units=tuple(
            LotUnit(serial=serial, model_hash=model_hash, cluster=next(cluster) if kept else None, p_value=float(p))
            for (serial, model_hash), kept, p in zip(names, found.inside, found.p_values, strict=True)
        ),
        text=_in_words(names, found) + (f"; left out: {left_out}" if left_out else ""),
        temperature_c=envelope[0],
        slope_c_per_min=envelope[1],
        occupancy=tuple(file_numbers(row) for row in _occupancy(inside, envelope)),
        center_dph=found.center_dph,
        unit_dph=found.unit_dph,
        functions=state.basis.result(),
        clusters=tuple(
            LotCluster(
                units=int(n), mean=file_numbers(m), covariance=tuple(file_numbers(r[: k + 1]) for k, r in enumerate(c))
            )
            for n, m, c in zip(np.bincount(state.cluster), state.means, state.covariances, strict=True)
        ),
        directions=tuple(file_numbers(d) for d in state.directions.T),
        rest=process_result(state.rest),
        of_mean=process_result(state.of_mean),
        noise_dph=float(np.median([u.sigma_dph for u in inside])),
        mean_s=mean_s,
        between_dph=between_dph,
        cross_validation=CrossValidation(
            folds=fold_count(len(inside)),
            spread_scale=found.scale,
            left_rms_dph=found.left_out_dph[0],
            constant_rms_dph=found.left_out_dph[1],
        ),
        at_rest=AtRest(temperature_c=(), mean_dph=(), spread_dph=()),
        checksum="",
    )
    lot = lot.model_copy(update={"at_rest": _at_rest(lot)})
    return lot.model_copy(update={"checksum": checksum_of(lot)})


def _occupancy(units: Sequence[UnitMeans], envelope: Envelope) -> FloatArray:
    """Share of time in cells of the envelope; every unit counts the same."""
    edges = [np.linspace(low, max(high, low + 1e-9), n + 1) for (low, high), n in zip(envelope, _CELLS, strict=True)]
    total = np.zeros(_CELLS)
    for u in units:
        at = [np.clip(x, e[0], e[-1]) for x, e in zip((u.temperature_c, u.slope_c_per_min), edges, strict=True)]
        total += np.histogram2d(at[0], at[1], bins=edges, weights=u.count / u.count.sum())[0]
    return np.asarray(total.T / len(units))


def _at_rest(lot: Lot) -> AtRest:
    """The first cluster where temperature stands still, and how far a new unit may be from it."""
    prior = prior_of(lot)
    t = np.linspace(*lot.temperature_c, _CURVE)
    values = prior.basis.values(t, np.zeros(_CURVE))
    spread = np.sqrt(np.sum((values @ prior.covariances[0]) * values, axis=1))
    return AtRest(
        temperature_c=file_numbers(t),
        mean_dph=file_numbers(lot.center_dph + lot.unit_dph * (values @ prior.means[0])),
        spread_dph=file_numbers(lot.unit_dph * spread),
    )


def _in_words(names: Sequence[tuple[str, str]], found: Learned) -> str:
    """Return a summary of the lot in words."""
    left, alone = found.left_out_dph
    size = np.bincount(found.state.cluster)
    if alone > 0.0 and left < alone:
        shared = f"the mean map explains {1.0 - (left / alone) ** 2:.0%} of what a unit's own mean leaves"
    else:
        shared = "no family: the mean map explains nothing that a unit's own mean does not"
    text = f"{int(found.inside.sum())} units, {found.state.rank} directions; {shared}"
    if len(size) > 1:
        text += f"; {len(size)} clusters of {', '.join(map(str, size))} units"
    outliers = [name for (name, _), kept in zip(names, found.inside, strict=True) if not kept]
    return text + (f"; excluded as outliers: {', '.join(outliers)}" if outliers else "")
