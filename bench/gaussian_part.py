"""Instructions of one Gaussian of a channel, counted in the object code of a bent line on a Cortex-M4F.

An instruction belongs to the function of the C text whose line the compiler made it for. In the code of a bent line the
Gaussian with all that it calls is inlined twice, beside the straight line and the sums that any term has.
"""

from __future__ import annotations

import re
import tempfile
from collections import Counter
from pathlib import Path

from gyrotc.model import load_model
from gyrotc.tables.emit import emit
from gyrotc.tables.quantise import NUMERICS
from gyrotc.verify.toolchain import all_targets, disassembly, runtime_object

__all__ = ["gaussian_instructions"]

ROOT = Path(__file__).resolve().parents[1]
_MODEL = ROOT / "tests" / "c" / "model_curve.json"
_OPENS = re.compile(r"(?:GTC_IN_LOOP|static|const|int|float)\b.*?FN\((\w+)\)\(")
_HEAD = re.compile(r"[0-9a-f]+ <(\w+)>:$")
_LINE = re.compile(r"\S*?gtc\.c:(\d+)(?: \(discriminator \d+\))?$")
_INSTRUCTION = re.compile(r"\s+[0-9a-f]+:\t(?!\.(?:word|short|byte))")
_GAUSSIANS = 2  # of a bent line
_OF_GAUSSIAN = {"bell", "exp2", "high_of_squares", "high", "weighted", "accumulate"}


def gaussian_instructions() -> dict[str, float]:
    """Of one Gaussian, by arithmetic."""
    target = all_targets()["cortex-m4f"]
    with tempfile.TemporaryDirectory(prefix="gyrotc-part-") as place:
        emit(load_model(_MODEL), Path(place))
        c, work = Path(place) / "c", Path(place) / "work"
        work.mkdir()
        rows = disassembly(target, runtime_object(target, c, work).put(work / "gtc.o"))
        owner = _owners((c / "gtc.c").read_text("ascii"))
    return {n: _counted(rows, owner, f"gtc_{n}_curve_apply") / _GAUSSIANS for n in NUMERICS}


def _owners(text: str) -> list[str]:
    """The function that every line of the text stands in, or the last one before it."""
    found, name = [], ""
    for line in text.splitlines():
        opens = _OPENS.match(line)
        name = opens[1] if opens and not line.rstrip().endswith(";") else name
        found.append(name)
    return found


def _counted(rows: list[str], owner: list[str], function: str) -> int:
    """Instructions of Gaussians in a function.

    Raises:
        ValueError: The code has none, so that their text has other names now.
    """
    count: Counter[str] = Counter()
    inside, line = False, 0
    for row in rows:
        if head := _HEAD.match(row):
            inside = head[1] == function
        elif where := _LINE.match(row):
            line = int(where[1])
        elif inside and _INSTRUCTION.match(row):
            count[owner[line - 1]] += 1
    if not count["bell"]:
        raise ValueError(f"{function} holds no Gaussian: {dict(count)}")
    return sum(count[name] for name in _OF_GAUSSIAN)
