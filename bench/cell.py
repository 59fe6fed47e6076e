"""One measurement in a process of its own: `python -m bench.cell KIND NAME [ARGUMENT]...` prints JSON.

CPU seconds of this process, the best of several batches where a run is short; peak memory of the whole process.
"""

from __future__ import annotations

import json
import math
import resource
import sys
import time
from collections.abc import Callable
from typing import Any

from . import learning, pieces, problems, selection

WIDTHS = (0.15, 0.22, 0.33, 0.5, 0.75, 1.1, 1.6)
LIMIT_S = 150  # CPU seconds of a process; the system ends it there
_SHORT_S = 1.0
_REPEATS = 5
_BATCH_S = 0.2


def measured(run: Callable[[], Any]) -> tuple[float, Any]:
    """(CPU seconds, result); of short runs the best of five batches, as the clock ticks in 4 ms."""
    began = time.process_time()
    result = run()
    best = time.process_time() - began
    if best > _SHORT_S:
        return best, result
    batch = math.ceil(_BATCH_S / max(best, 1e-3))
    batches = []
    for _ in range(_REPEATS):
        began = time.process_time()
        for _ in range(batch):
            run()
        batches.append((time.process_time() - began) / batch)
    return min(batches), result


def _selection(name: str, n: str, n_t: str, n_r: str, widths: str, centers: str) -> dict[str, Any]:
    run = selection.CONTESTANTS[name]
    t, r, y = problems.cloud(200)
    run((t, r, y, (4, 3), (0.5,), 3))  # imports
    t, r, y = problems.cloud(int(n))
    ladder = WIDTHS if int(widths) == len(WIDTHS) else (0.5,)
    seconds, rms = measured(lambda: run((t, r, y, (int(n_t), int(n_r)), ladder, int(centers))))
    return {"seconds": seconds, "rms": rms}


def _learning(name: str, scenario: str, seed: str) -> dict[str, Any]:
    unit = problems.gyro(scenario, int(seed))
    data = problems.joined(unit.train)
    learn = learning.CONTESTANTS[name]
    learn(data.select(slice(None, None, 60)))  # type: ignore[arg-type]  # imports
    seconds, (predictor, size) = measured(lambda: learn(data))
    return {"seconds": seconds, "ratio": problems.ratio(predictor, unit), "bytes": size}


def _kohonen(name: str, n: str, m: str) -> dict[str, Any]:
    seconds, distance = measured(pieces.KOHONEN[name](int(n), int(m)))
    return {"seconds": seconds, "rms_distance": distance}


def _varpro(name: str) -> dict[str, Any]:
    seconds, rms = measured(pieces.VARPRO[name]())
    return {"seconds": seconds, "rms": rms}


KINDS: dict[str, Callable[..., dict[str, Any]]] = {
    "selection": _selection,
    "learning": _learning,
    "kohonen": _kohonen,
    "varpro": _varpro,
}


def main(arguments: list[str]) -> None:
    resource.setrlimit(resource.RLIMIT_CPU, (LIMIT_S, LIMIT_S + 10))
    result = KINDS[arguments[0]](*arguments[1:])
    result["peak_gib"] = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 2**20
    print(json.dumps(result))


if __name__ == "__main__":
    main(sys.argv[1:])
