"""Strings that mean something to C, shells, HTML, SVG, TOML, spreadsheets, terminals or file systems."""

from __future__ import annotations

import random

SEED = 20261122
_PARTS = (
    "*/", "/*", "//", "??/", "??=", "\\", "\\\n", "\n", "\r", "\r\n", "\t", "\v", "\f", "\x00", "\x07",
    "\x1b[2J", "\x1b]0;x\x07", "\x7f", "\x85", "\x9b31m", "\u00e4", "\u2028", "\u202e", "\u200b", "\ufeff",
    "\ufffe", "\U0001f600", "\U000e0041", "'", '"', '"""', "'''", "`", "$", "$$", "$(touch x)", "`touch x`",
    "; touch x;", "&& touch x", "| sh", "$\\frac", "\\$", "^{2}$", "%s%n", "%:", "<%",
    "<script>alert(1)</script>", "</script>", "</svg>", "</style>", "</title>", '" onload="alert(1)',
    "' onclick='x", "<img src=x onerror=x>", "<!--", "-->", "]]>", "<![CDATA[", "<!DOCTYPE x>", "<?xml?>",
    "&lt;", "&#60;script>", "&", "javascript:alert(1)", "{{ 7*7 }}", "{% raw %}", "{#", "[/bold]", "[red]",
    "[/]", ":smile:", "[link=http://x]", "../..", "/etc/passwd", "..", ".", "~", "C:\\x", "CON", "=1+1",
    "=cmd|' /C calc'!A0", "+1", "-1", "@SUM(1)", "#", "[meta]", "]", "a = 1", "= 1\n[[run]]", "nan", "inf",
    "true", "#include <x>", "#error x", "_Pragma(\"x\")", "system(\"touch x\")", "int system(const char*);",
    "__attribute__((constructor))", "--trust-code", "-o",
    "Make again:  gyrotc emit model.json --out . --zero-at 9.0", "extern const gtc_f32_table_t gtc_x_f32;",
    "*", "/", "?", "<U+0041>", "%", " ", "",
)  # fmt: skip


def hostile_strings(n: int = 500) -> list[str]:
    """Every part alone, then parts in a row; the same ones every time, no two alike."""
    draw = random.Random(SEED)
    found = dict.fromkeys(_PARTS)
    found["a" * 5000] = found["*/" * 600] = found["?" * 700] = found["\u00e4" * 300] = None
    while len(found) < n:
        found["".join(draw.choice(_PARTS) for _ in range(draw.randint(2, 6)))] = None
    return list(found)[:n]
