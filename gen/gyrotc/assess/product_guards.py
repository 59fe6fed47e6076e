"""What a product states of its runtime: guards of channels, and what firmware may learn in service.

Guards are what its sensors can show, where a maker knows it better than the recordings do: for each channel what the
runtime accepts of it. What is not said stays as training showed it. The recordings themselves are judged by what
training showed, so that no product file changes a map.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import AfterValidator, BaseModel, BeforeValidator, ConfigDict, Field

from ..common.errors import InputError
from ..lot.service import spread_of_lot, spread_of_power_ons
from ..mirror.samples import PLAUSIBLE_C
from ..model import BiasSpread, Celsius, Guard, Learning, Model
from ..results.fleet import KnownMap, Lot
from ..tables.emit import data_sheet_spread
from ..tables.rounding import TEMPERATURE, channel_names, guard_of
from ..train.data import TrainingData
from ..train.prior.earlier import posterior_of_known

_MOST_BLOCKS = 100000  # libc/gtc_limits.inl


def _ascending(pair: tuple[float, float]) -> tuple[float, float]:
    if pair[0] >= pair[1]:
        raise ValueError("two numbers, the lower end first")
    return pair


def _as_tuple(value: Any) -> Any:
    return tuple(value) if isinstance(value, list) else value


_Value = Annotated[float, Field(ge=-1e9, le=1e9)]
_Change = Annotated[float, Field(gt=0.0, le=1e9)] | None
_Seconds = Annotated[float, Field(ge=0.0, le=2000.0)] | None  # a word of microseconds


class ProductGuard(BaseModel):
    """Guard of one channel in a product file, in its unit; what is left out comes from the recordings."""

    model_config = ConfigDict(frozen=True, extra="forbid", strict=True, allow_inf_nan=False)

    range: Annotated[tuple[_Value, _Value], BeforeValidator(_as_tuple), AfterValidator(_ascending)] | None = None
    step: _Change = None  # accepted from one reading to the next ...
    rate_per_min: _Change = None  # ... and this much more a minute since the last one that was accepted
    agree_s: _Seconds = None  # how long readings must agree at start, after a jump, after a loss
    stuck_s: _Seconds = None  # how long a reading may stay the same; 0: for ever
    missing_s: Annotated[float, Field(gt=0.0, le=1e6)] | None = None  # how long it may be missing
    fallback: _Value | None = None  # what then stands for an auxiliary channel


def guarded(model: Model, asked: Mapping[str, ProductGuard], file: str, recorded: Collection[str]) -> Model:
    """The model with the guards of a product file.

    Args:
        asked: By channel; `temperature_c` is the temperature.
        file: The product file, for messages.
        recorded: Channels of the recordings. One that is recorded and not in the table needs no guard.

    Raises:
        InputError: A channel that is not recorded, or a guard that contradicts itself, the envelope, or what this
            runtime can hold.
    """
    guards = dict(model.guards)
    fields: dict[str, Any] = {}
    for channel, guard in asked.items():
        where = f"{file}, field guards.{channel}"
        if channel == TEMPERATURE and channel not in recorded:
            guards[channel] = own = _of_temperature(model, guard, where)
            fields = {  # the same in the fields of the temperature in `model.json`
                "max_step_c": own.max_step,
                "max_rate_c_per_min": own.max_rate_per_min,
                "agree_s": own.agree_s,
                "stuck_s": own.stuck_s,
                "hold_blocks": min(max(1, round(own.missing_s / model.block_s)), _MOST_BLOCKS),
            }
        elif channel not in recorded:
            raise InputError(where, "is no channel of the recordings", ", ".join([TEMPERATURE, *recorded]))
        elif channel in channel_names(model):
            guards[channel] = _merged(guard_of(model, channel), guard, where)
    return model.model_copy(update={**fields, "guards": guards})


def _of_temperature(model: Model, guard: ProductGuard, where: str) -> Guard:
    if guard.fallback is not None:
        raise InputError(f"{where}.fallback", repr(guard.fallback), "none: the constant correction comes from training")
    low, high = guard.range or PLAUSIBLE_C
    if not PLAUSIBLE_C[0] <= low < high <= PLAUSIBLE_C[1]:
        raise InputError(f"{where}.range", f"{low:g} to {high:g} C", "within {:g} to {:g} C".format(*PLAUSIBLE_C))
    trained = model.envelope.temperature_c
    if not low <= trained[0] <= trained[1] <= high:
        raise InputError(
            f"{where}.range", f"{low:g} to {high:g} C", "all of the recordings, {:.4g} to {:.4g} C".format(*trained)
        )
    base = guard_of(model, None).model_copy(update={"fallback": min(max(0.0, low), high)})
    return _merged(base, guard, where)


def _merged(base: Guard, guard: ProductGuard, where: str) -> Guard:
    names = {"step": "max_step", "rate_per_min": "max_rate_per_min"}
    stated = guard.model_dump(exclude_none=True, exclude={"range"})
    values = base.model_dump() | {names.get(name, name): value for name, value in stated.items()}
    if guard.range:
        values["low"], values["high"] = guard.range
    if not values["low"] <= values["fallback"] <= values["high"]:
        found = f"{values['fallback']:g} is outside of {values['low']:g} to {values['high']:g}"
        raise InputError(f"{where}.fallback", found, "a value within the range")
    return Guard.model_validate(values)


@dataclass(frozen=True)
class BuiltUnit:
    """What a build saw of a unit: the lot that its map was made with and what is known of the map, means of training
    (`run` is the power-on)."""

    lot: Lot | None = None
    known: KnownMap | None = None
    means: TrainingData | None = None


_Sigma = Annotated[float, Field(ge=0.0, le=1e6)] | None


class ServiceLearning(BaseModel):
    """What firmware may learn in service, and where its prior comes from: docs/limits.md."""

    model_config = ConfigDict(frozen=True, extra="forbid", strict=True, allow_inf_nan=False)

    authority_dph: Annotated[float, Field(gt=0.0, le=1e6)]
    prior: Literal["data_sheet", "lot", "power_ons"] = "data_sheet"
    table_dph: _Sigma = None  # 1 sigma of the table's error; None: the median of its uncertainty
    turn_on_dph: _Sigma = None  # from power-on to power-on; None: as training saw it, at least the table's
    ageing_dph_per_sqrt_month: _Sigma = None  # None: none, with a lot the lot's
    noise_deg_per_sqrt_h: Annotated[float, Field(gt=0.0, le=1e6)] | None = None  # None: as training saw it
    reference_c: Celsius | None = None  # where the table is known best; None: the middle of its envelope
    settle_s: Annotated[float, Field(ge=0.0, le=1e6)] = 0.0
    spread: BiasSpread | None = None  # in place of what a data sheet says

    def of(self, model: Model, seen: BuiltUnit, where: str) -> Learning:
        """The same for a model.

        Args:
            where: The limits file.

        Raises:
            InputError: The source of the prior does not know what the section leaves out.
        """
        at = f"{where}, field learning"
        rules = model.uncertainty_dph.rules if model.uncertainty_dph else None
        noise = self.noise_deg_per_sqrt_h or (rules.noise_deg_per_sqrt_h if rules else 0.0)
        if not noise > 0.0:
            raise InputError(f"{at}.noise_deg_per_sqrt_h", "is missing", "a number: training does not tell it")
        center = sum(model.envelope.temperature_c) / 2.0 if self.reference_c is None else self.reference_c
        if self.prior == "lot":
            spread = self._of_lot(model, seen, center, f"{at}.prior")
        elif self.prior == "power_ons":
            spread = self._of_power_ons(model, seen, center, at)
        else:
            spread = self._of_data_sheet(model, at)
        return Learning(
            spread=spread,
            reference_c=center,
            authority_dph=self.authority_dph,
            noise_deg_per_sqrt_h=noise,
            settle_s=self.settle_s,
        )

    def _of_data_sheet(self, model: Model, at: str) -> BiasSpread:
        if self.spread:
            return self.spread
        known = [sigma for row in model.uncertainty_dph.rows for sigma in row] if model.uncertainty_dph else [0.0]
        table = float(np.median(known)) if self.table_dph is None else self.table_dph
        if not table > 0.0:
            raise InputError(f"{at}.table_dph", "is missing", "a number: training does not tell it")
        # Few runs that agree do not show that power-ons do: no less than the table is known to.
        turn_on = max(model.between_dph, table) if self.turn_on_dph is None else self.turn_on_dph
        return data_sheet_spread(table, turn_on, self.ageing_dph_per_sqrt_month or 0.0)

    def _of_power_ons(self, model: Model, seen: BuiltUnit, center_c: float, at: str) -> BiasSpread:
        if seen.means is None:
            raise InputError(f"{at}.prior", "'power_ons' for an extended model", "another prior")
        guess = self._of_data_sheet(model, at)
        if not self.spread:  # nobody has said that there is no warm-up, nor that a slope is not drawn
            size = float(np.hypot(guess.level, guess.turn_on))
            span = float(np.ptp(model.envelope.temperature_c)) or 1.0
            more = {"turn_on_slope": size / span, "warm_up": size}
            guess = guess.model_copy(update=more)
        envelope = model.envelope.temperature_c
        return spread_of_power_ons(guess, seen.means, model.method, envelope, center_c, f"{at}.prior")

    def _of_lot(self, model: Model, seen: BuiltUnit, center_c: float, at: str) -> BiasSpread:
        if self.spread or self.table_dph is not None:
            raise InputError(at, "'lot' beside table_dph or spread", "one of them: the lot says what a table leaves")
        if seen.lot is None or seen.known is None:
            found = "'lot' for a unit that its lot does not fit" if seen.lot else "'lot' without --lot"
            raise InputError(at, found, "--lot with a lot that it fits, or another prior")
        if seen.lot.ageing is None and self.ageing_dph_per_sqrt_month is None:
            found = "'lot', and no unit of the lot was calibrated twice"
            raise InputError(at, found, "gyrotc lot --earlier, or ageing_dph_per_sqrt_month here")
        known = posterior_of_known(seen.known, at)
        stated = data_sheet_spread(
            known.rms_sigma_dph(),
            known.prior.asked.between_dph if self.turn_on_dph is None else self.turn_on_dph,
            self.ageing_dph_per_sqrt_month or 0.0,
        )
        ageing = seen.lot.ageing if self.ageing_dph_per_sqrt_month is None else None
        return spread_of_lot(stated, known, ageing, model.envelope.temperature_c, center_c)
