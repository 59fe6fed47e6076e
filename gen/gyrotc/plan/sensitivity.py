"""What any choice of the planned runs can see: detection limits, and how well it determines the map.

Everything follows from whitened inner products of map and signatures, one matrix for each run: those of a
choice of runs are their sum.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from ..common.arrays import FloatArray
from ..diagnose.cache import bank_of
from ..diagnose.candidates import Candidate, planned
from ..diagnose.colours import COLOURS, Colour
from ..diagnose.detection_limits import CauseLimit, amplitude_energy, limit_of
from ..diagnose.search import Search, open_search
from ..diagnose.signature_bank import SignatureBank
from ..diagnose.whitener import Whitener
from .programme import Programme

__all__ = ["Sensitivity"]


_RIDGE = 1e-9  # of the strongest map function: what a choice of runs does not visit stays undetermined


class Sensitivity:
    """Inner products of everything for every run of a programme.

    Attributes:
        search: The search that these runs will have, without noise in its data; its noise scale is the declared.
        sigma: Standard deviation of the white part of block means, deg/h.
    """

    def __init__(self, programme: Programme) -> None:
        self.programme = programme
        records = programme.records
        colour = programme.declared.colour(records.block_s)
        self.sigma = float(np.sqrt(colour.white))
        relative = _scaled(colour, 1.0 / colour.white)
        self.bank: SignatureBank = bank_of(records, 0)
        search = open_search(records, self.bank, records.target(), declared=relative, colours=(len(COLOURS),))
        self.search = replace(search, views={search.best: replace(search.likeliest, scale=self.sigma)})
        self.candidates, columns, self.at = _columns(self.search)
        whiten = Whitener(relative, records.kept, records.block_s)
        white = whiten(np.column_stack([self.bank.map, columns])) / self.sigma
        self.grams = np.array([white[s].T @ white[s] for s in records.spans()])

    def limits(self, runs: Sequence[int] | None = None) -> dict[str, CauseLimit]:
        """Detection limits of every cause for a choice of runs (with repetitions; None: all, once)."""
        energy = self._energies(range(len(self.grams)) if runs is None else runs)
        points: dict[str, list[tuple[Candidate, float]]] = {}
        for candidate, at in zip(self.candidates, self.at, strict=True):
            part = energy[at]
            amount = amplitude_energy(candidate.id, part)
            points.setdefault(candidate.id, []).append((candidate, max(amount, 0.0)))
        return {id: limit_of(id, p) for id, p in points.items()}

    def _energies(self, runs: Sequence[int]) -> FloatArray:
        """d² of every column at unit amplitude after the map is taken out, shape (K,)."""
        gram = self._gram(runs)
        m = self.bank.map.shape[1]
        inner, cross = gram[:m, :m], gram[:m, m:]
        held = np.linalg.solve(inner + _RIDGE * np.diag(inner).max() * np.eye(m), cross)
        return np.asarray(np.diag(gram)[m:] - (cross * held).sum(axis=0))

    def _gram(self, runs: Sequence[int]) -> FloatArray:
        return np.asarray(self.grams[list(runs)].sum(axis=0))

    def map_error(self, runs: Sequence[int]) -> float:
        """RMS error of the map over all planned temperatures and rates, fitted to a choice of runs, deg/h.

        What these do not determine is as uncertain as the simulated bias is wide.
        """
        m = self.bank.map.shape[1]
        y = self.search.y
        prior = y.size * float(np.var(y)) / m
        spread = np.linalg.inv(self._gram(runs)[:m, :m] + np.eye(m) / prior)
        return float(np.sqrt(np.trace(spread) / y.size))


def _scaled(colour: Colour, factor: float) -> Colour:
    return Colour(
        white=colour.white * factor,
        slow=colour.slow * factor,
        tau_s=colour.tau_s,
        walk=colour.walk * factor,
        quantum=colour.quantum * factor,
    )


def _columns(search: Search) -> tuple[list[Candidate], FloatArray, list[slice]]:
    """Signatures at unit amplitude (for changed inputs: the change of the map), and where each candidate's lie."""
    bank = search.bank
    raw = bank.signatures * bank.scale + bank.map @ (bank.on_map * bank.scale)
    candidates, blocks, at = [], [], []
    start = 0
    for group in bank.groups:
        if group.candidate.id not in planned():
            continue
        block = raw[:, group.columns]
        candidates.append(group.candidate)
        blocks.append(block)
        at.append(slice(start, start + block.shape[1]))
        start += block.shape[1]
    weights = search.map_weights()
    for candidate, replaced, known in zip(bank.inputs, bank.replaced, bank.known, strict=True):
        candidates.append(candidate)
        blocks.append(np.where(known, (replaced - bank.map) @ weights, 0.0)[:, None])
        at.append(slice(start, start + 1))
        start += 1
    return candidates, np.column_stack(blocks), at
