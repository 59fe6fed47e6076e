"""The campaigns of `make bench`: their names, what each answers, how long it takes, and what a user may set."""

from __future__ import annotations

import importlib
import sys
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Protocol, cast

from .page import ResultsTable
from .records import ROOT, Record


def say(text: str) -> None:
    """Print a line of progress to standard error."""
    print(text, file=sys.stderr, flush=True)


@dataclass(frozen=True, slots=True)
class Settings:
    """Settings of a campaign that a user may choose.

    Attributes:
        quick: Run a first small part of each kind of case, to see that the campaign works; no record is kept.
        seed: First seed of what is drawn; None means the campaign's own, or a fresh one that is printed.
        base: For `oracle`: the commit whose results are compared with those of this tree.
        only: For campaigns of named sets: the sets to take; empty means all.
        real: Folder with a folder for each measured set of recordings.
        workers: Processes.
    """

    quick: bool = False
    seed: int | None = None
    base: str = ""
    only: tuple[str, ...] = ()
    real: Path = field(default=ROOT.parent / "shared" / "data" / "real")
    workers: int = 2


class Module(Protocol):
    """A module of a campaign, `bench.<name>`."""

    measure: Callable[[Settings], Record]
    """Run the campaign and return its record."""
    table: Callable[[Record], ResultsTable]
    """Return the table of docs/results.md that a record gives."""


@dataclass(frozen=True, slots=True)
class Campaign:
    """A campaign.

    Attributes:
        title: What it measures; heading of its table.
        takes: How long it takes on two cores.
        peers: True if it runs beside other libraries, which are installed into build/bench.
        keeps_record: False if its result is printed only.
    """

    title: str
    takes: str
    peers: bool = False
    keeps_record: bool = True


CAMPAIGNS = {
    "accuracy": Campaign("Accuracy and training time", "an hour", peers=True),
    "runtime": Campaign("Instructions, flash and RAM of the C runtime", "ten minutes", peers=True),
    "growth": Campaign("CPU time and memory of commands", "an hour", peers=True),
    "splits": Campaign("Measured gyros: error on held-out history", "ten minutes"),
    "rows": Campaign("Events and faults planted in recordings", "an hour"),
    "faults": Campaign("Faults in service: stated sigma and status", "half an hour"),
    "sigma": Campaign("Uncertainty stated by the runtime", "half an hour"),
    "signals": Campaign("Channels as inputs of the map", "half an hour"),
    "lot": Campaign("Many units: planted faults, new units, returned units", "two hours"),
    "budget": Campaign("Uncertainty stated by the report", "half an hour"),
    "kills": Campaign("Jobs interrupted by signals and disk errors", "an hour"),
    "invariance": Campaign("Diagnosis of equivalent recordings", "half an hour"),
    "mutation": Campaign("Small faults planted in the generator, and whether its tests find them", "a day"),
    "oracle": Campaign(
        "Results that differ from those of another commit (BASE=commit)", "half an hour", keeps_record=False
    ),
}


def module_of(name: str) -> Module:
    """Return the module of a campaign; it is imported when it is needed, since each brings libraries of its own."""
    return cast(Module, importlib.import_module(f"bench.{name}"))
