"""Files of a result folder before a compiler sees them: only what gyrotc writes is compiled and run.

A folder may come from somebody else, and what is compiled there is run here. The runtime and the board test must be,
byte for byte, those of this gyrotc; table and vectors must consist, line by line, of what the emitter writes: numbers,
the names it knows, and comments. Whether the numbers are right is not asked here.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

from ..common.errors import CheckFailed
from ..common.runtime import runtime_folders
from ..common.texts import C_COMMENT, C_INITIALISER
from ..model import SERIAL, Model
from ..store.opening import write_own
from ..tables.amalgamate import ARITHMETICS, amalgamate
from ..tables.files import board_test_text

__all__ = ["board_files", "checked_sources", "table_files"]

Check = Callable[[bytes], str | None]

_MAX_BYTES = 16 * 2**20  # 16 MiB: bounds what is read of a folder that is not trusted
_N = r"(f32|q31)"
_TEXT = C_COMMENT.pattern
_NOTE = rf"(?: +/\* {_TEXT} \*/)?"
_CELLS = C_INITIALISER.pattern
_HEX = "0x[0-9a-f]{8}UL"
_INTEGER = "-?[0-9]{1,10}"

# {id}, {symbol} and {SYMBOL} are the table's; a line of a file must match one of its patterns as a whole.
_TABLE_C = (
    r'#include "gtc_{id}\.h"',
    "#include <stddef.h>",
    "#if GTC_TABLE_LAYOUT != [0-9]{{1,3}}",
    r'#error "gtc_{id}\.c was written for table layout [0-9]{{1,3}}: emit it again with the gyrotc of this runtime"',
    r"#define V\(x\) \{{ \.value = \(x\) \}} /\* a float32 number \*/",
    r"#define B\(x\) \{{ \.bits = \(x\) \}}  /\* an integer \*/",
    r"static const gtc_word_t <n>_[a-z]{{1,10}}\[[0-9]{{1,6}}\] = \{{",
    "    (?:<cells>),<note>",
    r"extern const struct gtc_<n>_term_code gtc_\1_term_[a-z_]{{1,16}};",
    r"const gtc_<n>_table_t gtc_{symbol}_\1 = \{{",
    r"    \.[a-z_]{{1,20}} = (?:<cells>),<note>",
    r"\}};",
)
_TABLE_H = (
    "#(?:ifndef|define) GTC_{SYMBOL}_H_INCLUDED",
    '#include "gtc.h"',
    "#ifdef __cplusplus",
    r'extern "C" \{{',
    r"\}}",
    "#define GTC_{SYMBOL}_ID <hex><note>",
    r'#define GTC_{SYMBOL}_[A-Z0-9_]{{1,32}} (?:<cells>|\((?:<cells>)\)|"<name>")<note>',
    r"extern const gtc_<n>_table_t gtc_{symbol}_\1;",
)
_VECTORS_H = (
    "#(?:ifndef|define) VECTORS_{SYMBOL}_INCLUDED",
    "#include <stdint.h>",
    '#define VECTORS_ID "{id}"',
    r"#define VECTORS_[A-Z_]{{1,20}} +(?:<hex>|[0-9]{{1,10}}(?:UL)?|\(<integer>L\))<note>",
    r"static const uint_least32_t vectors_<n>_direct\[VECTORS_DIRECT\]\[2\] = \{{",
    r"    \{{ <hex>, <hex> \}},",
    r"typedef struct \{{",
    "    (?:int kind|uint_least32_t count|int_least32_t start, step, noise|uint_least32_t bits_<n>);",
    r"\}} vectors_segment_t;",
    r"static const vectors_segment_t vectors_segments\[VECTORS_SEGMENTS\] = \{{",
    r"    \{{ VECTORS_[A-Z]{{1,20}}, [0-9]{{1,10}}UL(?:, <integer>L){{3}}(?:, <hex>){{1,2}} \}},",
    r"\}};",
)
_ANY = ("", "#endif", r"/\* <text> \*/")


def table_files(model: Model) -> dict[str, Check]:
    """Runtime and table of a model, each with what it must be."""
    return {
        "gtc.h": lambda data: _runtime(data, 0),
        "gtc.c": lambda data: _runtime(data, 1),
        f"gtc_{model.id}.h": _grammar(_TABLE_H, model),
        f"gtc_{model.id}.c": _grammar(_TABLE_C, model),
    }


def board_files(model: Model, numerics: Sequence[str], n_channels: int) -> dict[str, Check]:
    """The board test of a model with its vectors, beside runtime and table."""
    board = board_test_text(model, numerics, n_channels)
    return table_files(model) | {
        f"vectors_{model.id}.h": _grammar(_VECTORS_H, model),
        "board_test.c": lambda data: None if data == board else "is not the board test of this gyrotc",
    }


def checked_sources(c_folder: Path, work: Path, files: Mapping[str, Check], *, trusted: bool = False) -> Path:
    """The folder to compile from: `work` with a copy of these files, and of nothing else.

    Args:
        trusted: The user takes the folder as it is; then it is compiled where it lies.

    Raises:
        CheckFailed: A file is missing, or is not what gyrotc writes.
    """
    if trusted:
        return c_folder
    for name, check in files.items():
        path = c_folder / name
        if not path.is_file():
            raise CheckFailed(f"{path} is missing")
        if path.stat().st_size > _MAX_BYTES:
            raise CheckFailed(f"{path} is larger than {_MAX_BYTES} bytes")
        data = path.read_bytes()
        fault = check(data)
        if fault is not None:
            raise CheckFailed(
                f"{path} {fault}: it is not compiled, as its code would run on this machine; "
                "emit it again, or say --trust-code if it is your own"
            )
        write_own(work / name, data)
    return work


def _runtime(data: bytes, part: int) -> str | None:
    held = (ARITHMETICS, *((n,) for n in ARITHMETICS))
    ours = (
        amalgamate(*runtime_folders(), numerics=n, bank=bank)[part] for n in held for bank in (False, True)
    )
    return None if data in (text.encode("ascii") for text in ours) else "is not the runtime of this gyrotc"


def _grammar(lines: Sequence[str], model: Model) -> Check:
    """A check that a file is one comment, and then nothing but lines of these forms."""
    names = {"id": model.id, "symbol": model.symbol, "SYMBOL": model.symbol.upper()}
    parts = {
        "<n>": _N, "<note>": _NOTE, "<text>": _TEXT, "<cells>": _CELLS, "<hex>": _HEX, "<integer>": _INTEGER,
        "<serial>": SERIAL.strip("^$"), "<name>": '[^\\x00-\\x1f"?%\\\\\\x7f-\\xff]{1,67}',
    }  # fmt: skip
    filled = (form.format(**names) for form in lines)
    marks = re.compile("|".join(parts))
    forms = [re.compile(marks.sub(lambda mark: parts[mark[0]], form)) for form in (*filled, *_ANY)]

    def check(data: bytes) -> str | None:
        text = data.decode("latin-1")
        head = re.match(rf"/\* {_TEXT}\n(?: \*(?: {_TEXT})?\n)* \*/\n", text)
        number = 1
        if head:
            number += head[0].count("\n")
            text = text[head.end() :]
        for line in text.split("\n"):
            if not any(form.fullmatch(line) for form in forms):
                return f"holds, in line {number}, what gyrotc does not write"
            number += 1
        return None

    return check
