"""Run the stages of `gyrotc diagnose` before the extension: screen, search, attribute, compare with the simulation."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from ..common.arrays import FloatArray
from ..common.progress import Progress, silent
from .attribution import Attribution, attribute
from .blocks import Records
from .candidates import diagnosable_causes, searched
from .detection import CauseLimit, detection_limits
from .discrepancy import Ensemble, NoiseFinding, ensemble_of, noise_findings
from .map_choice import search_of
from .noise import Colour, Declared
from .overlap import overlap
from .profile_likelihood import Gains
from .refinement import Refined
from .screens import screen
from .search import Search


@dataclass(frozen=True)
class Analysis:
    """Everything that is known before an extension is made.

    The search is not part of it: its inner products, and the rows that an extension reads, need not fit into memory
    together.

    Attributes:
        records: Training runs.
        static: Block means of the functions of the static map, shape (N, m), orthonormal.
        untestable: Why a cause cannot be tested, by id.
        attribution: What was found.
        noise: Findings of the family `noise`, from screens and from the declaration.
        limits: Detection limits by cause.
        separations: For every cause found, d from which it can be distinguished from each rival.
        ensemble: Measured against simulated residuals.
        colour, scale: The likeliest noise with the causes found taken out, and its factor.
        extended: Measured against simulated residuals when the simulation has causes and noise as found; None
            if nothing was.
    """

    records: Records
    static: FloatArray
    untestable: dict[str, str]
    attribution: Attribution
    noise: tuple[NoiseFinding, ...]
    limits: dict[str, CauseLimit]
    separations: tuple[dict[str, float], ...]
    ensemble: Ensemble
    colour: Colour
    scale: float
    extended: Ensemble | None

    def left_dph(self, *, named: bool) -> FloatArray:
        """Return the residual of the map, or of map and causes if `named`, deg/h, shape (N,).

        It is scaled up to the size of the noise, of which map and causes have taken a part. Causes without a name are
        no finding: another length of a block finds others, which take a quarter more or less.
        """
        fitted = self.extended if named and self.extended is not None else self.ensemble
        return np.asarray(fitted.residual * np.sqrt(fitted.residual.size / max(fitted.freedom, 1)))


def analyse(records: Records, declared: Declared | None, say: Progress = silent) -> Analysis:
    """Run all stages from the records to the named causes."""
    say("screening")
    screened = screen(records)
    search = search_of(records, declared, screened, say)
    search = replace(search, cautious=bool(noise_findings(search, declared, causes=True)))
    say("searching for causes")
    attribution = attribute(search)
    say("comparing with the simulation")
    after = search.extended(attribution.columns) if attribution.causes else search
    causes = bool(attribution.causes) or attribution.detected
    noise = (*screened.findings, *noise_findings(after, declared, causes=causes))
    return Analysis(
        records=records,
        static=search.bank.map,
        untestable=search.bank.untestable,
        attribution=attribution,
        noise=noise,
        limits=detection_limits(search),
        separations=_separations(search, attribution.causes),
        ensemble=ensemble_of(search, declared),
        colour=after.likeliest.colour,
        scale=after.likeliest.scale,
        extended=_extended(after, attribution, noise, declared),
    )


def _extended(
    after: Search, attribution: Attribution, noise: Sequence[NoiseFinding], declared: Declared | None
) -> Ensemble | None:
    """Measured against simulated residuals when the simulation has what was found."""
    refuted = any(n.id in ("noise_level", "noise_colour") for n in noise)
    if not attribution.causes and not refuted:
        return None
    beside = attribution.columns if attribution.causes else None
    return ensemble_of(after, declared, beside=beside, estimated=refuted)


def _separations(search: Search, causes: Sequence[Refined]) -> tuple[dict[str, float], ...]:
    """Return for every cause the d from which it can be distinguished from each that imitates it."""
    if not causes:
        return ()
    gains, imitators = Gains(search), [id for id in diagnosable_causes() if searched(id).imitates]
    return tuple(overlap(gains, cause, [id for id in imitators if id != cause.candidate.id]) for cause in causes)
