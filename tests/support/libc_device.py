"""One table on the compiled runtime, called function by function: images, states, saved states."""

from __future__ import annotations

import ctypes
import subprocess
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from conftest import ROOT
from gyrotc.mirror import Table, Words, period_us
from gyrotc.model import Model
from libc_build import Runtime
from models import bank_of, random_channels, random_history, random_model, random_terms


def _save_words() -> int:
    """GTC_SAVE_WORDS with default options."""
    command = ["gcc", "-E", "-P", f"-I{ROOT / 'include'}", "-x", "c", "-"]
    text = '#include "gtc.h"\nGTC_SAVE_WORDS\n'
    done = subprocess.run(command, input=text, capture_output=True, text=True, check=True)
    return int(
        eval(done.stdout.partition("\n(10 ")[2].join(["(10 ", ""]), {"__builtins__": {}})
    )  # numbers and operators


SAVE_WORDS = _save_words()


@dataclass
class Device:
    """A compiled runtime with one table, called function by function."""

    runtime: Runtime
    table: Table

    def __post_init__(self) -> None:
        self.struct, self._keep = self.runtime.struct(self.table)

    def function(self, name: str) -> Any:
        return self.runtime.function(self.table.numeric, name)

    @cached_property
    def state_size(self) -> int:
        size = getattr(self.runtime.library, f"shim_{self.table.numeric}_state_size")
        size.restype = ctypes.c_size_t
        return int(size())

    def state(self) -> ctypes.Array[ctypes.c_char]:
        return ctypes.create_string_buffer(b"\xa5" * self.state_size, self.state_size)

    def open(self, words: Words, expected_id: int | None = None) -> tuple[int, ctypes.Structure]:
        """Status, and the table; one that is refused must be as it was."""
        opened = type(self.struct)()
        ctypes.memset(ctypes.byref(opened), 0xA5, ctypes.sizeof(opened))
        before = bytes(opened)
        wanted = self.table.id if expected_id is None else expected_id
        status = self.function("open")(
            ctypes.byref(opened), _pointer(words), ctypes.c_uint32(len(words)), ctypes.c_uint32(wanted)
        )
        assert status == 0 or bytes(opened) == before
        return int(status), opened

    def init(self, state: Any, samples_per_block: int) -> None:
        assert (
            self.function("init")(
                state,
                ctypes.byref(self.struct),
                ctypes.c_uint32(period_us(self.table.block_us, samples_per_block)),
            )
            == 0
        )

    def save(self, state: Any) -> Words:
        words = np.full(SAVE_WORDS + 1, 0x5A5A5A5A, dtype=np.uint32)
        assert self.function("save")(state, ctypes.byref(self.struct), _pointer(words)) == 0
        assert words[-1] == 0x5A5A5A5A
        return words[:-1].copy()

    def restore(self, state: Any, words: Words, samples_per_block: int, off_blocks: int = 0) -> int:
        """Status; a state that is refused must be as it was."""
        before = bytes(state)
        status = self.function("restore")(
            state,
            ctypes.byref(self.struct),
            ctypes.c_uint32(period_us(self.table.block_us, samples_per_block)),
            _pointer(words),
            ctypes.c_uint32(off_blocks),
        )
        assert status == 0 or bytes(state) == before
        return int(status)

    def steps(self, state: Any, channels: Words, missed: np.ndarray) -> tuple[np.ndarray, Words]:
        """Goes on with the state; as Runtime.steps()."""
        rows = len(channels)
        status, bits = np.zeros((rows, 3), np.int32), np.zeros(rows, np.uint32)
        channels, missed = np.ascontiguousarray(channels), np.ascontiguousarray(missed, dtype=np.uint32)
        getattr(self.runtime.library, f"shim_{self.table.numeric}_steps")(
            state,
            ctypes.byref(self.struct),
            _pointer(channels),
            ctypes.c_long(channels.shape[1]),
            _pointer(missed),
            ctypes.c_long(rows),
            _pointer(status),
            _pointer(bits),
        )
        return status, bits


def _pointer(words: np.ndarray) -> ctypes.c_void_p:
    return ctypes.c_void_p(words.ctypes.data)


def variant(seed: int) -> Model:
    """In turn: a plain model, one with terms, a bank of networks."""
    model = random_model(seed, terms=random_terms(seed) if seed % 3 == 1 else ())
    return bank_of(model) if seed % 3 == 2 else model


def history(model: Model, table: Table, seed: int, rows: int, samples: int) -> tuple[Words, np.ndarray]:
    """Bits of temperatures and auxiliary channels, and the samples missed before each row."""
    x, missed = random_history(model, seed, rows, samples)
    return table.encode_inputs(np.column_stack([x, random_channels(model, seed, rows)])), missed
