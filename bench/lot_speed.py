"""`python -m bench.lot_speed docs`: processor time and memory of learning from 50 ... 400 units.

The units are simulated from physics, each for itself: copies of a few with noise of their own would be as many
clusters, and what was measured were the search for these. Each number of units has a process of its own, so that its
memory is what it needs.
"""

from __future__ import annotations

import multiprocessing
import resource
import sys
import time
from pathlib import Path

from gyrotc.simulate.campaign import with_noise
from gyrotc.simulate.lot import LotOrder, draw_lot
from gyrotc.simulate.scenario import read
from gyrotc.train.data import cleaned, scaling_of
from gyrotc.train.means import UnitMeans, unit_means

from .lot_prior import learnt, recorded

ROOT = Path(__file__).resolve().parents[1]

_UNITS = (50, 100, 200, 400)
_SEED, _FAMILY = 4711, 0.73


def _measured(units: list[UnitMeans]) -> dict[str, float]:
    before, began = time.process_time(), time.perf_counter()
    prior = learnt(units)
    return {
        "units": len(units),
        "cpu_s": time.process_time() - before,
        "wall_s": time.perf_counter() - began,
        "memory_mib": resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024.0,
        "clusters": len(prior.means),
        "directions": len(prior.lot.directions),
    }


def main(arguments: list[str]) -> int:
    from .lot_prior_page import write_page

    docs = ROOT / arguments[0]
    drawn = draw_lot(with_noise(read("paper")[1], "paper"), LotOrder(max(_UNITS), _FAMILY, 1, 0), _SEED)
    units = [unit_means(cleaned(d), scaling_of(d), None)[0] for d, _ in recorded(drawn, exam=False)]
    found = []
    for n in _UNITS:
        with multiprocessing.get_context("spawn").Pool(1) as pool:
            found.append(pool.map(_measured, [units[:n]])[0])
        print(found[-1], flush=True)
    write_page(docs, {"speed": found})
    return 0


if __name__ == "__main__":
    raise SystemExit(main(sys.argv[1:]))
