"""`gtc_config.h` of emitted tables: the smallest runtime that holds them, and what each of its options costs.

The costs were measured (`python -m bench docs --only costs`) and stand in `costs.json`.
"""

from __future__ import annotations

import functools
import json
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

from ..common.texts import c_environment
from ..model import Model, RuntimePart
from .rounding import channel_names

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


def needs_of(models: Sequence[Model]) -> dict[str, int]:
    """The least options of the runtime that hold the tables of all these models, by name."""
    terms = max(max(len(m.terms), len(channel_names(m))) for m in models)
    needs = {
        "GTC_MAX_SLOPE_BLOCKS": max(m.slope_blocks for m in models),
        "GTC_MAX_TERMS": terms,
        "GTC_WITH_BANK": int(any(len(m.networks) > 1 for m in models)),
    }
    return needs | {switch: int(any(part not in m.left_out for m in models)) for part, switch in SWITCHES.items()}


def config_text(models: Sequence[Model]) -> bytes:
    """`gtc_config.h` of the tables of models that stand in one folder."""
    needs = needs_of(models)
    template = c_environment().get_template("gtc_config.h.j2")
    text = template.render(
        options=[{"name": name, "value": value} for name, value in needs.items()],
        cost_lines=list(_cost_lines(needs)),
    )
    return text.encode("ascii")


@functools.cache
def _costs() -> dict[str, Any]:
    found: dict[str, Any] = json.loads(COSTS.read_text("ascii"))
    return found


def _cost_lines(needs: dict[str, int]) -> Iterator[str]:
    """A table of the costs in a comment: flash/RAM/stack by core and level."""
    costs = _costs()
    yield f"{'':<28} " + " ".join(f"{column:>16}" for column in costs["columns"])
    for row in costs["rows"]:
        cells = ("/".join(map(str, cell)) for cell in row["cells"])
        state = f"{needs.get(row['option'], 0)}"
        yield f"{row['name']:<24} {state:>3} " + " ".join(f"{cell:>16}" for cell in cells)
