"""Write the runtime that tables need: `gtc.h`, `gtc.c`, and their options.

`gtc_config.h` names the smallest runtime that holds the tables, and what each of its options costs: the costs were
measured (`make bench ONLY=runtime`) and are in `costs.json`.
"""

from __future__ import annotations

import functools
import json
from collections.abc import Collection, Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any

from ..common.inputs import runtime_folders
from ..common.texts import c_environment
from ..model import Model, RuntimePart
from .rounding import channel_names
from .text import amalgamate

CONFIG = "gtc_config.h"
RUNTIME_FILES = ("gtc.h", "gtc.c", CONFIG)
"""Files of the runtime, the same for all tables but for the options in the last."""
COSTS = Path(__file__).resolve().parent / "costs.json"
#: Options of gtc_config.h by the part that a product may leave out.
SWITCHES: dict[RuntimePart, str] = {
    "uncertainty": "GTC_WITH_UNCERTAINTY",
    "rezero": "GTC_WITH_REZERO",
    "coverage": "GTC_WITH_COVERAGE",
    "known_answers": "GTC_WITH_PROBES",
    "image": "GTC_WITH_IMAGE",
    "saved_state": "GTC_WITH_SAVE",
    "time": "GTC_WITH_TIME",
}


def needs_of(model: Model) -> dict[str, int]:
    """Return the smallest options of the runtime that hold the tables of a model, by name."""
    needs = {
        "GTC_MAX_SLOPE_BLOCKS": model.slope_blocks,
        "GTC_MAX_TERMS": max(len(model.terms), len(channel_names(model))),
        "GTC_WITH_BANK": int(len(model.networks) > 1),
    }
    return needs | {switch: int(part not in model.left_out) for part, switch in SWITCHES.items()}


def joint_needs(needs: Iterable[Mapping[str, int]]) -> dict[str, int]:
    """Return the options that several tables need together: the larger number of each."""
    joint: dict[str, int] = {}
    for one in needs:
        joint |= {name: max(value, joint.get(name, 0)) for name, value in one.items()}
    return joint


def runtime_texts(needs: Mapping[str, int], numerics: Collection[str]) -> dict[str, bytes]:
    """Return the files of the runtime by name.

    Args:
        needs: Options by name, as of `needs_of`.
        numerics: The arithmetics that it holds.
    """
    header, source = amalgamate(*runtime_folders(), numerics=tuple(sorted(numerics)))
    return {"gtc.h": header.encode("ascii"), "gtc.c": source.encode("ascii"), CONFIG: config_text(needs)}


def config_text(needs: Mapping[str, int]) -> bytes:
    """Return `gtc_config.h` with these options."""
    template = c_environment().get_template("gtc_config.h.j2")
    text = template.render(
        options=[{"name": name, "value": value} for name, value in needs.items()], cost_lines=list(_cost_lines(needs))
    )
    return text.encode("ascii")


@functools.cache
def _costs() -> dict[str, Any]:
    found: dict[str, Any] = json.loads(COSTS.read_text("ascii"))
    return found


def _cost_lines(needs: Mapping[str, int]) -> Iterator[str]:
    """A table of the costs in a comment: flash/RAM/stack by core and level."""
    costs = _costs()
    yield f"{'':<28} " + " ".join(f"{column:>16}" for column in costs["columns"])
    for row in costs["rows"]:
        cells = ("/".join(map(str, cell)) for cell in row["cells"])
        state = f"{needs.get(row['option'], 0)}"
        yield f"{row['name']:<24} {state:>3} " + " ".join(f"{cell:>16}" for cell in cells)
