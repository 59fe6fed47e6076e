"""Ranges that files, options and training have in common; without pydantic, which `gyrotc --help` does without."""

from __future__ import annotations

from typing import Annotated

from annotated_types import Interval

MOST_CENTERS = 512
"""What a table holds: docs/FORMAT.md, "Legal ranges"; libc/gtc_limits.inl."""
MOST_HELD = 100_000
"""Blocks for which a temperature is held."""
BlockLength = Annotated[float, Interval(gt=0.0, le=3600.0)]
"""Of a block, s."""
AverageLength = Annotated[float, Interval(gt=0.0, le=1e6)]
"""Of the means of which RMS figures are taken, s."""
