"""The runtime as a shared object: compiled once per test session, called on the words of a `Table`."""

from __future__ import annotations

import ctypes
import subprocess
import tempfile
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
from gyrotc.mirror import ARRAYS, LAYOUT, Table, Words, period_us

ROOT = Path(__file__).resolve().parents[2]
_WARNINGS = "all extra conversion sign-conversion double-promotion undef missing-declarations shadow error"
FLAGS = ["-std=c99", "-pedantic", "-ffp-contract=off", *(f"-W{name}" for name in _WARNINGS.split())]


ALL = ("-DGTC_WITH_BANK=1",)


def _table_struct() -> type[ctypes.Structure]:
    """The layout of gtc_<n>_table_t, the same for both arithmetics."""
    u32, pointer = ctypes.c_uint32, ctypes.c_void_p
    integers = "layout quantity unit id calibrated block_us slope_blocks lead_blocks bias_frac_bits parts fallback"
    fields: list[Any] = [(name, u32) for name in integers.split()]
    fields += [("authority", u32 * 2), ("effect", u32 * 2), ("rezero", u32)]
    fields += [("scale", u32 * 3), ("envelope", u32 * 4)]
    fields += [(name, u32) for name in ("n_networks", "n_centers", "n_channels", "n_terms")]
    fields += [
        ("coverage_cells", u32 * 2),
        ("sigma_cells", u32 * 2),
        ("n_sigma", u32),
        ("n_probes", u32),
        ("n_fallback_models", u32),
    ]
    fields += [(name, pointer) for name in ARRAYS]
    fields += [("crc", u32)]
    return type("TableStruct", (ctypes.Structure,), {"_fields_": fields})


class Runtime:
    """Functions of one build of the runtime."""

    def __init__(self, library: ctypes.CDLL) -> None:
        self.library = library

    def check(self, table: Table) -> int:
        struct, _keep = self.struct(table)
        return int(self._function(table, "check")(ctypes.byref(struct)))

    def check_words(self, table: Table) -> int:
        struct, _keep = self.struct(table)
        return int(self._function(table, "check_words")(ctypes.byref(struct)))

    def maps(self, table: Table, inputs: Words) -> tuple[np.ndarray, Words]:
        """Statuses and bits of the biases for the bits of inputs, shape (n, 2)."""
        struct, _keep = self.struct(table)
        inputs = np.ascontiguousarray(inputs, dtype=np.uint32)
        status, bits = np.zeros(len(inputs), np.int32), np.zeros(len(inputs), np.uint32)
        self._shim(table, "maps")(
            ctypes.byref(struct),
            _address(inputs),
            ctypes.c_long(len(inputs)),
            _address(status),
            _address(bits),
        )
        return status, bits

    def steps(
        self, table: Table, channels: Words, missed: np.ndarray, samples_per_block: int
    ) -> tuple[np.ndarray, Words]:
        """Statuses of `missed`, `sample`, `bias` for every row, shape (n, 3), and the bits of the biases."""
        bits = np.zeros(len(channels), np.uint32)
        return self._driven("steps", table, channels, missed, samples_per_block, 3, bits), bits

    def snapshots(
        self, table: Table, channels: Words, missed: np.ndarray, samples_per_block: int
    ) -> tuple[np.ndarray, Words]:
        """What `sample` and `snapshot` return for every row, status, age, shape (n, 4); bits of bias, sigma, time."""
        bits = np.zeros((len(channels), 3), np.uint32)
        return self._driven("snapshots", table, channels, missed, samples_per_block, 4, bits), bits

    def calls(
        self, table: Table, kind: np.ndarray, number: np.ndarray, values: Words, samples_per_block: int
    ) -> tuple[np.ndarray, Words]:
        """Calls in order: what each and `snapshot` after it return, shape (n, 2); bits of bias and sigma.

        Args:
            kind: Of the calls of libc_shim.c: sample, sample_at, missed, rezero, save and restore, init.
            number: Time, count, seconds or blocks without power, one a call.
            values: Bits of the channels, or of the measured rate in the first one, shape (n, n_channels).
        """
        struct, _keep = self.struct(table)
        state = ctypes.create_string_buffer(self._shim(table, "state_size", ctypes.c_size_t)() + 16)
        kind = np.concatenate([[5], kind]).astype(np.int32)
        number = np.concatenate([[0], number]).astype(np.uint32)
        values = np.concatenate([values[:1], values]).astype(np.uint32)
        status, bits = np.zeros((len(kind), 2), np.int32), np.zeros((len(kind), 2), np.uint32)
        self._shim(table, "calls")(
            state,
            ctypes.byref(struct),
            ctypes.c_uint32(period_us(table.block_us, samples_per_block)),
            _address(kind),
            _address(number),
            _address(values),
            ctypes.c_long(values.shape[1]),
            ctypes.c_long(len(kind)),
            _address(status),
            _address(bits),
        )
        return status[1:], bits[1:]

    def _driven(
        self,
        shim: str,
        table: Table,
        channels: Words,
        missed: np.ndarray,
        samples_per_block: int,
        statuses: int,
        bits: Words,
    ) -> np.ndarray:
        """A fresh state driven through every row: statuses, shape (n, statuses); the shim writes into `bits`."""
        struct, _keep = self.struct(table)
        size = self._shim(table, "state_size", ctypes.c_size_t)()
        state = ctypes.create_string_buffer(size + 16)
        started = self._function(table, "init")(
            state, ctypes.byref(struct), ctypes.c_uint32(period_us(table.block_us, samples_per_block))
        )
        assert started == 0, started
        channels = np.ascontiguousarray(channels, dtype=np.uint32)
        missed = np.ascontiguousarray(missed, dtype=np.uint32)
        status = np.zeros((len(channels), statuses), np.int32)
        self._shim(table, shim)(
            state,
            ctypes.byref(struct),
            _address(channels),
            ctypes.c_long(channels.shape[1]),
            _address(missed),
            ctypes.c_long(len(channels)),
            _address(status),
            _address(bits),
        )
        return status

    def out_of_range(self) -> int:
        """Claims about ranges that did not hold so far, in a build with `libc_counted.h`."""
        return ctypes.c_long.in_dll(self.library, "shim_out_of_range").value

    def struct(self, table: Table) -> tuple[ctypes.Structure, list[Any]]:
        """The C struct of a table, and what must be kept alive with it."""
        struct = _table_struct()()
        struct.layout, struct.crc = LAYOUT, table.crc
        for name in ("id", "calibrated", "block_us", "slope_blocks", "lead_blocks", "bias_frac_bits", "parts"):
            setattr(struct, name, getattr(table, name))
        struct.n_channels, struct.n_sigma = table.n_channels, table.sigma.size
        for name in ("fallback", "rezero"):
            setattr(struct, name, getattr(table, name))
        for name in ("authority", "effect", "scale", "envelope", "coverage_cells", "sigma_cells"):
            getattr(struct, name)[:] = getattr(table, name)
        keep = []
        for name, width in ARRAYS.items():
            words = np.ascontiguousarray(getattr(table, name), dtype=np.uint32)
            keep.append(words)
            setattr(struct, name, words.ctypes.data if words.size else None)
            if width and name != "guards":
                setattr(struct, f"n_{name}", words.size // width)
        struct.n_networks, struct.n_fallback_models = table.n_networks, table.n_fallback_models
        return struct, keep

    def function(self, numeric: str, name: str) -> Any:
        """A public function of the runtime."""
        return getattr(self.library, f"gtc_{numeric}_{name}")

    def _function(self, table: Table, name: str) -> Any:
        return self.function(table.numeric, name)

    def _shim(self, table: Table, name: str, result: Any = None) -> Any:
        function = getattr(self.library, f"shim_{table.numeric}_{name}")
        function.restype = result
        return function


def _address(array: np.ndarray) -> ctypes.c_void_p:
    return ctypes.c_void_p(array.ctypes.data)


def runtime(compiler: str = "gcc", options: tuple[str, ...] = ("-O2",)) -> Runtime:
    """Compiles `libc/` and loads it."""
    return _compiled(compiler, options)


@lru_cache
def _compiled(compiler: str, options: tuple[str, ...]) -> Runtime:
    folder = Path(tempfile.mkdtemp(prefix="gyrotc-test-"))
    library = folder / "libgtc.so"
    sources = [*sorted((ROOT / "libc").glob("*.c")), ROOT / "tests" / "support" / "libc_shim.c"]
    folders = [f"-I{ROOT / name}" for name in ("include", "libc", "tests/support")]
    command = [compiler, *FLAGS, *ALL, *options, "-shared", "-fPIC", *folders, "-o", str(library)]
    subprocess.run([*command, *map(str, sources)], check=True)
    return Runtime(ctypes.CDLL(str(library)))
