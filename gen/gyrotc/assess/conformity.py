"""Statements of conformity (ILAC-G8:09/2019): a figure with its uncertainty against a limit, by a decision rule.

`guard_band` (4.2.3, non-binary): pass up to the acceptance limit AL = limit - w, conditional pass between AL and the
limit, fail beyond. `guard_band_binary` (4.2.2): pass up to AL, fail beyond. `simple_acceptance` (4.2.1): pass up to
the limit, w = 0. The guard band is w = U: of what passes at most 2.3 % is beyond its limit.
"""

from __future__ import annotations

from collections.abc import Iterable
from statistics import NormalDist

from scipy.special import stdtrit

from ..results.evaluation import FigureUncertainty
from ..results.limits import DecisionRule, Limit, Verdict

__all__ = ["coverage_factor", "decided", "worst_of"]

_NORMAL = NormalDist()
_UPPER = _NORMAL.cdf(2.0)  # 95.45 % lie between -2 and 2 sigma
_ORDER: tuple[Verdict, ...] = ("PASS", "CONDITIONAL PASS", "FAIL")


def coverage_factor(freedom: float | None) -> float:
    """k of 95.45 %: 2, or Student's t where the degrees of freedom are few (JCGM 100:2008, G.3)."""
    return 2.0 if freedom is None else float(stdtrit(freedom, _UPPER))


def decided(
    name: str,
    measured: float | None,
    bound: float,
    sign: float,
    rule: DecisionRule,
    known: FigureUncertainty | str | None,
) -> Limit:
    """Holds an amount with its uncertainty against a limit, by a decision rule.

    Args:
        name: Name of the limit, as in the limits file.
        measured: What was measured, None if it was not.
        bound: The limit.
        sign: 1 for an upper limit, -1 for a lower one.
        rule: The decision rule.
        known: The figure's uncertainty; a text: why it has none; None: it is not known, so that a guard band cannot
            be kept.
    """
    if isinstance(known, str):
        return _bare(name, measured, bound, sign, known)
    if measured is None or known is None:
        one = _bare(name, measured, bound, sign, "not measured" if measured is None else "not known")
        if one.met and rule != "simple_acceptance":
            met = rule == "guard_band"
            return one.model_copy(update={"met": met, "verdict": "CONDITIONAL PASS" if met else "FAIL"})
        return one
    k = coverage_factor(known.freedom)
    expanded = k * known.standard
    band = 0.0 if rule == "simple_acceptance" else expanded
    verdict = _verdict(sign * (bound - measured), band, rule)
    beyond = _NORMAL.cdf(sign * (measured - bound) / known.standard) if known.standard else 0.0
    return Limit(
        limit=name,
        measured=measured,
        bound=bound,
        met=verdict != "FAIL",
        verdict=verdict,
        standard_uncertainty=known.standard,
        degrees_of_freedom=known.freedom,
        coverage_factor=k,
        expanded_uncertainty=expanded,
        guard_band=band,
        acceptance_limit=bound - sign * band,
        false_acceptance=beyond if verdict != "FAIL" else None,
        uncertainty_from=known.method,
    )


def _bare(name: str, measured: float | None, bound: float, sign: float, why: str) -> Limit:
    met = measured is not None and sign * (bound - measured) >= 0.0
    return Limit(
        limit=name,
        measured=measured,
        bound=bound,
        met=met,
        verdict="PASS" if met else "FAIL",
        uncertainty_from=why,
    )


def _verdict(room: float, band: float, rule: DecisionRule) -> Verdict:
    if room < 0.0:
        return "FAIL"
    if room >= band:
        return "PASS"
    return "CONDITIONAL PASS" if rule == "guard_band" else "FAIL"


def worst_of(verdicts: Iterable[Verdict | None]) -> Verdict | None:
    """The gravest of several verdicts; None where there is none: nothing was judged."""
    return max((v for v in verdicts if v), key=_ORDER.index, default=None)
