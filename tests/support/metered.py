"""The meter of bare targets on trial: functions whose instructions and stack are known by counting."""

from __future__ import annotations

import re
from pathlib import Path

from gyrotc.verify import all_targets, compile_c, run_program

HERE = Path(__file__).resolve().parent


def metered(name: str, work: Path) -> tuple[float, int]:
    """Counts of `counted` and bytes of `stacked` in meter.c, an empty call taken off, as `verify` computes them."""
    target = all_targets()[name]
    compile_c(target, [HERE / "meter.c"], work / "meter", include=HERE)
    run = run_program(target, work / "meter")
    text = run.stdout.decode("ascii") + run.stderr
    words = [int(word, 16) for word in re.findall(r"(?:^|m)([0-9a-f]{8})\.?$", text, re.MULTILINE)]
    assert len(words) == 8, text
    nothing, counted, again, stacked = words[0::2], words[2], words[4], words[7]
    assert abs(again - nothing[0]) <= 1, "an empty call costs the same every time"
    return (counted - again) / target.ticks_per_count, stacked - words[5]
