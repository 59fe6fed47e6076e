"""Words that must not occur in libc/ and include/: types of 8 bits, double, octals, heap, libraries, writable data."""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path

HEADERS = {"stddef.h", "stdint.h", "arm_acle.h"}
WORDS = {
    r"\bu?int(_fast)?\d+_t\b": "a type that not every compiler has, or of no certain width",
    r"\bu?int_least8_t\b|\b(un)?signed char\b": "a type of 8 bits",
    r"\bchar\b(?! \*serial;)": "a character",
    r"\bdouble\b|\blong float\b": "double",
    r"\b(m|c|re)alloc\b|\bfree\b|\balloca\b": "the heap",
    r"\bmem(cpy|set|cmp|move)\b|\bstr[a-z]+\b\(": "the C library",
    r"\b(printf|puts|putchar|abort|exit|assert)\b": "the C library",
    r"\b(expf?|powf?|logf?|sqrtf?|fabsf?|cosf?|sinf?|floorf?|fmaf?|ldexpf?)\(": "the mathematical library",
    r"\b(goto|setjmp|longjmp|asm|__asm__)\b": "a jump or assembly",
    r"(?<![\w.])(\d+\.\d*|\.\d+)(e[+-]?\d+)?(?![\d.eFf])": "a constant of type double",
    r"\b0x[0-9a-f.]+p[+-]?\d+(?![\dF])": "a constant of type double",
    # cppcheck looks for these (MISRA C:2012, rule 7.1) in the files that it is called with, not in what they include.
    r"(?<![\w.])0[0-7]+[uUlL]*\b(?!\.)": "an octal constant",
    r"^static (?!inline\b|const\b)[^(\n]*(=|;)": "writable static data",
}
_NOT_CODE = re.compile(r"/\*.*?\*/|\"(\\.|[^\"\\\n])*\"|'(\\.|[^'\\\n])*'", re.DOTALL)
_INCLUDE = re.compile(r"^#include <(.*)>", re.MULTILINE)


def files(root: Path) -> list[Path]:
    """Every file of the runtime."""
    return sorted(p for folder in ("include", "libc") for p in (root / folder).glob("gtc*.[chi]*"))


def code(path: Path) -> str:
    """The text without comments and strings; lines stay where they are."""
    return _NOT_CODE.sub(lambda m: "\n" * m[0].count("\n"), path.read_text(encoding="ascii"))


def _place(root: Path, path: Path, text: str, at: int) -> str:
    return f"{path.relative_to(root)}:{text.count(chr(10), 0, at) + 1}"


def forbidden_words(root: Path) -> Iterator[str]:
    """Words and headers that the runtime must do without."""
    for path in files(root):
        text = code(path)
        for pattern, what in WORDS.items():
            for match in re.finditer(pattern, text, re.MULTILINE):
                yield f"{_place(root, path, text, match.start())}: {match[0].strip()!r} is {what}"
        for match in _INCLUDE.finditer(text):
            if match[1] not in HEADERS:
                yield f"{_place(root, path, text, match.start())}: header <{match[1]}>"
