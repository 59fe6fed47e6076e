"""Guards that a product file states: for each channel what the runtime accepts of it.

A maker may know better than the recordings what a sensor can show. What is not stated stays as training showed it. The
recordings themselves are judged by what training showed, so that no product file changes a map.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping
from typing import Annotated, Any

from pydantic import AfterValidator, BaseModel, BeforeValidator, ConfigDict, Field

from ..common.errors import InputError
from ..common.inputs import MOST_HELD, PLAUSIBLE_C
from ..model import Guard, Model
from ..tables.rounding import TEMPERATURE, channel_names, guard_of


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
                "hold_blocks": min(max(1, round(own.missing_s / model.block_s)), MOST_HELD),
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
