"""Overtones of a wave over T: what reflects more than once makes waves that are no sines (Airy 1833).

They are looked for beside the wave itself and any smooth map (`train.bumps`), the second and then the third, each where
BIC asks for it; nothing of them has a part in naming the cause.
"""

from __future__ import annotations

import numpy as np

from ..causes.base import Cause, History, Values
from ..common.arrays import FloatArray
from ..train.bumps import BesideSmooth, beside_smooth
from ..train.data import TrainingData, scaling_of

__all__ = ["overtones_of"]


_NUMBERS = (2, 3)  # of the overtones: with the wave itself they leave a term of four to something else
_PARAMETERS = 2  # of an overtone: sine and cosine


def overtones_of(data: TrainingData, term: Cause, values: Values) -> tuple[dict[str, float], ...]:
    """Parameters of each overtone that the samples ask for; none of a cause that has none.

    Args:
        data: Cleaned samples without what other causes add.
        term: The cause.
        values: Its parameters.

    Raises:
        TrainingFailed: The evidence process, which says what the noise is, cannot be solved.
    """
    beside = None if term.overtone is None else beside_smooth(data, scaling_of(data))
    if beside is None or term.overtone is None or term.amplitudes is None:
        return ()
    able = [dict(term.overtone(values, number)) for number in _NUMBERS]
    columns = [_columns(beside, term, values)]
    taken: list[dict[str, float]] = []
    for own in able:
        more = _columns(beside, term, own)
        if _energy(beside, [*columns, more]) - _energy(beside, columns) > beside.price(_PARAMETERS):
            columns.append(more)
            taken.append(own)
    weights = np.asarray(np.linalg.lstsq(np.column_stack(columns), beside.y, rcond=1e-9)[0], dtype=np.float64)
    found, at = [], columns[0].shape[1]
    for own, column in zip(taken, columns[1:], strict=True):
        found.append({**own, **term.amplitudes(weights[at : at + column.shape[1]])})
        at += column.shape[1]
    return tuple(found)


def _columns(beside: BesideSmooth, term: Cause, values: Values) -> FloatArray:
    assert term.features is not None
    history = History(time_s=np.arange(beside.t.size, dtype=np.float64), temperature_c=beside.t)
    return beside.rest(term.features(history, values).columns * beside.root[:, None])


def _energy(beside: BesideSmooth, columns: list[FloatArray]) -> float:
    q = np.linalg.qr(np.column_stack(columns))[0]
    return float(((q.T @ beside.y) ** 2).sum())
