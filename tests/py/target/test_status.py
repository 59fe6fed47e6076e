"""Status bits stand once in Python and once in C, and the two are the same."""

from __future__ import annotations

import re
from pathlib import Path

from gyrotc.target import status

HEADER = Path(__file__).resolve().parents[3] / "include" / "gtc.h"


def test_the_bits_of_python_are_those_of_the_header() -> None:
    statuses = HEADER.read_text("utf-8").split("#define GTC_OK", 1)[1].split("#define GTC_TEMP_MISSING", 1)[0]
    found = re.findall(r"#define GTC_(\w+) \(?(-?\d+)\)?", "#define GTC_OK" + statuses)
    assert {name: int(value) for name, value in found} == {n: getattr(status, n) for n in status.__all__}
