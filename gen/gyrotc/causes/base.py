"""A cause of the catalogue: its physics, columns, search and words, and its form in a table.

- `cavity`, `bias`, `record`: how the cause acts on a simulated instrument (`Scene`), at the simulation's own
  rate;
- `features`, `amplitudes`: what a fit needs, from a measured record (`History`) at its native rate, before any
  averaging;
- `search`: over which values diagnosis looks for it, and at what price;
- `table`: how it stands in a table, if one can hold it (the recursions are in `recursion`, the C in
  libc/gtc_terms.inl);
- `words`: what reports say of it.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from decimal import Context, Decimal
from enum import IntEnum
from typing import Literal

import numpy as np

from ..common.arrays import FloatArray
from ..mirror.kinds import TableKind, recursion_of
from ..mirror.recursions import FLOAT64, Recursion, first_order


@dataclass(frozen=True, slots=True)
class Reach:
    """Reach of recordings: the range of their temperatures, C, and the length of the longest run, s."""

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
    """Search for a memory in a single chamber cycle.

    Attributes:
        points: How many the grid over its parameter has.
        usual: Every package has such a memory: it is preferred to one that does as well and that few have.
    """

    points: int
    usual: bool


@dataclass(frozen=True, slots=True)
class SearchRule:
    """Search of diagnosis for a cause.

    Attributes:
        price: Free parameters that it adds to the model: its share of the information criterion.
        grid: Values of the nonlinear parameters: less than 1 % of a signature's energy falls between two points.
        over: The parameter that is refined between the points of the grid; None: it has none.
        needed_d: Signal-to-noise ratio that is found in 95 % of cases at a familywise level of 1 % (docs/diagnosis.md).
        width: About one point of the grid at a value of the parameter, for recordings that span some C.
        step: Step of the derivative to the parameter, in its unit; None: 2 % of its value.
        twice: It may be there twice, with parameters far from one another.
        imitates: Whether a cause that is found is compared with it: from which d the two can be distinguished.
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


@dataclass(frozen=True, slots=True)
class Tabled:
    """Form of a cause in a table.

    Attributes:
        kind: Recursion of the target.
        parameters: Parameters of the record (docs/FORMAT.md, section 3) from those of the cause and the length
            of a block in s.
        optional: Parameters of the cause that a model or a scenario may leave out: they are 0 then.
    """

    kind: TableKind
    parameters: Callable[[Mapping[str, float], float], list[float]]
    optional: tuple[str, ...] = ()

    def recursion(self, values: Mapping[str, float], block_s: float) -> Recursion:
        """The recursion in float64."""
        return recursion_of(self.kind, FLOAT64, self.parameters(values, block_s))


def memory_gain(block_s: float, tau_s: float) -> float:
    """1 - exp(-block/tau), by decimal arithmetic: the same on every machine."""
    context = Context(prec=40)
    ratio = context.divide(Decimal(-block_s), Decimal(tau_s))
    return float(1 - context.exp(ratio))


def half_block_before(block_s: float, tau_s: float) -> float:
    """exp(block/2τ): what fades with τ was so much larger half a block earlier.

    A memory is known for the end of a block, and in force over the whole of it: its mean is that of the middle. Of a
    block that is longer than 2τ nothing is left of it, and no factor brings it back: e at most.
    """
    context = Context(prec=40)
    return float(context.exp(min(context.divide(Decimal(block_s), 2 * Decimal(tau_s)), Decimal(1))))


def blocks_per_tau(block_s: float, tau_s: float) -> float:
    """block/tau: what turns T − z into the memory's change in a block."""
    return block_s / tau_s


def octaves_per_block(block_s: float, tau_s: float) -> float:
    """Return how many times exp(-t/tau) halves in a block."""
    return 1.4426950408889634 * block_s / tau_s  # log2(e)


def turns(phase_rad: float) -> float:
    """A phase in turns, -1/2 ... 1/2."""
    whole = phase_rad / (2.0 * math.pi)
    return whole - round(whole)


class Telling(IntEnum):
    """Information that the experiment of a cause gives; of a pair, the more informative one is proposed."""

    LITTLE = 0
    STATIC = 1
    CHANNEL = 2
    REPEATS = 3
    COLD_START = 4
    DIRECTION = 5


@dataclass(frozen=True, slots=True)
class Wording:
    """The words of a cause in reports.

    Attributes:
        name: One clause.
        signature: How it shows in the residuals.
        remedy: What to do about it.
        experiment: What tells it from other causes.
        telling: How much that tells.
        beside: The experiment that tells it from one certain cause, by id of that cause.
        recording: What to record so that it can be tested; empty where any recording will do.
        advice: What to do when it is found, besides the remedy; a sentence, or empty.
    """

    name: str
    signature: str
    remedy: str
    experiment: str
    telling: Telling = Telling.LITTLE
    beside: Mapping[str, str] = field(default_factory=dict)
    recording: str = ""
    advice: str = ""


OVERTONES = "overtones"
"""Beside the parameters of a wave that is no sine: how many overtones its columns have."""

MOST_OVERTONES = 2  # with the wave itself they leave one of the four terms of a table to something else

CauseValues = Mapping[str, float]

CauseKind = Literal["input", "add", "random", "static", "record"]
"""How a cause enters a model.

input: the map sees another temperature; add: columns are added to the map; random: one draw for each run;
static: more of the map itself; record: the recorded temperature is not the true one.
"""


@dataclass(frozen=True, slots=True)
class Parameter:
    """A parameter of a cause.

    Attributes:
        name: What docs/FORMAT.md and scenario files call it.
        unit: Its unit.
        low, high: Plausible range (prior), of the magnitude where `signed`.
        linear: The effect is proportional to it; `features` does not take it.
        signed: Both signs occur.
        default: Value where a scenario gives none; None if it must.
    """

    name: str
    unit: str
    low: float
    high: float
    linear: bool = False
    signed: bool = False
    default: float | None = None


@dataclass(frozen=True, slots=True)
class Needs:
    """Needs of a cause: what recordings must have before it can be tested."""

    runs: int = 1
    dates: int = 0
    power_on: bool = False
    channel: bool = False


@dataclass(frozen=True, slots=True)
class History:
    """One measured run as a feature sees it, at its native rate.

    Attributes:
        time_s: Times of the rows, s, ascending, shape (n,).
        temperature_c: Recorded temperature, C, shape (n,).
        on_s: Time since power-on, s, shape (n,); None if unknown.
        channel: The auxiliary channel that is asked about, shape (n,), else None.
        run: Number of the run among `runs`.
        runs: How many runs there are.
        day: Days since the first dated run; None without a date.
    """

    time_s: FloatArray
    temperature_c: FloatArray
    on_s: FloatArray | None = None
    channel: FloatArray | None = None
    run: int = 0
    runs: int = 1
    day: float | None = None


@dataclass(frozen=True, slots=True)
class Scene:
    """One simulated run, on the simulation's grid, from the start of the chamber programme.

    Attributes:
        time_s: s, shape (n,).
        on_s: Time since power-on, s; negative before.
        node_c: True temperature where the sensor sits, C.
        cavity_c: Temperature that the bias acts on, C.
        sensed_c: What the sensor would show without noise, C.
        channel: The auxiliary channel that the cause names, else None.
        day: Days since the first run.
    """

    time_s: FloatArray
    on_s: FloatArray
    node_c: FloatArray
    cavity_c: FloatArray
    sensed_c: FloatArray
    channel: FloatArray | None
    day: float


@dataclass(frozen=True, slots=True)
class Cause:
    """A cause of the catalogue. A hook that a cause does not have is None.

    Attributes:
        id, family: As in docs/FORMAT.md and in the results of `diagnose`.
        rank: Results list the causes by ascending rank.
        kind: How it enters a model.
        equation: In plain text.
        source: Where the mechanism is described.
        parameters: In the order of docs/FORMAT.md; the linear ones come last.
        words: What reports say of it.
        needs: What recordings must offer.
        search: How diagnosis looks for it; None: it is simulated only.
        table: How it stands in a table; None: no table holds it.
        cavity: Simulation: temperature that the bias acts on instead of `scene.cavity_c`, C.
        bias: Simulation: what it adds to the bias, deg/h; may draw from the generator (once for each run).
        record: Simulation: what the sensor shows instead of `scene.sensed_c`, C.
        features: Columns of one run for given nonlinear parameters, shape (n, k); for kind "input" the temperature that
            the map should see (C) and its rate (C/min).
        amplitudes: Linear parameters from the fitted weights of the columns.
        mended: For kind "input" without a table: what the map would see had the recording been right, from times
            in s, temperature in C, its rate in C/min and the parameters; not a number where nothing says it.
        over_temperature: Its parameters where its strength (first) grows (second) with each C from a reference (third)
            on; a table holds that, too.
        overtone: Nonlinear parameters of its n-th overtone (2: twice as often): a wave that is no sine has some.
        unseen_s: How much of either end of a run the cause puts out of sight, s.
        repair: The line of `dataset.toml` that takes it out of recordings.
    """

    id: str
    family: str
    rank: int
    kind: CauseKind
    equation: str
    source: str
    parameters: tuple[Parameter, ...]
    words: Wording
    needs: Needs = Needs()
    search: SearchRule | None = None
    table: Tabled | None = None
    cavity: Callable[[Scene, CauseValues], FloatArray] | None = None
    bias: Callable[[Scene, CauseValues, np.random.Generator], FloatArray] | None = None
    record: Callable[[Scene, CauseValues], FloatArray] | None = None
    features: Callable[[History, CauseValues], FloatArray] | None = None
    amplitudes: Callable[[FloatArray], dict[str, float]] | None = None
    mended: Callable[[FloatArray, FloatArray, FloatArray, CauseValues], tuple[FloatArray, FloatArray]] | None = None
    over_temperature: Callable[[CauseValues, float, float, float], CauseValues] | None = None
    overtone: Callable[[CauseValues, float], CauseValues] | None = None
    unseen_s: Callable[[CauseValues], float] | None = None
    repair: Callable[[CauseValues], str] | None = None

    def nonlinear(self) -> tuple[Parameter, ...]:
        """Parameters that `features` takes."""
        return tuple(parameter for parameter in self.parameters if not parameter.linear)

    @property
    def unit(self) -> str:
        """Unit of its size: of its amplitude, or of the parameter that changes the map's input; empty: it has none."""
        shown = self.parameters if self.kind == "input" else [p for p in self.parameters if p.linear]
        return next((parameter.unit for parameter in shown), "")


ADVICE_MORE_RATES = "ramps at two more rates with holds of an hour after each; a second thermometer at the cavity"
CORNERS = "steps or 5 C/min corners recorded with 10-s rows; a synchronisation pulse in both recordings"
COLD_STARTS = "a cold start at a constant chamber temperature, at two temperatures; a hot restart"


def lagged(history: History, tau_s: float) -> FloatArray:
    """State z of the recorded temperature, C, and dz/dt in C/min, shape (n, 2)."""
    z = first_order(tau_s, history.time_s, history.temperature_c)
    return np.column_stack((z, (history.temperature_c - z) * (60.0 / tau_s)))


def weights_of(*names: str) -> Callable[[FloatArray], dict[str, float]]:
    """Return a function that names the weights of the columns, in their order, as amplitudes."""
    return lambda weights: dict(zip(names, weights.tolist(), strict=True))
