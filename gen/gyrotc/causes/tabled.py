"""How a cause stands in a table: the kind of its record and the record's parameters."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from decimal import Context, Decimal

from ..target.arithmetic import FLOAT64
from ..target.recursion import Recursion, TableKind, recursion_of

__all__ = ["Tabled", "blocks_per_tau", "half_block_before", "memory_gain", "octaves_per_block", "turns"]


@dataclass(frozen=True, slots=True)
class Tabled:
    """How a cause stands in a table.

    Attributes:
        kind: Recursion of the target.
        parameters: Parameters of the record (docs/FORMAT.md, section 3) from those of the cause and the length
            of a block in s.
    """

    kind: TableKind
    parameters: Callable[[Mapping[str, float], float], list[float]]

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
    """How many times exp(-t/tau) halves in a block."""
    return 1.4426950408889634 * block_s / tau_s  # log2(e)


def turns(phase_rad: float) -> float:
    """A phase in turns, -1/2 ... 1/2."""
    whole = phase_rad / (2.0 * math.pi)
    return whole - round(whole)
