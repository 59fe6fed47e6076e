"""Which causes a programme can tell apart, from its temperatures alone, and which further run would help.

d from which A can be told from B: √(10/(1 − R²)), R² the share of A's signature that B can mimic beside the
map (docs/diagnosis.md).
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ..common.arrays import FloatArray
from ..common.errors import InputError
from ..common.orthonormal import orthonormal
from ..diagnose.blocks import singled_out
from ..diagnose.candidates import Candidate, columns_of, planned, searched, shape_parameter
from ..diagnose.gains import Gains
from ..simulate.campaign import Noise
from .programme import library, programme_of
from .sensitivity import Sensitivity

__all__ = ["Row", "additions", "separability"]


_D_LIMIT = 6.0  # about where most causes are found (`terms.search.SearchRule.needed_d`)
_LEAST = 1e-3  # 1 − R² below which nothing tells the two apart


@dataclass(frozen=True)
class Row:
    """A cause at one value of its parameter, and d from which it can be told from every other cause."""

    id: str
    parameter: str | None
    value: float | None
    d: dict[str, float]


def separability(sensitivity: Sensitivity, only: Sequence[str] | None = None) -> list[Row]:
    """A row for every cause that these runs can test (`only`: for these)."""
    gains = Gains(sensitivity.search)
    shown = [c for c in _shown(sensitivity) if only is None or c.id in only]
    total = gains.whiten(np.column_stack([_fitted(sensitivity, c, gains) for c in shown]))
    static = gains.whiten(_static(sensitivity))[:, None]
    added = total - static
    own = added - gains.map_q @ (gains.map_q.T @ added)
    energy = (own**2).sum(axis=0)
    best: list[dict[str, float]] = [{} for _ in shown]
    for id, share in (*_by_columns(gains, own, energy), *_by_inputs(gains, total, energy)):
        for k in range(len(shown)):
            best[k][id] = max(best[k].get(id, 0.0), float(share[k]))
    rows = []
    for candidate, shares in zip(shown, best, strict=True):
        parameter = shape_parameter(candidate.id)
        rows.append(
            Row(
                candidate.id,
                parameter.name if parameter else None,
                candidate.values[parameter.name] if parameter else None,
                {
                    i: float(np.sqrt(10.0 / max(1.0 - s, _LEAST)))
                    for i, s in shares.items()
                    if i != candidate.id
                },
            )
        )
    return rows


def _shown(sensitivity: Sensitivity) -> Iterator[Candidate]:
    """Candidates of the search nearest to the values shown."""
    for id in planned():
        same = [c for c in sensitivity.candidates if c.id == id]
        parameter = shape_parameter(id)
        if parameter is None:
            yield from same[:1]
            continue
        for value in searched(id).shown if same else ():
            yield min(same, key=lambda c: abs(c.values[parameter.name] - value))


def _fitted(sensitivity: Sensitivity, candidate: Candidate, gains: Gains) -> FloatArray:
    """Map of the simulated gyro with the cause at d = 6, shape (N,); a changed input as it is."""
    search = sensitivity.search
    if candidate.role == "input":
        replaced = search.bank.replaced[search.bank.inputs.index(candidate)]
        return np.asarray(replaced @ search.map_weights())
    columns = columns_of(search.records, candidate.id, candidate.values)
    signature = columns @ np.random.default_rng(1).standard_normal(columns.shape[1])
    white = gains.whiten(signature)
    own = white - gains.map_q @ (gains.map_q.T @ white)
    return np.asarray(_static(sensitivity) + signature * (_D_LIMIT * gains.scale / np.linalg.norm(own)))


def _static(sensitivity: Sensitivity) -> FloatArray:
    """The simulated gyro's map as the search's own map holds it, shape (N,)."""
    search = sensitivity.search
    return np.asarray(search.bank.map @ search.map_weights())


def _by_columns(gains: Gains, own: FloatArray, energy: FloatArray) -> Iterator[tuple[str, FloatArray]]:
    """Share of each signature that every candidate with columns of its own holds."""
    for candidate, at in (*gains.plain, *gains.random):
        q = orthonormal(gains.plain_columns(at))
        yield candidate.id, ((q.T @ own) ** 2).sum(axis=0) / energy


def _by_inputs(gains: Gains, total: FloatArray, energy: FloatArray) -> Iterator[tuple[str, FloatArray]]:
    """The same for the map of other inputs."""
    bank = gains.search.bank
    seen: Counter[str] = Counter()
    for candidate, replaced, known in zip(bank.inputs, bank.replaced, bank.known, strict=True):
        seen[candidate.id] += 1
        if seen[candidate.id] % searched(candidate.id).rival_every:
            continue
        unknown = [] if known.all() else [gains.whiten(singled_out(~known))]
        q = orthonormal(gains.whiten(replaced), *unknown)
        rest = (total**2).sum(axis=0) - ((q.T @ total) ** 2).sum(axis=0)
        yield candidate.id, np.maximum(1.0 - rest / energy, 0.0)


def additions(
    scenario: str | Path, pair: tuple[str, str], *, noise: Noise, seed: int
) -> list[tuple[str, float, float]]:
    """Profiles by how far one run more of them brings the d at which two causes part, best first.

    Returns:
        Name, hours of the run, and the larger d of the two directions; the first entry is the programme as it
        is, named "".

    Raises:
        InputError: A cause has no row in the table of separability.
    """
    for id in pair:
        if id not in planned():
            raise InputError("--separate", repr(id), ", ".join(planned()))
    found = []
    for name in ("", *library(scenario)):
        programme = programme_of(scenario, noise=noise, seed=seed, added=[name] if name else [])
        rows = separability(Sensitivity(programme), only=pair)
        d = [r.d[o] for r in rows for o in pair if o != r.id and o in r.d]
        if d:
            found.append((name, programme.hours[-1] if name else 0.0, max(d)))
    return [*found[:1], *sorted(found[1:], key=lambda entry: entry[2])]
