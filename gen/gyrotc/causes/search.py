"""How diagnosis looks for a cause: over which values of its parameter, and at what price."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from .base import Parameter

__all__ = ["Reach", "SearchRule", "SingleCycle", "anywhere", "geometric"]


@dataclass(frozen=True, slots=True)
class Reach:
    """What recordings can show: the range of their temperatures, C, and the length of the longest run, s."""

    span_c: float
    longest_s: float

    def most(self, unit: str) -> float:
        """The largest time constant (s) or width (C) of a memory that they can show.

        Half a run: what is slower has not come to rest in it. 0.45 of the range of temperature: a play that
        is wider hardly moves.
        """
        return 0.45 * self.span_c if unit == "C" else 0.5 * self.longest_s


@dataclass(frozen=True, slots=True)
class SingleCycle:
    """How a memory is looked for in a single chamber cycle.

    Attributes:
        points: How many the grid over its parameter has.
        usual: Every package has such a memory: it is preferred to one that does as well and that few have.
    """

    points: int
    usual: bool


@dataclass(frozen=True, slots=True)
class SearchRule:
    """How diagnosis looks for a cause.

    Attributes:
        price: Free parameters that it adds to the model: its share of the information criterion.
        grid: Values of the nonlinear parameters: less than 1 % of a signature's energy falls between two points.
        over: The parameter that is refined between the points of the grid; None: it has none.
        needed_d: Signal-to-noise ratio that is found in 95 % of cases at a familywise level of 1 % (docs/diagnosis.md).
        width: About one point of the grid at a value of the parameter, for recordings that span some C.
        step: Step of the derivative to the parameter, in its unit; None: 2 % of its value.
        twice: It may be there twice, with parameters far apart.
        imitates: Whether a cause that is found is compared with it: from which d the two can be told apart.
        planned: Whether a profile without rates says anything of it.
        shown: Values of `over` at which it stands for itself in a plan.
        rival_every: A plan looks at one point in this many of its grid as a rival.
        cycle: How it is looked for in a single chamber cycle; None: it is not.
        loops: It stands for every memory with loops that do not depend on the rate, and is judged by them all.
    """

    price: int
    grid: Callable[[Reach], list[Mapping[str, float]]]
    over: str | None = None
    needed_d: float = 6.3
    width: Callable[[float, float], float] = lambda here, span_c: 0.2 * abs(here)
    step: float | None = None
    twice: bool = False
    imitates: bool = False
    planned: bool = True
    shown: tuple[float, ...] = ()
    rival_every: int = 1
    cycle: SingleCycle | None = None
    loops: bool = False


def anywhere(reach: Reach) -> list[Mapping[str, float]]:
    """The grid of a cause without a parameter to search over."""
    return [{}]


def geometric(parameter: Parameter, points: int) -> Callable[[Reach], list[Mapping[str, float]]]:
    """A grid that is even in the logarithm, up to what the recordings can show; none where they show less."""

    def grid(reach: Reach) -> list[Mapping[str, float]]:
        top = min(parameter.high, reach.most(parameter.unit))
        if top <= parameter.low:
            return []
        return [{parameter.name: float(v)} for v in np.geomspace(parameter.low, top, points)]

    return grid
