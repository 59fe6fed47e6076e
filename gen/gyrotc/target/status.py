"""Status bits of the runtime, as `include/gtc.h` has them; `tests/py/target/test_reference.py` compares the two."""

from __future__ import annotations

# Results of the functions of the runtime, GTC_OK and so on; the bits of one that is 0 or more may be set together:
OK = 0
WARMING = 1
CLAMPED = 2
UNCOVERED = 4
HELD = 8
FALLBACK = 16
CHANNEL_LOST = 32
E_ARG = -1
E_LAYOUT = -2
E_SELF_TEST = -3
E_IMAGE = -4
E_ID = -5
E_PERIOD = -6
E_ABSENT = -7
E_REST = -8
