"""The emitted files: each must be, byte for byte, what the model gives, before a compiler sees it.

`emit_texts` makes the files again in memory; nothing that lies in the folder has a say in what they should be, but for
the options in its record, and that is compared, too.

A folder may come from somebody else, and what is compiled there is run here. The runtime must be, byte for byte, that
of this gyrotc; the table must consist, line by line, of what the emitter writes: numbers, the names it knows, and
comments. Whether the numbers are right is not asked here. The board test is not taken from a folder: it is made again.
"""

from __future__ import annotations

import functools
import hashlib
import os
import re
import stat
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ..common.errors import CheckFailed, InputError
from ..common.texts import C_COMMENT, C_INITIALISER
from ..mirror.table import Table
from ..model import Model
from ..results.base import NUMERICS
from ..results.files import sha256, write_own
from ..results.marker import EXAMPLE, MARKER
from ..results.release import VerifiedFile
from ..tables.emission import Emission, emit_texts, quantise_all
from ..tables.record import Options, read_options
from ..tables.runtime import RUNTIME_FILES, joint_needs, needs_of, runtime_texts, stated_needs

_SHOWN = 160  # characters of a line
_MAX_OPTION = 60  # of the options that a header states
_MAX_HEADER = 2**18  # bytes of gtc.h, which has 40,000
_BEYOND = 2**16  # bytes that are read of a file beyond its right length


@dataclass(frozen=True, slots=True)
class Job:
    """Input of a verification: emitted C, its tables, and the answers of the reference to its vectors."""

    c_folder: Path
    model: Model
    tables: dict[str, Table]
    expected: dict[str, NDArray[np.uint32]]
    trusted: bool = False  # the user takes the code of the folder as it is


def c_hash(c_folder: Path) -> str:
    """SHA-256 over names and contents of the emitted files."""
    digest = hashlib.sha256()
    for path in sorted(p for p in c_folder.iterdir() if p.is_file() and p.name != MARKER):
        digest.update(f"{path.name} {sha256(path)}\n".encode())
    return digest.hexdigest()


def made_again(c_folder: Path, model: Model) -> tuple[Options, Emission]:
    """Make options and tables of an emitted folder again.

    If its record is damaged, they are those of `gyrotc emit` without options; the record is then among the files that
    differ.

    Raises:
        InputError: There is no emitted folder.
        CheckFailed: `emit` refuses the model.
    """
    if not c_folder.is_dir():
        raise InputError(str(c_folder), "is not there", "a folder that emit wrote")
    try:
        options = read_options(c_folder)
        return options, quantise_all(options.shifted(model), options.numeric)
    except (InputError, CheckFailed):
        options = Options()
        return options, quantise_all(model, None)


def texts_again(model: Model, options: Options, emission: Emission) -> dict[str, bytes]:
    """Return the contents that an emitted folder must have, by name."""
    return emit_texts(
        model,
        emission,
        asked=options.numeric is not None,
        zero_at=options.zero_at_c,
        runtime_apart=options.runtime is not None,
    )


def runtime_place(c_folder: Path) -> Path:
    """Return the folder of the runtime of an emitted folder: the folder itself, or that of its fleet."""
    try:
        shared = read_options(c_folder).runtime
    except InputError:  # the record is then among the files that differ
        shared = None
    return c_folder / shared if shared else c_folder


def shared_runtime_entries(c_folder: Path, model: Model, shared: str) -> Iterator[VerifiedFile]:
    """One entry for each file of the runtime that a gyro shares with its fleet.

    The options that `gtc.h` states may be larger than this gyro needs, as other gyros of the fleet may need more.
    """
    place = c_folder / shared
    header = _content(place / "gtc.h", _MAX_HEADER) or b""
    for name, data in runtime_texts(_needs_beside(header, model), NUMERICS).items():
        found = _content(place / name, len(data))
        if found is None:
            yield VerifiedFile(file=f"{shared}/{name}", verdict="missing", status="fail", mismatches=1)
        elif found == data:
            yield VerifiedFile(file=f"{shared}/{name}", verdict="equal", status="pass", mismatches=0)
        else:
            yield _differing(f"{shared}/{name}", found, data, allowed=False)


def _needs_beside(header: bytes, model: Model) -> dict[str, int]:
    """Return what a model and the other tables of its runtime need, as the runtime's header states it."""
    needs = needs_of(model)
    stated = stated_needs(header.decode("latin-1"))
    return joint_needs([needs, {name: min(value, _MAX_OPTION) for name, value in stated.items() if name in needs}])


def file_entries(c_folder: Path, texts: Mapping[str, bytes]) -> Iterator[VerifiedFile]:
    """One entry for each file that should be there or is.

    Args:
        c_folder: The emitted folder.
        texts: What must lie there, by name.
    """
    there = set(os.listdir(c_folder))  # noqa: PTH208 names, not paths
    for name, data in sorted(texts.items()):
        if name not in there:
            yield VerifiedFile(file=name, verdict="missing", status="fail", mismatches=1)
            continue
        found = _content(c_folder / name, len(data))
        if found == data:
            yield VerifiedFile(file=name, verdict="equal", status="pass", mismatches=0)
        else:
            yield _differing(name, found, data, allowed=f"c/{name}" == EXAMPLE)
    for name in sorted(there - set(texts) - {MARKER}):
        yield VerifiedFile(file=name, verdict="foreign", status="fail", mismatches=1)


def _content(path: Path, length: int) -> bytes | None:
    """Bytes of a regular file, as many as are needed to compare; None for anything else, which is not opened."""
    try:
        if not stat.S_ISREG(path.lstat().st_mode):
            return None
        with path.open("rb") as file:
            return file.read(length + _BEYOND)
    except OSError:
        return None


def _differing(name: str, found: bytes | None, data: bytes, *, allowed: bool) -> VerifiedFile:
    """Compare a file; return how much differs, and the first place: a line, or a word of an image."""
    if found is None:
        what = "no regular file that can be read"
        return VerifiedFile(file=name, verdict="differs", status="fail", mismatches=1, found=what)
    image = name.endswith(".bin")
    parts = _words if image else _lines
    got, want = parts(found), parts(data)
    pairs = zip(got, want, strict=False)
    wrong = [number for number, (a, b) in enumerate(pairs, 1) if a != b]
    first = wrong[0] if wrong else min(len(got), len(want)) + 1
    there, expected = (side[first - 1] if first <= len(side) else "nothing" for side in (got, want))
    return VerifiedFile(
        file=name,
        verdict="edited" if allowed else "differs",
        status="pass" if allowed else "fail",
        mismatches=len(wrong) + abs(len(got) - len(want)),
        found=there,
        expected=expected,
        **{"word" if image else "line": first},
    )


def _words(data: bytes) -> list[str]:
    """Words of an image in the order of its bytes."""
    return [data[start : start + 4].hex() for start in range(0, len(data), 4)]


def _lines(data: bytes) -> list[str]:
    """Lines as printable text; what is no ASCII, and a carriage return, shows as an escape."""
    return [_shown(line) for line in data.split(b"\n")]


def _shown(line: bytes) -> str:
    return line.decode("latin-1").encode("unicode_escape").decode("ascii")[:_SHOWN]


Check = Callable[[bytes], str | None]

_MAX_BYTES = 16 * 2**20  # 16 MiB: bounds what is read of a folder that is not trusted
_N = r"(f32|q31)"
_TEXT = C_COMMENT.pattern
_NOTE = rf"(?: +/\* {_TEXT} \*/)?"
_CELLS = C_INITIALISER.pattern
_HEX = "0x[0-9a-f]{8}UL"

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
_ANY = ("", "#endif", r"/\* <text> \*/")


def table_files(c_folder: Path, model: Model, numerics: Sequence[str]) -> dict[str, Check]:
    """Runtime and table of a model in these arithmetics, each with what it must be."""
    header = _content(runtime_place(c_folder) / "gtc.h", _MAX_HEADER) or b""
    needs = _needs_beside(header, model)
    runtime = [name for name in RUNTIME_FILES if name == "gtc.h" or any(name == f"gtc_{n}.c" for n in numerics)]
    return {
        **{name: functools.partial(_runtime, name, needs) for name in runtime},
        f"gtc_{model.id}.h": _grammar(_TABLE_H, model),
        f"gtc_{model.id}.c": _grammar(_TABLE_C, model),
    }


def checked_sources(c_folder: Path, work: Path, files: Mapping[str, Check], *, trusted: bool = False) -> Path:
    """The folder to compile from: `work` with a copy of these files, and of nothing else.

    Args:
        trusted: The user takes the folder as it is; one that is complete by itself is compiled where it lies.

    Raises:
        CheckFailed: A file is missing, or is not what gyrotc writes.
    """
    runtime = runtime_place(c_folder)
    if trusted and runtime == c_folder:
        return c_folder
    for name, check in files.items():
        path = (runtime if name in RUNTIME_FILES else c_folder) / name
        if not path.is_file():
            raise CheckFailed(f"{path} is missing")
        if path.stat().st_size > _MAX_BYTES:
            raise CheckFailed(f"{path} is larger than {_MAX_BYTES} bytes")
        data = path.read_bytes()
        fault = None if trusted else check(data)
        if fault is not None:
            raise CheckFailed(
                f"{path} {fault}: it is not compiled, as its code would run on this machine; emit it again"
            )
        write_own(work / name, data)
    return work


def _runtime(name: str, needs: Mapping[str, int], data: bytes) -> str | None:
    """Test a file of the runtime: it is what this gyrotc makes with the options that the file's header states."""
    for numerics in (NUMERICS, *((n,) for n in NUMERICS)):
        if runtime_texts(needs, numerics).get(name) == data:
            return None
    return "is not the runtime of this gyrotc"


def _grammar(lines: Sequence[str], model: Model) -> Check:
    """A check that a file is one comment, and then nothing but lines of these forms."""
    names = {"id": model.id, "symbol": model.symbol, "SYMBOL": model.symbol.upper()}
    parts = {
        "<n>": _N, "<note>": _NOTE, "<text>": _TEXT, "<cells>": _CELLS, "<hex>": _HEX,
        "<name>": '[^\\x00-\\x1f"?%\\\\\\x7f-\\xff]{1,67}',
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
