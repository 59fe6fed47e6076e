"""Instructions of a snapshot in emulated cores."""

from __future__ import annotations

import re
import tempfile
from pathlib import Path
from typing import Any

from gyrotc.model import load_model
from gyrotc.tables.emit import emit
from gyrotc.verify.toolchain import all_targets, compile_c, run_program

__all__ = ["cost"]

HERE = Path(__file__).resolve().parent
_MODEL = HERE.parent / "examples" / "nav_loop" / "filter_model.json"
_CORES = ("cortex-m0", "cortex-m3", "cortex-m4f", "rv32imac")


def cost() -> list[dict[str, Any]]:
    """For each core and arithmetic: of a correction in force, of a held one; the table of examples/nav_loop."""
    rows = []
    with tempfile.TemporaryDirectory() as place:
        emit(load_model(_MODEL), Path(place))
        c = Path(place) / "c"
        for name in _CORES:
            target = all_targets()[name]
            for numeric in ("f32", "q31"):
                source = Path(place) / f"{name}-{numeric}.c"
                text = (HERE / "snapshot.c").read_text("utf-8")
                source.write_text(f"#define OF_{numeric.upper()} 1\n{text}", "utf-8")
                sources = [source, c / "gtc.c", c / "gtc_sim_0003.c"]
                program = source.with_suffix("")
                compile_c(target, sources, program, include=c)
                run = run_program(target, program)
                printed = run.stdout.decode("ascii") + run.stderr
                words = [int(w, 16) for w in re.findall(r"(?:^|m)([0-9a-f]{8})\.?$", printed, re.MULTILINE)]
                assert len(words) == 4, printed
                counts = [(words[k + 1] - words[k]) / target.ticks_per_count for k in (0, 2)]
                rows.append({"core": name, "numeric": numeric, "in_force": counts[0], "held": counts[1]})
    return rows
