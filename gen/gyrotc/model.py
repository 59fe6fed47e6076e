"""The fitted model of one axis of one gyro: frozen in memory, JSON on disk (docs/FORMAT.md, section 1).

Reads and writes `model.json` and evaluates the network's equation in float64; knows nothing of rounding.

The network is eq. (1), (2) of Ding et al. 2014, with one width per input and center:

    bias(T, r) = w0 + linear · z + Σ_i w_i exp(−((z_T − c_iT)/δ_iT)² − ((z_r − c_ir)/δ_ir)²)

where z normalises temperature T (C) and its rate r (C/min) by `scale`.
"""

from __future__ import annotations

import hashlib
import json
import math
import re
from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray
from pydantic import (
    AfterValidator,
    BaseModel,
    ConfigDict,
    Field,
    SerializerFunctionWrapHandler,
    ValidationError,
    model_serializer,
    model_validator,
)

from .causes import CATALOGUE
from .causes.base import Cause, Tabled
from .common.errors import InputError, quoted
from .common.inputs import MOST_CENTERS, MOST_HELD, AverageLength, BlockLength, read_json, refused
from .results.base import refused_result
from .results.files import write_atomically
from .results.json_text import digest_of, json_text

__all__ = [
    "MODEL_SCHEMA",
    "Coverage",
    "DataFile",
    "Envelope",
    "Guard",
    "Model",
    "Network",
    "Rules",
    "RuntimePart",
    "Scale",
    "Term",
    "Uncertainty",
    "load_model",
    "table_id",
]

MODEL_SCHEMA = "gyrotc.model/1"
CHECKSUM = "checksum"  # field of the file: the hash of all others
SERIAL = r"^[A-Za-z0-9._-]{1,64}$"
_MAX_NETWORKS = 16  # libc/gtc_limits.inl
_C_NAME_LIMIT = 31  # significant characters of an external name, C99 5.2.4.1
_LONGEST_SYMBOL = _C_NAME_LIMIT - len("gtc_") - len("_f32")
# Names of the runtime: its files with their include guards, and GTC_E_ID.
_TAKEN_ID = re.compile(
    r"e|angle|crc|config|table|private|private_state|(f32|q31)(_\w+)?|(num|save|selftest|usable)_(f32|q31)"
)

Celsius = Annotated[float, Field(ge=-200.0, le=400.0)]
CelsiusPerMin = Annotated[float, Field(ge=-1000.0, le=1000.0)]
Dph = Annotated[float, Field(ge=-7.5e6, le=7.5e6)]
Width = Annotated[float, Field(ge=1e-3, le=1e3)]
PositiveAmount = Annotated[float, Field(gt=0.0, le=1e6)]
CellCounts = tuple[Annotated[int, Field(ge=1, le=256)], Annotated[int, Field(ge=1, le=256)]]


def _ordered(pair: tuple[float, float]) -> tuple[float, float]:
    if pair[0] > pair[1]:
        raise ValueError("minimum above maximum")
    return pair


def _around_zero(pair: tuple[float, float]) -> tuple[float, float]:
    if not pair[0] <= 0.0 <= pair[1]:
        raise ValueError("0 is not between minimum and maximum")
    return pair


class _Frozen(BaseModel):
    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False, strict=True)


class Scale(_Frozen):
    """Normalisation of the inputs: z_T = (T − center)/half_range, z_r = r/slope_c_per_min."""

    temperature_c: tuple[Celsius, PositiveAmount] = Field(description="center and half range of T, C")
    slope_c_per_min: PositiveAmount = Field(description="half range of dT/dt, C/min; its center is 0")


class Envelope(_Frozen):
    """Range of the inputs, C and C/min; also the region of one network of a bank."""

    temperature_c: Annotated[tuple[Celsius, Celsius], AfterValidator(_ordered)] = Field(
        description="smallest and largest T, C"
    )
    slope_c_per_min: Annotated[tuple[CelsiusPerMin, CelsiusPerMin], AfterValidator(_ordered)] = Field(
        description="smallest and largest dT/dt, C/min"
    )

    def cells_at(
        self, cells: tuple[int, int], temperature_c: ArrayLike, slope_c_per_min: ArrayLike
    ) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        """Return row and column of inputs in a grid over the range; beyond it they are negative or too large.

        Args:
            cells: Numbers of columns (T) and rows (dT/dt).
            temperature_c, slope_c_per_min: Inputs of shapes that broadcast together.
        """
        column, row = (
            np.floor((np.asarray(x, dtype=np.float64) - low) / (high - low or 1.0) * n).astype(np.int64)
            for x, (low, high), n in zip(
                (temperature_c, slope_c_per_min), (self.temperature_c, self.slope_c_per_min), cells, strict=True
            )
        )
        return row, column


class Coverage(_Frozen):
    """Cells with training data: `rows[j][i]` is "1" for cell i of T and j of dT/dt over the envelope."""

    cells: CellCounts = Field(description="numbers of cells of T and of dT/dt, equal in size over the envelope")
    rows: tuple[Annotated[str, Field(pattern="^[01]+$")], ...] = Field(
        description="a text for each cell of dT/dt, lowest first, with a digit for each cell of T, ascending"
    )

    @model_validator(mode="after")
    def _shape(self) -> Coverage:
        if len(self.rows) != self.cells[1] or any(len(r) != self.cells[0] for r in self.rows):
            raise ValueError("rows do not have the size that cells gives")
        return self

    @property
    def trained(self) -> NDArray[np.bool_]:
        """Cells with training data, shape (rows, columns)."""
        return np.array([[cell == "1" for cell in row] for row in self.rows])


BiasAmount = Annotated[float, Field(ge=0.0, le=7.5e6)]


class Rules(_Frozen):
    """Growth of the uncertainty of a correction unlike those trained on, 1 σ; docs/design.md gives the reasons."""

    hold_dph_per_c: BiasAmount = Field(
        description="growth for each C by which a held temperature may have continued at its slope, deg/h/C"
    )
    rest_dph_per_min: BiasAmount = Field(description="growth for each minute for which a correction is held, deg/h/min")
    slope_dph_per_c_per_min: BiasAmount = Field(
        description="growth for a slope that is known and not yet in the correction, deg/h per C/min"
    )
    start_dph: BiasAmount = Field(description="growth while no slope is known, deg/h")
    turn_dph: BiasAmount | None = Field(
        default=None,
        description="growth for a held temperature that may have turned to any trained slope, deg/h; absent:"
        " `start_dph`",
    )
    beyond_dph_per_c: BiasAmount = Field(description="growth for each C beyond the envelope, deg/h/C")
    beyond_dph_per_c_per_min: BiasAmount = Field(
        description="growth for each C/min beyond the envelope, deg/h per C/min"
    )
    fallback_dph: BiasAmount = Field(description="1 σ of the constant correction `fallback_dph`, deg/h")
    none_dph: BiasAmount = Field(description="1 σ of the bias before the first accepted reading, deg/h")
    between_dph: BiasAmount = Field(
        description="1 σ of the constant of the next power-on, by Student's t, deg/h; included in every cell"
    )
    turn_on_dph: BiasAmount | None = Field(
        default=None, description="standard deviation that `between_dph` follows from, deg/h; absent: not known"
    )
    turn_on_freedom: Annotated[int, Field(ge=0)] | None = Field(
        default=None, description="degrees of freedom of `turn_on_dph`; absent: infinite"
    )
    noise_deg_per_sqrt_h: BiasAmount = Field(description="angle random walk of the rate, for a re-zero, deg/√h")
    correlation_s: Annotated[float, Field(ge=1.0, le=7.5e6)] = Field(
        description="correlation time of the error of the compensated bias, s"
    )
    terms: tuple[BiasAmount, ...] = Field(
        default=(),
        description="for each term, what is not known of the time before it started: deg/h, of `hysteresis` deg/h/C",
    )

    @model_serializer(mode="wrap")
    def _without_unknown(self, handler: SerializerFunctionWrapHandler) -> dict[str, Any]:
        """Leave out what is not known: a model that states nothing of it has no such field."""
        content: dict[str, Any] = handler(self)
        unknown = [name for name in ("turn_dph", "turn_on_dph", "turn_on_freedom") if content[name] is None]
        return {name: value for name, value in content.items() if name not in unknown}


class Uncertainty(_Frozen):
    """1 σ of the compensated bias, deg/h: `rows[j][i]` for cell i of T and j of dT/dt.

    Without `uncovered` and `rules` a table does not state how uncertain its corrections are.
    """

    cells: CellCounts = Field(description="numbers of cells of T and of dT/dt over the envelope")
    rows: tuple[tuple[BiasAmount, ...], ...] = Field(description="1 σ of a cell with training data, deg/h")
    uncovered: tuple[tuple[BiasAmount, ...], ...] | None = Field(
        default=None, description="1 σ of a cell without training data, deg/h; null: as `rows`"
    )
    rules: Rules | None = Field(default=None, description="growth that is added to the 1 σ of a cell; null: not known")

    @model_validator(mode="after")
    def _shape(self) -> Uncertainty:
        for rows in (self.rows, self.uncovered or self.rows):
            if len(rows) != self.cells[1] or any(len(r) != self.cells[0] for r in rows):
                raise ValueError("rows do not have the size that cells gives")
        return self


class Network(_Frozen):
    """One network: w0, linear part and Gaussians. Centers in C and C/min, widths δ in normalised units."""

    w0: Dph = Field(description="constant, deg/h")
    linear: tuple[Dph, Dph] = Field(description="coefficients of z_T and z_r, deg/h")
    centers: Annotated[tuple[tuple[Celsius, CelsiusPerMin], ...], Field(max_length=MOST_CENTERS)] = Field(
        description="T and dT/dt of each Gaussian, C and C/min"
    )
    widths: tuple[tuple[Width | None, Width | None], ...] = Field(
        description="δ of each Gaussian for both inputs, normalised; null: infinite"
    )
    weights: tuple[Dph, ...] = Field(description="weight of each Gaussian, deg/h")
    region: Envelope | None = Field(
        default=None, description="in a bank, where the network is used; neighbours overlap and are blended linearly"
    )

    @model_validator(mode="after")
    def _same_length(self) -> Network:
        if not len(self.centers) == len(self.widths) == len(self.weights):
            raise ValueError("centers, widths and weights differ in length")
        return self


class Term(_Frozen):
    """Term that is added to the map, of the kinds in docs/FORMAT.md, section 2."""

    model_config = ConfigDict(populate_by_name=True)

    id: str = Field(description="kind of the term")
    parameters: dict[str, Annotated[float, Field(ge=-1e9, le=1e9)]] = Field(description="parameters by name")
    channel: str | None = Field(default=None, description="channel that it follows; null: the temperature")
    fallback_model: Annotated[Network | None, Field(alias="stand_in")] = Field(
        default=None,
        description="mean effect at a temperature and its rate, while the channel is lost; absent: the guard's"
        " `fallback` is used as the reading",
    )

    @model_validator(mode="after")
    def _known(self) -> Term:
        cause = CATALOGUE.get(self.id)
        if cause is None or cause.table is None:
            held = ", ".join(i for i, c in CATALOGUE.items() if c.table is not None)
            raise ValueError(f"no term {self.id!r}; a table can hold {held}")
        names = {p.name for p in cause.parameters}
        if not names - set(cause.table.optional) <= set(self.parameters) <= names:
            raise ValueError(f"term {self.id} takes the parameters {', '.join(sorted(names))}")
        for parameter in cause.nonlinear():
            if parameter.low > 0.0 and self.parameters[parameter.name] <= 0.0:
                raise ValueError(f"{parameter.name} of term {self.id} must be above 0")
        if cause.needs.channel != (self.channel is not None):
            raise ValueError("a channel belongs to an auxiliary term and to no other")
        if self.fallback_model is not None and (self.channel is None or self.fallback_model.region is not None):
            raise ValueError("a fallback model belongs to a term with a channel, and has no region")
        return self

    @model_serializer(mode="wrap")
    def _without_none(self, handler: SerializerFunctionWrapHandler) -> dict[str, Any]:
        content: dict[str, Any] = handler(self)
        if self.fallback_model is None:
            content = {name: value for name, value in content.items() if name not in ("stand_in", "fallback_model")}
        return content

    @property
    def cause(self) -> Cause:
        """Cause of the catalogue."""
        return CATALOGUE[self.id]

    @property
    def table(self) -> Tabled:
        """Form of the cause in a table."""
        table = self.cause.table
        assert table is not None
        return table


class Guard(_Frozen):
    """Plausibility check of the readings of a channel, in its unit."""

    low: Annotated[float, Field(ge=-1e9, le=1e9)] = Field(
        description="smallest reading; an auxiliary channel is limited to it, a temperature below it is rejected"
    )
    high: Annotated[float, Field(ge=-1e9, le=1e9)] = Field(
        description="largest reading; an auxiliary channel is limited to it, a temperature above it is rejected"
    )
    max_step: Annotated[float, Field(ge=0.0, le=1e9)] = Field(
        description="largest plausible change between two readings"
    )
    max_rate_per_min: Annotated[float, Field(ge=0.0, le=1e9)] = Field(
        description="further change per minute since the last accepted reading"
    )
    agree_s: Annotated[float, Field(ge=0.0, le=2000.0)] = Field(
        description="time for which at least three readings must agree at the start, after a loss and after a change"
        " that is not plausible, s; 0: one is enough"
    )
    stuck_s: Annotated[float, Field(ge=0.0, le=2000.0)] = Field(
        description="time after which an unchanged reading is rejected, s; 0: never"
    )
    missing_s: Annotated[float, Field(gt=0.0, le=1e6)] = Field(
        description="time without enough readings after which the channel is lost, s"
    )
    fallback: Annotated[float, Field(ge=-1e9, le=1e9)] = Field(description="reading of a lost channel")

    @model_validator(mode="after")
    def _in_order(self) -> Guard:
        if not self.low <= self.fallback <= self.high:
            raise ValueError("low, fallback and high are not in this order")
        return self


class DataFile(_Frozen):
    """One recording, or a span of one, that the model was fitted to or that is a test run."""

    file: str = Field(description="name in the data set")
    sha256: Annotated[str, Field(pattern="^[0-9a-f]{64}$")] = Field(description="SHA-256 of the file")
    span: tuple[float | None, float | None] | None = Field(
        description="from and to on the clock of the file, s; null: the whole file"
    )
    role: Literal["train", "exam"] = Field(description="`exam`: a test run, which no fit has used")


#: Parts of tables and runtime that a product may leave out: docs/limits.md.
RuntimePart = Literal["uncertainty", "rezero", "coverage", "known_answers", "image", "saved_state", "time"]


class Model(_Frozen):
    """Everything that is known of one axis of one serial."""

    schema_: Annotated[Literal["gyrotc.model/1"], Field(alias="schema")] = "gyrotc.model/1"
    serial: Annotated[str, Field(pattern=SERIAL)] = Field(description="serial number of the gyro")
    axis: Literal["x", "y", "z"] | None = Field(description="null if the recordings have one axis")
    method: Annotated[str, Field(pattern="^[a-z][a-z0-9_]{0,31}$")] = Field(
        description="training method that model selection chose or `[fit]` named"
    )
    block_s: BlockLength = Field(
        description="length of a block, s: T is averaged over it, and a correction is made after it"
    )
    slope_blocks: Annotated[int, Field(ge=2, le=20)] = Field(description="blocks in the least-squares window of dT/dt")
    lead_blocks: Annotated[int, Field(ge=0, le=1)] = Field(
        default=0,
        description="map and terms are evaluated at T + lead_blocks · dT/dt · block_s, the temperature while the"
        " correction is active",
    )
    scale: Scale = Field(description="normalisation of T and dT/dt")
    envelope: Envelope = Field(description="calibrated range; inputs outside are limited to it")
    coverage: Coverage | None = Field(description="cells of the envelope with training data; null: not known")
    networks: Annotated[tuple[Network, ...], Field(min_length=1, max_length=_MAX_NETWORKS)] = Field(
        description="networks of the map; several are a bank"
    )
    terms: Annotated[tuple[Term, ...], Field(max_length=4)] = Field(
        default=(), description="terms that are added to the map"
    )
    fallback_dph: Dph = Field(
        description="constant correction after the temperature was lost for `hold_blocks`, deg/h: the mean bias of the"
        " training samples"
    )
    effects_dph: Annotated[tuple[Dph, Dph], AfterValidator(_around_zero)] | None = Field(
        default=None,
        description="smallest and largest sum of all terms in training, deg/h; null: what their parameters permit"
        " within the envelope",
    )
    rezero_dph: Annotated[float, Field(ge=0.0, le=7.5e6)] = Field(
        default=0.0, description="largest shift of the constant in service, deg/h; 0: none"
    )
    q31_bias_frac_bits: Annotated[int, Field(ge=0, le=60)] | None = Field(
        default=None, description="n of the fixed-point unit 2^-n deg/h; absent: 24"
    )
    left_out: tuple[RuntimePart, ...] = Field(
        default=(), description="parts that the limits file removes from table and runtime"
    )
    hold_blocks: Annotated[int, Field(ge=1, le=MOST_HELD)] = Field(
        description="consecutive blocks without enough readings until `fallback_dph` is used"
    )
    stuck_s: Annotated[float, Field(ge=0.0, le=2000.0)] = Field(
        default=0.0, description="time after which an unchanged temperature is rejected, s; 0: never"
    )
    agree_s: Annotated[float, Field(ge=0.0, le=2000.0)] = Field(
        default=1.0,
        description="time for which at least three temperatures must agree at the start, after a loss and after a"
        " change that is not plausible, s; 0: one is enough",
    )
    max_step_c: PositiveAmount = Field(description="largest plausible change of T between two samples, C")
    max_rate_c_per_min: PositiveAmount = Field(
        description="further change per minute since the last accepted reading, C/min"
    )
    guards: dict[str, Guard] = Field(
        default={},
        description="plausibility checks of auxiliary channels, and of `temperature_c` if the limits file states them;"
        " a channel without one accepts every reading",
    )
    noise_floor_dph: Annotated[float, Field(ge=0.0, le=7.5e6)] | None = Field(
        description="noise floor of means over `average_s`, deg/h; null: not known"
    )
    noise_floor_source: Literal["estimated"] | None = Field(description="how the noise floor was obtained")
    average_s: AverageLength = Field(default=100.0, description="averaging time of RMS figures, s")
    uncertainty_dph: Uncertainty | None = Field(
        default=None, description="standard uncertainty of the compensated bias; null: not known"
    )
    data: tuple[DataFile, ...] = Field(
        description="recordings that the model was fitted to, and those of its test runs"
    )
    seed: int = Field(description="seed of the fit")
    meta: dict[str, Any] = Field(
        default={},
        description="`[meta]` of the data set, its description, environments and date; never used in a computation",
    )

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False, strict=True, populate_by_name=True)

    @model_validator(mode="after")
    def _whole(self) -> Model:
        networks = [*self.networks, *self.fallback_models]
        if sum(len(n.centers) for n in networks) > MOST_CENTERS:
            raise ValueError(f"more than {MOST_CENTERS} centers")
        if len(networks) > _MAX_NETWORKS:
            raise ValueError(f"more than {_MAX_NETWORKS} networks, fallback models of terms among them")
        regions = [n.region is not None for n in self.networks]
        if len(regions) > 1 and not all(regions):
            raise ValueError("every network of a bank needs a region")
        sigma = self.uncertainty_dph
        if sigma and sigma.rules and len(sigma.rules.terms) != len(self.terms):
            raise ValueError("uncertainty_dph: its rules do not have a number for each term")
        moved = [t.id for t in self.terms if t.cause.kind == "input"]
        if len(moved) > 1:
            raise ValueError(f"{moved[1]} can be there only once: the map sees one temperature")
        return self

    @property
    def id(self) -> str:
        """Id of the table: part of every emitted name."""
        return table_id(self.serial, self.axis)

    @property
    def symbol(self) -> str:
        """The id within C names, so short that `gtc_<symbol>_f32` keeps within 31 characters."""
        return self.id if len(self.id) <= _LONGEST_SYMBOL else f"{self.id[:14]}_{self.id[-8:]}"

    @property
    def warnings(self) -> tuple[str, ...]:
        """Warnings about the recordings from `meta`, in the words of whoever wrote them."""
        found = self.meta.get("warnings", ())
        return tuple(map(str, found)) if isinstance(found, list | tuple) else (str(found),)

    @property
    def fallback_models(self) -> tuple[Network, ...]:
        """Fallback models of the terms that have one, in their order."""
        return tuple(t.fallback_model for t in self.terms if t.fallback_model is not None)

    @property
    def between_dph(self) -> float:
        """Standard deviation of the constant from power-on to power-on, deg/h; 0 where it is not known."""
        known = self.uncertainty_dph
        return float(known.rules.between_dph) if known is not None and known.rules is not None else 0.0

    @property
    def calibrated_on(self) -> str | None:
        """Day of the calibration in ISO 8601; None if neither `[meta]` nor a recording states it."""
        day = self.meta.get("calibrated_on")
        return None if day is None else str(day)

    @property
    def n_centers(self) -> int:
        """Number of centers of the map."""
        return sum(len(n.centers) for n in self.networks)

    @property
    def sum_abs_weights_dph(self) -> float:
        """Largest Σ|w| of the networks, deg/h: the lever of the arithmetic error."""
        return max(math.fsum(abs(w) for w in n.weights) for n in self.networks)

    def normalise(self, temperature_c: ArrayLike, slope_c_per_min: ArrayLike) -> NDArray[np.float64]:
        """Inputs as the network sees them, shape (..., 2), clamped to the envelope."""
        e = self.envelope
        t = np.clip(np.asarray(temperature_c, dtype=np.float64), *e.temperature_c)
        r = np.clip(np.asarray(slope_c_per_min, dtype=np.float64), *e.slope_c_per_min)
        center, half = self.scale.temperature_c
        z = np.broadcast_arrays((t - center) / half, r / self.scale.slope_c_per_min)
        return np.stack(z, axis=-1)

    def map_dph(self, temperature_c: ArrayLike, slope_c_per_min: ArrayLike) -> NDArray[np.float64]:
        """Static map without terms in float64, deg/h; inputs C and C/min, clamped to the envelope."""
        z = self.normalise(temperature_c, slope_c_per_min)
        if len(self.networks) == 1:
            return self._network_dph(self.networks[0], z)
        return self._bank_dph(z, temperature_c, slope_c_per_min)

    def trained_inputs(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """T (C) and dT/dt (C/min) at the middles of the cells of the envelope where training was, shape (n,) each.

        All cells where that is not known.
        """
        columns, rows = self.coverage.cells if self.coverage else (32, 12)
        (t0, t1), (r0, r1) = self.envelope.temperature_c, self.envelope.slope_c_per_min
        t = t0 + (t1 - t0) * (np.arange(columns) + 0.5) / columns
        r = r0 + (r1 - r0) * (np.arange(rows) + 0.5) / rows
        every_t, every_r = (grid.ravel() for grid in np.meshgrid(t, r))
        seen = self.coverage.trained.ravel() if self.coverage else np.ones(0, bool)
        return (every_t[seen], every_r[seen]) if seen.any() else (every_t, every_r)

    def sigma_dph(self, temperature_c: ArrayLike, slope_c_per_min: ArrayLike) -> NDArray[np.float64] | None:
        """Return 1 sigma of the correction as the table's cells state it, deg/h; None if the model states none.

        Where training was not, the cells of `uncovered` count. Inputs beyond the envelope are limited to it.
        """
        known, seen = self.uncertainty_dph, self.coverage
        if known is None:
            return None
        cells = self._cells_within(known.cells, temperature_c, slope_c_per_min)
        sigma = np.array(known.rows)[cells]
        if seen is None or known.uncovered is None:
            return np.asarray(sigma)
        covered = seen.trained[self._cells_within(seen.cells, temperature_c, slope_c_per_min)]
        return np.asarray(np.where(covered, sigma, np.array(known.uncovered)[cells]))

    def _cells_within(
        self, cells: tuple[int, int], temperature_c: ArrayLike, slope_c_per_min: ArrayLike
    ) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        row, column = self.envelope.cells_at(cells, temperature_c, slope_c_per_min)
        return np.clip(row, 0, cells[1] - 1), np.clip(column, 0, cells[0] - 1)

    def _network_dph(self, network: Network, z: NDArray[np.float64]) -> NDArray[np.float64]:
        bias = network.w0 + z @ np.array(network.linear)
        center, half = self.scale.temperature_c
        for (c_t, c_r), (d_t, d_r), weight in zip(network.centers, network.widths, network.weights, strict=True):
            u = np.zeros(z.shape[:-1])
            if d_t is not None:
                u = u + ((z[..., 0] - (c_t - center) / half) / d_t) ** 2
            if d_r is not None:
                u = u + ((z[..., 1] - c_r / self.scale.slope_c_per_min) / d_r) ** 2
            bias = bias + weight * np.exp(-u)
        return np.asarray(bias)

    def _bank_dph(
        self, z: NDArray[np.float64], temperature_c: ArrayLike, slope_c_per_min: ArrayLike
    ) -> NDArray[np.float64]:
        """Networks blended linearly over the overlap of their regions (distance to the region's edge)."""
        t = np.clip(np.asarray(temperature_c, float), *self.envelope.temperature_c)
        r = np.clip(np.asarray(slope_c_per_min, float), *self.envelope.slope_c_per_min)
        total = np.zeros(z.shape[:-1])
        share = np.zeros(z.shape[:-1])
        for network in self.networks:
            assert network.region is not None
            (t0, t1), (r0, r1) = network.region.temperature_c, network.region.slope_c_per_min
            inside = np.minimum.reduce(
                [
                    np.where(t0 > self.envelope.temperature_c[0], (t - t0) / (t1 - t0 or 1.0), 1.0),
                    np.where(t1 < self.envelope.temperature_c[1], (t1 - t) / (t1 - t0 or 1.0), 1.0),
                    np.where(r0 > self.envelope.slope_c_per_min[0], (r - r0) / (r1 - r0 or 1.0), 1.0),
                    np.where(r1 < self.envelope.slope_c_per_min[1], (r1 - r) / (r1 - r0 or 1.0), 1.0),
                ]
            )
            weight = np.maximum(inside, 0.0)
            total = total + weight * self._network_dph(network, z)
            share = share + weight
        return np.asarray(np.where(share > 0.0, total / np.where(share > 0.0, share, 1.0), self.fallback_dph))

    def for_tables(self) -> Model:
        """The model without what its tables leave out."""
        changes: dict[str, Any] = {}
        if "coverage" in self.left_out:
            changes["coverage"] = None
        if "uncertainty" in self.left_out:
            changes["uncertainty_dph"] = None
        if {"rezero", "uncertainty"} & set(self.left_out):
            changes["rezero_dph"] = 0.0
        return self.model_copy(update=changes) if changes else self

    def zeroed_at(self, temperature_c: float) -> Model:
        """Return the model with its constant shifted so that the map is 0 at a temperature and slope 0."""
        offset = float(self.map_dph(temperature_c, 0.0))
        networks = tuple(n.model_copy(update={"w0": n.w0 - offset}) for n in self.networks)
        return self.model_copy(update={"networks": networks, "fallback_dph": self.fallback_dph - offset})

    @classmethod
    def from_dict(cls, content: Mapping[str, Any]) -> Model:
        """The model of a JSON object.

        Raises:
            pydantic.ValidationError: A field is missing, unknown or illegal.
        """
        # JSON has no tuples: validated in JSON mode, so that lists pass and texts for numbers do not.
        return cls.model_validate_json(json.dumps(content))

    def to_dict(self) -> dict[str, Any]:
        """The JSON object, in the order of docs/FORMAT.md."""
        content = self.model_dump(mode="json", by_alias=True)
        if self.q31_bias_frac_bits is None:  # a model without a stated unit has no such field
            del content["q31_bias_frac_bits"]
        if not self.left_out:
            del content["left_out"]
        return content

    def to_json(self) -> str:
        """Text of `model.json`: the object, and last the checksum that `load_model` demands."""
        content = {**self.to_dict(), CHECKSUM: self.hash}
        return json_text(content)

    @property
    def hash(self) -> str:
        """SHA-256 of the canonical form: sorted keys, no spaces, ASCII."""
        return digest_of(self.to_dict())

    def save(self, path: Path) -> None:
        """Write `model.json` to a temporary name, and rename it."""
        write_atomically(path, self.to_json())


def table_id(serial: str, axis: str | None) -> str:
    """Id of a table: the serial in lower case with every non-alphanumeric as `_`, plus the axis.

    Where that loses information beyond case and `-`, is too long for a C name of 31 characters, or would
    take a name of the runtime, the first 18 characters, `_` and 8 hex digits of SHA-256(serial + axis).
    """
    suffix = f"_{axis}" if axis else ""
    plain = re.sub(r"[^a-z0-9]", "_", serial.lower())
    lossless = not re.search(r"[^A-Za-z0-9_-]", serial)
    short = len(plain) + len(suffix) <= _LONGEST_SYMBOL
    if lossless and short and not _TAKEN_ID.fullmatch(plain + suffix):
        return plain + suffix
    digest = hashlib.sha256((serial + (axis or "")).encode("ascii")).hexdigest()
    return f"{(plain + suffix)[:18]}_{digest[:8]}"


def load_model(path: Path) -> Model:
    """Read and check a `model.json`.

    Args:
        path: The file, or the folder that holds it.

    Raises:
        InputError: The file is missing, too large, not JSON, of another schema, a field is illegal, or the file
            was changed since gyrotc wrote it.
    """
    path = Path(path)
    if path.is_dir():
        path = path / "model.json"
    raw = read_json(path, "a model.json", ceiling_name="text_mib")
    if not isinstance(raw, dict) or raw.get("schema") != MODEL_SCHEMA:
        found = raw.get("schema") if isinstance(raw, dict) else type(raw).__name__
        error = InputError(f"{path}, field schema", quoted(found), repr(MODEL_SCHEMA))
        raise refused_result(path, raw, error)
    checksum = raw.pop(CHECKSUM, None)
    try:
        model = Model.from_dict(raw)
    except ValidationError as wrong:
        field_error = refused(wrong, lambda field: f"{path}, field {field or '(whole)'}", Model)
        raise refused_result(path, raw, field_error) from wrong
    if checksum != model.hash:
        raise InputError(
            f"{path}, field {CHECKSUM}",
            "is missing" if checksum is None else "is not that of the other fields: the file was changed or damaged",
            "the file as gyrotc wrote it; build it again to change it",
        )
    return model
