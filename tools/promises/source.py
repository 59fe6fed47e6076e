"""Promises about the text of libc/ and include/: words that must not occur, size of functions."""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path

MOST_LINES = 40
MOST_WAYS = 10  # cyclomatic complexity
MOST_PARAMETERS = 5
#: More parameters than that, and why: its arguments are the registers of the loop that it continues.
MANY_PARAMETERS = {"narrow"}

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
    r"^static (?!inline\b|const\b)[^(\n]*(=|;)": "writable static data",
}
_NOT_CODE = re.compile(r"/\*.*?\*/|\"(\\.|[^\"\\\n])*\"|'(\\.|[^'\\\n])*'", re.DOTALL)
_INCLUDE = re.compile(r"^#include <(.*)>", re.MULTILINE)
_FUNCTION = re.compile(
    r"^(?!#|typedef\b)(?P<head>[A-Za-z][^;{}=#]*\))\n\{\n(?P<body>.*?)^\}$", re.DOTALL | re.MULTILINE
)
_NAME = re.compile(r"(?:FN\((\w+)\)|(\w+))\((?P<parameters>[^()]*(?:\([^()]*\)[^()]*)*)\)$", re.DOTALL)
_WAYS = re.compile(r"\b(?:if|for|while|case)\b|&&|\|\||\?")


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


def long_functions(root: Path) -> Iterator[str]:
    """Functions of too many lines, ways or parameters; that functions were found at all."""
    found = 0
    for path in files(root):
        text = code(path)
        for match in _FUNCTION.finditer(text):
            name = _NAME.search(match["head"])
            if name is None:
                continue
            found += 1
            place = f"{_place(root, path, text, match.start())}: {name[1] or name[2]}"
            lines = match[0].count("\n") + 1
            ways = 1 + len(_WAYS.findall(match["body"]))
            parameters = name["parameters"].count(",") + 1
            if lines > MOST_LINES:
                yield f"{place} has {lines} lines, more than {MOST_LINES}"
            if ways > MOST_WAYS:
                yield f"{place} has {ways} ways, more than {MOST_WAYS}"
            if parameters > MOST_PARAMETERS and (name[1] or name[2]) not in MANY_PARAMETERS:
                yield f"{place} has {parameters} parameters, more than {MOST_PARAMETERS}"
    if found < 100:
        yield f"only {found} functions were recognised"
