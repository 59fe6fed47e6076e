"""All columns that a search knows, side by side.

The order is: static map, signatures of the bank, auxiliary channels, changed inputs, what stands beside the map in
every model. `JoinedLayout` is the only place that knows it.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import accumulate, pairwise
from typing import Literal

import numpy as np

from ..common.arrays import FloatArray, IntArray
from ..common.statistics import TOLERANCE
from .candidates import Candidate
from .scores import ScoredColumns
from .signature_bank import SignatureBank

Channels = tuple[FloatArray, list[Candidate]]
"""Columns of the auxiliary channels, shape (N, c), and their candidates."""
Held = Literal["map", "map and beside", "beside"]
"""What a model holds before any candidate is added; "beside" alone where the map's input is replaced."""


@dataclass(frozen=True, slots=True)
class JoinedLayout:
    """Places of each kind of column among the joined columns."""

    static: slice
    signatures: slice
    channels: slice
    inputs: slice
    beside: slice

    @classmethod
    def of(cls, static: int, signatures: int, channels: int, inputs: int, beside: int) -> JoinedLayout:
        """Make the layout from the number of columns of each kind."""
        ends = accumulate((0, static, signatures, channels, inputs, beside))
        return cls(*(slice(a, b) for a, b in pairwise(ends)))

    @property
    def total(self) -> int:
        """Number of joined columns."""
        return int(self.beside.stop)

    def held(self, what: Held) -> IntArray:
        """Numbers of the columns that a model holds."""
        parts = {
            "map": (self.static,),
            "beside": (self.beside,),
            "map and beside": (self.static, self.beside),
        }
        return np.concatenate([np.arange(part.start, part.stop) for part in parts[what]])


@dataclass(frozen=True)
class Joined:
    """The joined columns without those of the bank, and what the candidates among them are.

    Attributes:
        layout: Where each kind stands.
        channels, inputs: Less what the map explains, norm 1, shapes (N, c) and (N, i).
        beside: In every model beside the map, norm 1, shape (N, b).
        on_map: What the map explains of channels and inputs, in map functions, over `norm`, shape (m, c + i).
        norm: Norm that channels and inputs had less the map; infinite where the map explains all, shape (c + i,).
        added: Candidates of channels and inputs, in this order.
        columns: Which joined columns belong together.
        owners: Candidates in the order of `NegativeLogScores`.
    """

    layout: JoinedLayout
    channels: FloatArray
    inputs: FloatArray
    beside: FloatArray
    on_map: FloatArray
    norm: FloatArray
    added: tuple[Candidate, ...]
    columns: ScoredColumns
    owners: tuple[Candidate, ...]

    @property
    def outside(self) -> FloatArray:
        """All columns that are not in the bank, shape (N, c + i + b)."""
        return np.column_stack([self.channels, self.inputs, self.beside])


def join(bank: SignatureBank, y: FloatArray, channels: Channels | None, beside: FloatArray | None) -> Joined:
    """Join the bank, shape (N, ...), with channels, changed inputs and the columns beside the map."""
    none = np.zeros((y.size, 0))
    own, names = channels if channels is not None else (none, [])
    held = beside if beside is not None else none
    columns = np.column_stack([own, *_changes(bank, y)])
    on_map = bank.map.T @ columns
    rest = columns - bank.map @ on_map
    norm = np.linalg.norm(rest, axis=0)
    norm = np.where(norm > TOLERANCE * np.linalg.norm(columns, axis=0) + 1e-300, norm, np.inf)
    length = np.linalg.norm(held, axis=0)
    layout = JoinedLayout.of(bank.map.shape[1], bank.signatures.shape[1], own.shape[1], len(bank.inputs), held.shape[1])
    added = (*names, *bank.inputs)
    order, owners = _candidates(bank, layout, added)
    return Joined(
        layout,
        (rest / norm)[:, : own.shape[1]],
        (rest / norm)[:, own.shape[1] :],
        held / np.where(length > 0.0, length, 1.0),
        on_map / norm,
        norm,
        added,
        order,
        owners,
    )


def _changes(bank: SignatureBank, y: FloatArray) -> list[FloatArray]:
    """Return the change of the fitted map by every changed input, 0 where it is not known."""
    weights = bank.map.T @ y
    moved = [replaced @ weights - bank.map @ weights for replaced in bank.replaced]
    return [np.where(known, change, 0.0) for known, change in zip(bank.known, moved, strict=True)]


def _candidates(
    bank: SignatureBank, layout: JoinedLayout, added: tuple[Candidate, ...]
) -> tuple[ScoredColumns, tuple[Candidate, ...]]:
    """Return the places of single columns, pairs and groups of one variance, and their candidates."""
    single: list[tuple[int, Candidate]] = []
    pairs: list[tuple[IntArray, Candidate]] = []
    variance: list[tuple[IntArray, Candidate]] = []
    for signature in bank.groups:
        at = np.arange(signature.columns.start, signature.columns.stop) + layout.signatures.start
        candidate = signature.candidate
        if candidate.role == "columns" and at.size == 1:
            single.append((int(at[0]), candidate))
        elif candidate.role == "columns":
            pairs.append((at, candidate))
        elif candidate.role == "variance":
            variance.append((at, candidate))
    single += list(enumerate(added, start=layout.channels.start))
    columns = ScoredColumns(
        np.array([at for at, _ in single]),
        np.array([at for at, _ in pairs], dtype=np.int64).reshape(-1, 2),
        tuple(at for at, _ in variance),
    )
    owners = [candidate for _, candidate in (*single, *pairs, *variance)]
    return columns, (*owners, Candidate("structure", {}, "structure"))
