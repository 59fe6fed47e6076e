"""What is left of all columns and of the data once a model is projected out: algebra on a view's inner products."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..common.arrays import FloatArray
from .joined import Held
from .scores import Projection
from .search import Search
from .views import View

__all__ = ["project"]


_RANK = 1e-10  # eigenvalues of inner products below this share of the largest are rounding


def project(search: Search, view: View, held: Held) -> Projection:
    """Everything after the columns of a model are projected out, under the colour of a view.

    Where the map itself is not among them (its input is replaced), candidates get back what the map had taken of
    them, and other inputs are no candidates any more.
    """
    out = search.joined.layout.held(held)
    if held != "beside":
        return _project(search, view, view.gram, view.b, out)
    mix = _without_map(search, len(view.gram))
    return _project(search, view, mix.T @ view.gram @ mix, mix.T @ view.b, out)


def _without_map(search: Search, total: int) -> FloatArray:
    """From the joined columns to those of a model without the map, shape (P, P)."""
    joined = search.joined
    layout = joined.layout
    mix = np.eye(total)
    mix[layout.static, layout.signatures] = search.bank.on_map
    mix[layout.static, layout.channels] = joined.on_map[:, : joined.channels.shape[1]]
    mix[layout.inputs, layout.inputs] = 0.0
    return mix


def _project(
    search: Search, view: View, full: FloatArray, b: FloatArray, out: NDArray[np.int64]
) -> Projection:
    size, vectors = np.linalg.eigh(full[np.ix_(out, out)])
    keep = size > _RANK * size[-1]
    half = vectors[:, keep] / np.sqrt(size[keep])
    cross = half.T @ full[out]
    taken = half.T @ b[out]
    common = np.zeros((len(full), search.bank.common.shape[1]))
    common[search.joined.layout.signatures] = search.bank.common
    return Projection(
        a=(b - cross.T @ taken) / view.scale,
        gram=full - cross.T @ cross,
        before=np.maximum(np.diag(full), 1e-12),
        common=common,
        rest=view.yy - float(taken @ taken),
        log_det=view.log_det + float(np.log(size[keep]).sum()),
        rank=int(keep.sum()),
    )
