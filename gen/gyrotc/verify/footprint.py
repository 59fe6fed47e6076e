"""What table and runtime take in ROM and RAM of a target: linked as a program uses them, and measured."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from ..common.texts import c_environment
from ..model import Model
from ..store.opening import write_own
from ..store.scratch import scratch_folder
from ..tables.example import example_period_us
from ..target.table import Table
from .source import checked_sources, table_files
from .toolchain import Target, all_targets, compile_objects, link, symbols

__all__ = ["Footprint", "footprint"]

_TARGETS = ("cortex-m4f", "host-gcc-O2")  # the first that can be built here
_STATE = "footprint_state"


@dataclass(frozen=True, slots=True)
class Footprint:
    """Bytes on a target: code and constants of everything linked; the caller's state."""

    target: str
    rom_bytes: int
    ram_bytes: int


def footprint(c_folder: Path, model: Model, table: Table, *, trusted: bool = False) -> Footprint | None:
    """Links self-test, init, sample and bias of a table for a Cortex-M4F, or the host where there is none.

    Returns:
        The sizes; None where nothing can be compiled.

    Raises:
        CheckFailed: The compiler refused the emitted code, or it is not gyrotc's and not `trusted`.
    """
    target = next((t for name in _TARGETS if (t := all_targets()[name]).missing() is None), None)
    if target is None:
        return None
    text = (
        c_environment()
        .get_template("footprint.c.j2")
        .render(
            id=model.id,
            symbol=model.symbol,
            n=table.numeric,
            n_channels=table.n_channels,
            period_us=example_period_us(model),
        )
    )
    with scratch_folder() as work:
        source = work / "footprint.c"
        write_own(source, text)
        c = checked_sources(c_folder, work, table_files(model), trusted=trusted)
        return _measured(target, c, [c / "gtc.c", c / f"gtc_{model.id}.c"], source)


def _measured(target: Target, c_folder: Path, sources: list[Path], main: Path) -> Footprint:
    objects = compile_objects(target, sources, main.parent, include=c_folder)
    program = main.parent / "footprint"
    link(target, [*objects, *compile_objects(target, [main], main.parent, include=c_folder)], program)
    own = {symbol.name for symbol in symbols(target, *objects)}
    linked = symbols(target, program)
    state = next(symbol.size for symbol in linked if symbol.name == _STATE)
    return Footprint(target.name, sum(symbol.size for symbol in linked if symbol.name in own), state)
