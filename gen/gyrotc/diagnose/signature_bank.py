"""Signatures of all candidates on the recorded temperatures, as block means, with their inner products in noise."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np
from numpy.typing import NDArray

from ..common.arrays import FloatArray
from ..common.statistics import TOLERANCE
from ..mirror.recursions import play
from .blocks import Records
from .candidates import Candidate, CandidateRole, columns_of, diagnosable_causes, reach_of, searched, testable
from .noise import NOISE_COLOURS, Whitener
from .shapes import late, shapes_of
from .static_map import LEVELS, MapBasis, changed_inputs, fine_columns, make_basis
from .tolerances import MAIN

# In steps of a factor 2.5, over what a day of recordings shows.
_DICTIONARY_LAGS_S = (150.0, 400.0, 1000.0, 2500.0, 6000.0)
_TEXTURE_C, _MODULATING_S = 8.0, 700.0  # of the texture; of the memory that modulates it
DIRECTION_C = 3.0  # width of the play whose side tells the direction: above thermometer noise, far below a cycle
# Norm beside the map from which on a direction of the finer map is one that the map lacks. With weaker ones, what a
# memory leaves would ask for a finer map.
_OWN = 0.1


@dataclass(frozen=True)
class Signature:
    """A candidate and where its columns lie in `SignatureBank.signatures`."""

    candidate: Candidate
    columns: slice


@dataclass(frozen=True)
class Alternative:
    """A shape that no cause has (`shapes.Shape`) and where its columns lie in `SignatureBank.alternatives`."""

    name: str
    parameters: int
    common: bool
    texture: bool
    columns: slice


@dataclass(frozen=True)
class SignatureBank:
    """Everything of the search that does not depend on the block means of the rate.

    Attributes:
        basis, map: The static map and its block means, shape (N, m), orthonormal.
        signatures: Columns of all groups, map projected out, shape (N, K); single columns have norm 1.
        scale: Norm that a column of `signatures` had before, shape (K,).
        on_map: What was taken off the columns, in map functions and over `scale`, shape (m, K).
        groups: Candidates with columns of their own.
        inputs: Candidates that change the map's input.
        replaced: Map of the changed inputs, shape (len(inputs), N, m).
        known: Blocks where the changed inputs are known, shape (len(inputs), N).
        common: From signatures to their principal directions, weighted by how much they share, shape (K, p).
        grams: Inner products of (map, signatures) under each colour, shape (len(NOISE_COLOURS), m + K, m + K).
        log_dets: log det of each colour's covariance, shape (len(NOISE_COLOURS),).
        untestable: Why a cause cannot be tested, by id.
        finer: Functions of the next finer map that this one lacks, shape (N, q).
        alternatives, alternative_groups: Shapes that no cause has, shape (N, Q), columns of norm 1 or groups of
            equal scale.
    """

    basis: MapBasis
    map: FloatArray
    signatures: FloatArray
    scale: FloatArray
    on_map: FloatArray
    groups: tuple[Signature, ...]
    inputs: tuple[Candidate, ...]
    replaced: FloatArray
    known: NDArray[np.bool_]
    common: FloatArray
    grams: FloatArray
    log_dets: FloatArray
    untestable: dict[str, str]
    finer: FloatArray
    alternatives: FloatArray
    alternative_groups: tuple[Alternative, ...]


def build_bank(records: Records, level: int, lead_s: float = 0.0, sigma: FloatArray | None = None) -> SignatureBank:
    """Compute the bank of a map.

    Args:
        records: The runs.
        level: Of `static_map.LEVELS`.
        lead_s: Of the map, as in `static_map.MapBasis`.
        sigma: Factor of the noise of every block, shape (N,); None: even.
    """
    basis, static = make_basis(records, level, lead_s)
    groups, columns, untestable = _columns(records)
    raw = np.column_stack(columns)
    on_map = static.T @ raw
    rest = raw - static @ on_map
    scale = _scale(rest, raw, groups)
    signatures = rest / scale
    inputs, replaced, known = changed_inputs(records, basis)
    grams, log_dets = _grams(records, static, signatures, sigma)
    alternatives, alternative_groups = _alternatives(records)
    return SignatureBank(
        basis=basis,
        map=static,
        signatures=signatures,
        scale=scale,
        on_map=on_map / scale,
        groups=tuple(groups),
        inputs=tuple(inputs),
        replaced=replaced,
        known=known,
        common=_common(signatures),
        grams=grams,
        log_dets=log_dets,
        untestable=untestable,
        finer=_finer(records, static, level, lead_s),
        alternatives=alternatives,
        alternative_groups=alternative_groups,
    )


def _scale(rest: FloatArray, raw: FloatArray, groups: Sequence[Signature]) -> FloatArray:
    """Norm of every column beside the map; one for all columns of a group of random amounts."""
    scale = np.maximum(np.linalg.norm(rest, axis=0), TOLERANCE * np.linalg.norm(raw, axis=0) + 1e-300)
    for group in groups:
        if group.candidate.role == "variance":
            scale[group.columns] = scale[group.columns].max()
    return np.asarray(scale)


def _common(signatures: FloatArray) -> FloatArray:
    """Return the principal directions of signatures, shape (K, p)."""
    _, size, right = np.linalg.svd(signatures, full_matrices=False)
    return np.asarray(right[size > MAIN * size[0]].T)


def _alternatives(records: Records) -> tuple[FloatArray, tuple[Alternative, ...]]:
    """Shapes that no cause has, side by side."""
    columns, groups = [], []
    at = 0
    for shape in shapes_of(records):
        size = np.linalg.norm(shape.columns, axis=0)
        if size.max() <= 0.0:
            continue
        columns.append(shape.columns / (size.max() if shape.common else np.maximum(size, 1e-300)))
        end = at + columns[-1].shape[1]
        groups.append(Alternative(shape.name, shape.parameters, shape.common, shape.texture, slice(at, end)))
        at = end
    return np.column_stack(columns), tuple(groups)


def _grams(
    records: Records, static: FloatArray, signatures: FloatArray, sigma: FloatArray | None
) -> tuple[FloatArray, FloatArray]:
    """Inner products and log determinants under every colour."""
    both = np.column_stack([static, signatures])
    grams, log_dets = [], []
    for colour in NOISE_COLOURS:
        whiten = Whitener(colour, records.kept, records.block_s, sigma)
        white = whiten(both)
        grams.append(white.T @ white)
        log_dets.append(whiten.log_det)
    return np.array(grams), np.array(log_dets)


def _finer(records: Records, static: FloatArray, level: int, lead_s: float) -> FloatArray:
    """Orthonormal functions of the next level that are not in the map."""
    if level + 1 >= len(LEVELS):
        return np.zeros((len(static), 0))
    finer = make_basis(records, level + 1, lead_s)[1]
    left, size, _ = np.linalg.svd(finer - static @ (static.T @ finer), full_matrices=False)
    return np.asarray(left[:, size > _OWN])


def _columns(records: Records) -> tuple[list[Signature], list[FloatArray], dict[str, str]]:
    """Columns of every candidate that adds columns, and of the dictionary of the lack-of-fit test."""
    reach = reach_of(records)
    groups: list[Signature] = []
    columns: list[FloatArray] = []
    untestable: dict[str, str] = {}
    at = 0

    def add(candidate: Candidate, block: FloatArray) -> None:
        nonlocal at
        groups.append(Signature(candidate, slice(at, at + block.shape[1])))
        columns.append(block)
        at += block.shape[1]

    for cause, term in diagnosable_causes().items():
        if term.kind == "input" or term.needs.channel:
            continue
        reason = testable(records, cause)
        if reason:
            untestable[cause] = reason
            continue
        for values in searched(cause).grid(reach):
            if term.kind == "static":
                add(Candidate(cause, {}, "variance"), fine_columns(records))
            else:
                role: CandidateRole = "variance" if term.kind == "random" else "columns"
                add(Candidate(cause, dict(values), role), columns_of(records, cause, values))
    add(Candidate("structure", {}, "structure"), _dictionary(records))
    return groups, columns, untestable


def _dictionary(records: Records) -> FloatArray:
    """Shapes that no cause has, for the lack-of-fit test.

    Memories times T and rectified; texture over T that differs by direction, or that a memory modulates.
    """
    t = records.columns(lambda h: h.temperature_c)
    out = []
    for tau in _DICTIONARY_LAGS_S:
        lag = records.columns(partial(late, tau=tau))
        out += [lag * (t - t.mean()), np.abs(lag)]
    nodes = np.arange(t.min(), t.max() + _TEXTURE_C, _TEXTURE_C)
    texture = np.maximum(0.0, 1.0 - np.abs(t[:, None] - nodes) / _TEXTURE_C)
    memory = records.columns(partial(late, tau=_MODULATING_S))
    out += [*(texture * direction_of(records)[:, None]).T, *(texture * memory[:, None]).T]
    if len(records.runs) < 3:
        out += list(np.eye(len(records.runs)).repeat([k.size for k in records.kept], axis=1))
    return np.column_stack(out)


def direction_of(records: Records) -> FloatArray:
    """Return a play of the temperature less the temperature, C, shape (N,): negative after warming."""
    return records.columns(lambda h: play(DIRECTION_C, h.temperature_c) - h.temperature_c)
