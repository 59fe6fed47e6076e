"""What a cause of the catalogue is: everything that is known of it stands in one `Cause`, in one module.

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

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from ..common.arrays import FloatArray
from .search import SearchRule
from .tabled import Tabled
from .words import Wording

__all__ = ["Cause", "Features", "History", "Kind", "Needs", "Parameter", "Scene", "Values"]

Values = Mapping[str, float]

Kind = Literal["input", "add", "random", "static", "record"]
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
        logarithmic: A grid over it is even in its logarithm (else in the value).
        default: Value where a scenario gives none; None if it must.
    """

    name: str
    unit: str
    low: float
    high: float
    linear: bool = False
    signed: bool = False
    logarithmic: bool = True
    default: float | None = None


@dataclass(frozen=True, slots=True)
class Needs:
    """What recordings must offer before a cause can be tested."""

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
class Features:
    """Columns of one run, shape (n, k), and the rows where they are known: enough of the past was seen.

    For kind "input" the columns are the temperature that the map should see (C) and its rate (C/min).
    """

    columns: FloatArray
    known: NDArray[np.bool_]


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
        finer_map: A finer map holds it.
        cavity: Simulation: temperature that the bias acts on instead of `scene.cavity_c`, C.
        bias: Simulation: what it adds to the bias, deg/h; may draw from the generator (once for each run).
        record: Simulation: what the sensor shows instead of `scene.sensed_c`, C.
        features: Columns for given nonlinear parameters.
        amplitudes: Linear parameters from the fitted weights of the columns.
        mended: For kind "input" without a table: what the map would see had the recording been right, from times
            in s, temperature in C, its rate in C/min and the parameters; not a number where nothing says it.
        overtone: Nonlinear parameters of its n-th overtone (2: twice as often): a wave that is no sine has some.
        unseen_s: How much of either end of a run the cause puts out of sight, s.
        repair: The line of `dataset.toml` that takes it out of recordings.
    """

    id: str
    family: str
    rank: int
    kind: Kind
    equation: str
    source: str
    parameters: tuple[Parameter, ...]
    words: Wording
    needs: Needs = Needs()
    search: SearchRule | None = None
    table: Tabled | None = None
    finer_map: bool = False
    cavity: Callable[[Scene, Values], FloatArray] | None = None
    bias: Callable[[Scene, Values, np.random.Generator], FloatArray] | None = None
    record: Callable[[Scene, Values], FloatArray] | None = None
    features: Callable[[History, Values], Features] | None = None
    amplitudes: Callable[[FloatArray], dict[str, float]] | None = None
    mended: Callable[[FloatArray, FloatArray, FloatArray, Values], tuple[FloatArray, FloatArray]] | None = (
        None
    )
    overtone: Callable[[Values, int], Values] | None = None
    unseen_s: Callable[[Values], float] | None = None
    repair: Callable[[Values], str] | None = None

    def nonlinear(self) -> tuple[Parameter, ...]:
        """Parameters that `features` takes."""
        return tuple(parameter for parameter in self.parameters if not parameter.linear)

    @property
    def unit(self) -> str:
        """Unit of its size: of its amplitude, or of the parameter that changes the map's input."""
        shown = self.parameters if self.kind == "input" else [p for p in self.parameters if p.linear]
        return shown[0].unit

    @property
    def shipped(self) -> bool:
        """Whether an extended model can hold it: as a term, or by a finer map."""
        return self.table is not None or self.finer_map
