"""One model through the gyrotc that PYTHONPATH names: emit, the independent check, then verify. Prints who objects.

    python drive.py MODEL OUT CHECK_TABLE

One line of JSON: `seen_by` (`generator`, `check_table`, `verify` or null) and `reported`, the first words of it.
"""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

# An editable installation finds its own gyrotc before PYTHONPATH is looked at.
sys.meta_path = [finder for finder in sys.meta_path if "gyrotc" not in type(finder).__module__]

import gyrotc  # noqa: E402
from gyrotc.common.errors import CheckFailed, InputError  # noqa: E402
from gyrotc.model import load_model  # noqa: E402
from gyrotc.tables.emit import emit  # noqa: E402
from gyrotc.tables.quantise import NUMERICS  # noqa: E402
from gyrotc.verify.job import verify  # noqa: E402

#: One target suffices: what is wrong is the generator, not a compiler.
TARGET = "host-gcc-O2"


def objection(model_path: Path, out: Path, check_table: Path) -> tuple[str | None, str]:
    """Who objects to what is emitted, and how."""
    if Path(gyrotc.__file__).parents[1] != Path.cwd():
        raise ImportError(f"{gyrotc.__file__} is not the changed generator")
    model = load_model(model_path)
    try:
        emit(model, out, numerics=NUMERICS)  # a fault that makes it refuse one of them is seen
    except (CheckFailed, InputError, ValueError, TypeError, KeyError, IndexError, ArithmeticError) as error:
        return "generator", f"{type(error).__name__}: {error}"
    model.save(out / "model.json")
    done = subprocess.run(
        [sys.executable, "-I", "-S", str(check_table), str(out)], capture_output=True, text=True, check=False
    )
    if done.returncode != 0:
        lines = [line for line in (done.stdout + done.stderr).splitlines() if "largest departure" not in line]
        return "check_table", lines[0]
    # The folder is that of a gyrotc with a fault: verify trusts its own text, so the answers decide.
    result = verify(out, targets=(TARGET,)).content()
    for entry in result["targets"]:
        if entry["status"] != "pass":
            return (
                "verify",
                f"{entry['numeric']}: {entry['status']}, {entry.get('mismatches')} answers differ",
            )
    return None, ""


if __name__ == "__main__":
    seen_by, reported = objection(*(Path(word) for word in sys.argv[1:4]))
    print(json.dumps({"seen_by": seen_by, "reported": reported}))
