"""Options of training, with their defaults and ranges, and the names of the training methods.

Data sets, manifests of fleets and Python callers make the same class, which pydantic checks.
"""

from __future__ import annotations

import functools
from collections.abc import Mapping
from dataclasses import dataclass, fields, replace
from typing import TYPE_CHECKING, Annotated, Any, get_args, get_origin, get_type_hints

from annotated_types import Interval

from ..common.errors import InputError, quoted, shortened
from ..common.inputs import MOST_CENTERS, AverageLength, BlockLength, refused

if TYPE_CHECKING:
    from pydantic import TypeAdapter
    from typing_extensions import Self

SIMPLE: dict[str, tuple[tuple[int, int], ...]] = {
    "constant": ((0, 0),),
    "linear": ((0, 0), (1, 0)),
    "cubic": ((0, 0), (1, 0), (2, 0), (3, 0)),
    "cubic_slope": ((0, 0), (1, 0), (0, 1), (2, 0), (3, 0)),
}
"""Corrections without a search: powers of (z_T, z_r) of each."""
COMPARED = ("constant", "mlr", "rbf_random", "rbf_ols", "mrbf_paper", "mrbf", "bank")
"""Methods that `gyrotc compare` shows side by side."""
METHODS = (*SIMPLE, "mrbf_t", *COMPARED[1:])
"""All methods."""
AUTO = "auto"
"""Model selection: the simplest correction that does on unseen history what the best one does."""


@dataclass(frozen=True, slots=True, kw_only=True)
class BuildOptions:
    """Options of training: `[fit]` of a data set, `[options]` of a fleet, arguments of Python callers.

    Attributes:
        method: `auto`: the simplest correction that holds on unseen history; or one of `METHODS`.
        seed: Number from which everything random is drawn; the same number, the same result.
        centers: Number of centers; None: the data decide.
        rho: Threshold of error reduction, eq. (16) of Ding et al. 2014.
        block_s: Length of a block, s.
        average_s: Length of the means of which RMS figures are taken, s.
        channels: Let recorded channels be inputs, those that hold on unseen history alone.

    Raises:
        InputError: A value is out of its range; the message names it as it was stated.
    """

    method: str = AUTO
    seed: Annotated[int, Interval(ge=0, lt=2**63)] = 0
    centers: Annotated[int, Interval(ge=0, le=MOST_CENTERS)] | None = None
    rho: Annotated[float, Interval(ge=0.0, lt=1.0)] | None = None
    block_s: BlockLength = 10.0
    average_s: AverageLength = 100.0
    channels: bool = False

    def __post_init__(self) -> None:
        for option in fields(BuildOptions):
            value = getattr(self, option.name)
            if value is not option.default:
                object.__setattr__(self, option.name, _checked(option.name, value, option.name))

    def with_stated(self, stated: Mapping[str, Any]) -> Self:
        """Return these options with those at their default taken from `[fit]` of a data set.

        Raises:
            InputError: A name is not known, or a value is of another type or out of its range.
        """
        known = options_in(stated, "dataset.toml, field fit.")
        mine = {option.name: getattr(self, option.name) != option.default for option in fields(BuildOptions)}
        return replace(self, **{name: value for name, value in known.items() if not mine[name]})


DEFAULTS = BuildOptions()


def _range_of(name: str) -> str:
    stated = get_type_hints(BuildOptions, include_extras=True)[name]
    for kind in (stated, *get_args(stated)):
        for limits in get_args(kind)[1:] if get_origin(kind) is Annotated else ():
            if isinstance(limits, Interval):
                low = f"{limits.ge:g} <=" if limits.ge is not None else f"{limits.gt:g} <"
                high = f"<= {limits.le:g}" if limits.le is not None else f"< {limits.lt:g}"
                return f"{low} x {high}"
    return ""


def _kind_in_words(name: str) -> str:
    stated = get_type_hints(BuildOptions, include_extras=True)[name]
    return "a whole number" if int in (stated, *get_args(stated)) or "int" in str(stated) else "a number"


@functools.cache
def _kind_of(name: str) -> TypeAdapter[Any]:
    from pydantic import ConfigDict, TypeAdapter

    stated = get_type_hints(BuildOptions, include_extras=True)[name]
    return TypeAdapter(stated, config=ConfigDict(allow_inf_nan=False))


def _checked(name: str, value: Any, where: str, *, strict: bool = False) -> Any:
    from pydantic import ValidationError

    try:
        taken = _kind_of(name).validate_python(value, strict=strict)
    except ValidationError as error:
        if limits := _range_of(name):
            raise InputError(where, quoted(value), f"{_kind_in_words(name)}, {limits}") from error
        raise refused(error, lambda _: where) from error
    if name == "method" and taken not in (AUTO, *METHODS):
        raise InputError(where, quoted(value), "one of " + ", ".join((AUTO, *METHODS)))
    return taken


def options_in(content: Mapping[str, Any], where: str) -> dict[str, Any]:
    """The options that a file states, each of its own type: no text for a number.

    Args:
        content: Values by the names of options.
        where: Stands before a name in messages, e.g. ``fleet.toml, field options.``

    Raises:
        InputError: A name is not known, or a value is of another type or out of its range.
    """
    known = [option.name for option in fields(BuildOptions)]
    if unknown := next((name for name in content if name not in known), None):
        raise InputError(f"{where}{shortened(unknown)}", "is not known", f"one of {', '.join(known)}")
    return {name: _checked(name, value, f"{where}{name}", strict=True) for name, value in content.items()}
