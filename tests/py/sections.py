"""All tables of all campaigns, made from docs/results/summary.json: a page of the site (`make site`).

`python tests/py/sections.py FILE` writes the page.
"""

from __future__ import annotations

import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[2]
DOCS = ROOT / "docs"
sys.path[:0] = [str(ROOT), *(str(ROOT / "tests" / name) for name in ("py", "targets", "prove"))]

import prove_page  # noqa: E402
import self_test_page  # noqa: E402
import targets_page  # noqa: E402
from results import recorded  # noqa: E402

from bench import (  # noqa: E402  # noqa: E402
    budget,
    faults,
    fleet,
    formats,
    growth,
    importing,
    lot_prior,
    planted,
    recalibration,
    runtime,
    sigma,
    sizes,
    splits,
)
from bench import page as bench_page  # noqa: E402
from tests import events, invariance  # noqa: E402
from tests.blind import both  # noqa: E402
from tests.evidence import run as evidence  # noqa: E402
from tests.kills import page as kills  # noqa: E402
from tests.mutants import page as mutants  # noqa: E402

PAGE = "results-all.md"
SECTIONS: dict[str, Callable[[Any], str]] = {
    "bench": bench_page.section,
    "runtime": runtime.section,
    "sizes": sizes.section,
    "targets": targets_page.section,
    "self-test": self_test_page.section,
    "prove": prove_page.section,
    "budget": budget.section,
    "sigma": sigma.section,
    "faults": faults.section,
    "blind": both.section,
    "events": events.section,
    "evidence": evidence.section,
    "invariance": invariance.section,
    "lot": fleet.lot_section,
    "lot-prior": lot_prior.section,
    "fleet": fleet.section,
    "fleet-kills": fleet.kills_section,
    "growth": growth.section,
    "formats": formats.section,
    "import": importing.section,
    "planted": planted.section,
    "recalibration": recalibration.section,
    "splits": splits.section,
    "kills": kills.section,
    "mutants": mutants.section,
}


def page(docs: Path = DOCS) -> str:
    """The page: the section of every campaign that has a record."""
    head = "# All results\n\nEvery table of every campaign, made from `docs/results/summary.json`.\n"
    found = ((section, recorded(docs, name)) for name, section in SECTIONS.items())
    return "\n".join([head, *(section(record) for section, record in found if record is not None)])


if __name__ == "__main__":
    Path(sys.argv[1]).write_text(page(), "utf-8")
