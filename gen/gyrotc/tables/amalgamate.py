"""The runtime as one header and one source, made from `include/` and `libc/`.

Includes of the runtime's own files are expanded; the algorithm's text is expanded once for each
arithmetic asked for, and the names that an arithmetic defines for it are undefined behind it.
"""

from __future__ import annotations

import functools
import re
from collections.abc import Iterator
from pathlib import Path

_HEADERS = ("gtc_config.h", "gtc_table.h", "gtc_private_state.h", "gtc_angle.h", "gtc.h")
ARITHMETICS = ("f32", "q31")
LEARNING = "gtc_learn.h"
_INCLUDE = re.compile(r'^#include "(?P<name>gtc[a-z0-9_.]*)"$')
_DEFINE = re.compile(r"^#define (?P<name>[A-Z][A-Z0-9_]*)")
_CONFIG = "#include GTC_CONFIG_HEADER\n#endif\n"
# REUSE-IgnoreStart
_LICENCE = " * SPDX-License-Identifier: MIT"
# REUSE-IgnoreEnd


@functools.cache
def amalgamate(
    include_dir: Path, libc_dir: Path, *, numerics: tuple[str, ...] = ARITHMETICS, learns: bool = False
) -> tuple[str, str]:
    """Texts of `gtc.h` and `gtc.c`. Depends on the files alone, which are read once in a process.

    `gtc.h` includes a `gtc_config.h` beside it, with the options of the tables (`tables.emit`).

    Args:
        include_dir, libc_dir: As `common.runtime.runtime_folders` gives them.
        numerics: The arithmetics that `gtc.c` holds; `gtc.h` declares all.
        learns: With learning in service, which brings float32; `LEARNING` is then to stand beside `gtc.h`.
    """
    header = "\n".join(_without_includes(include_dir / name) for name in _HEADERS)
    header = header.replace(_CONFIG, _CONFIG + '#include "gtc_config.h"\n', 1)
    seen: set[str] = set()
    parts = [_banner(), f'#include "{LEARNING if learns else "gtc.h"}"\n\n#include <stddef.h>\n']
    parts.append("".join(_expanded(libc_dir / "gtc_crc.c", libc_dir, seen)))
    for arithmetic in ARITHMETICS:
        learning = learns and arithmetic == "f32"
        if arithmetic in numerics or learning:
            own = seen | {LEARNING}
            text = "".join(_expanded(libc_dir / f"gtc_{arithmetic}.c", libc_dir, own))
            if learning:
                text += "".join(_expanded(libc_dir / "gtc_learn.c", libc_dir, own))
            parts.append(text + _undefined(text))
    return _one_licence(header), _one_licence("\n".join(p for p in parts if p))


def _banner() -> str:
    return (
        "/* gtc.c - the gyrotc runtime in one file; gtc.h is its manual.\n"
        " *\n"
        " * Made from the files of libc/ by gyrotc; do not edit. Compile it as C99; float32 needs\n"
        " * -std=c99 -ffp-contract=off, and -ffunction-sections -fdata-sections with --gc-sections leave\n"
        " * only what is used.\n"
        " *\n"
        f"{_LICENCE}\n"
        " */\n"
    )


def _without_includes(path: Path) -> str:
    lines = path.read_text(encoding="ascii").splitlines()
    return "\n".join(line for line in lines if not _INCLUDE.match(line)) + "\n"


def _expanded(path: Path, libc_dir: Path, seen: set[str]) -> Iterator[str]:
    """Lines of a file, its own includes expanded where they first occur."""
    for line in path.read_text(encoding="ascii").splitlines():
        match = _INCLUDE.match(line)
        if match is None:
            if line != "#include <stddef.h>":
                yield line + "\n"
        elif match["name"] != "gtc.h" and match["name"] not in seen:
            seen.add(match["name"])
            yield from _expanded(libc_dir / match["name"], libc_dir, seen)


def _undefined(text: str) -> str:
    """#undef of every macro that a group defines, but not of include guards and options."""
    names = [m["name"] for line in text.splitlines() if (m := _DEFINE.match(line))]
    own = dict.fromkeys(n for n in names if not n.startswith("GTC_"))
    return "".join(f"#undef {name}\n" for name in own)


def _one_licence(text: str) -> str:
    """The licence's line once, at the top."""
    first, mark, rest = text.partition(_LICENCE)
    return first + mark + rest.replace(f" *\n{_LICENCE}\n", "")
