"""What the emitted C must answer, computed without it: numpy, one operation at a time.

Mirror of libc/ in both arithmetics; loads no compiled code of gyrotc. `evaluate_map` is the static
map, `replay` a whole history through the front end, `answers` the known answers of `board_test.c`.
"""

from __future__ import annotations

from .f32 import FUSIBLE
from .history import Replay, answers, replay
from .maps import evaluate_map

__all__ = ["FUSIBLE", "Replay", "answers", "evaluate_map", "replay"]
