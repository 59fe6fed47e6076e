"""Table layout 3 as Python data: the words of one table, in the order of its binary image.

Between the model and everything that prints, compares or runs it. docs/FORMAT.md, section 3, gives
every word; this package computes with a `Table`, `tables` makes one and prints it. The status bits are those of
`include/gtc.h`; tests/cases/mirror/test_reference.py compares the two.
"""

from __future__ import annotations

import functools
import zlib
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..results.base import Numeric

LAYOUT = 3  # docs/FORMAT.md, section 3
MAGIC = 0x47544331  # "GTC1" in ASCII
MISSING_Q31 = -(2**31)  # the word that fixed point has for no value (docs/FORMAT.md)
_ARITHMETIC = {"f32": 1, "q31": 2}  # docs/FORMAT.md, section 3
_INPUT_BITS = 16  # q31: temperatures in 2^-16 C

#: Arrays of a table in the order of the image, with the words of one record (0: not in records).
ARRAYS = {
    "serial": 0, "networks": 8, "centers": 5, "guards": 8, "terms": 8, "coverage": 0, "sigma": 0, "probes": 4,
}  # fmt: skip
#: Parts of the runtime that a table may need, as bits of its word `parts` (GTC_PART_... of gtc_table.h).
PARTS = {
    "bank": 0x1, "memory": 0x2, "play": 0x4, "warm_up": 0x8, "harmonic": 0x10, "auxiliary": 0x20, "curve": 0x40,
    "product": 0x80, "coverage": 0x100, "uncertainty": 0x200, "probes": 0x400, "narrow": 0x800, "rezero": 0x1000,
}  # fmt: skip
SERIAL_WORDS = 16  # 64 characters, as many as a serial may have

Words = NDArray[np.uint32]


def crc32(words: ArrayLike) -> int:
    """CRC-32 of words, each as four octets, least significant first."""
    return zlib.crc32(np.asarray(words, dtype="<u4").tobytes())


def f32_words(values: ArrayLike) -> Words:
    """Bits of numbers rounded to float32; a negative zero becomes a positive one."""
    rounded = np.asarray(values, dtype=np.float64).astype(np.float32) + np.float32(0.0)
    return np.asarray(rounded).reshape(-1).view(np.uint32)


def _widened(words: Words) -> NDArray[np.float64]:
    """float32 numbers by their bits, in float64; a signalling NaN among them is no warning."""
    with np.errstate(invalid="ignore"):
        return words.view(np.float32).astype(np.float64)


@dataclass(frozen=True, slots=True)
class Table:
    """One table: what `tables` prints and this package computes with. Every number is a 32-bit word.

    Scalars have the names and the order of the members of gtc_<n>_table_t; `authority`, `effect`, `scale` and
    `envelope` are tuples of words, `coverage_cells` and `sigma_cells` pairs. Arrays are flat.
    """

    numeric: Numeric
    name: str  # id of the table as text
    id: int  # CRC-32 of it
    calibrated: int  # yyyymmdd as a decimal number
    block_us: int
    slope_blocks: int
    lead_blocks: int
    bias_frac_bits: int
    fallback: int
    authority: tuple[int, ...]
    effect: tuple[int, ...]
    rezero: int
    scale: tuple[int, ...]
    envelope: tuple[int, ...]
    coverage_cells: tuple[int, int]
    sigma_cells: tuple[int, int]
    serial: Words
    networks: Words
    centers: Words
    guards: Words
    terms: Words
    coverage: Words
    sigma: Words
    probes: Words
    error_bound_dph: float  # |map - model| never exceeds it: arithmetic and input rounding, no terms
    bound_parts_dph: dict[str, float]  # what the bound is made of
    fallback_model_bounds_dph: tuple[float, ...] = ()  # the same of each fallback model alone

    def records(self, array: str) -> Words:
        """An array of records, one a row: shape (n, words of a record)."""
        words: Words = getattr(self, array)
        return words.reshape(-1, ARRAYS[array])

    @property
    def n_centers(self) -> int:
        return self.centers.size // ARRAYS["centers"]

    @property
    def fallback_models(self) -> tuple[int, ...]:
        """Number of each term's fallback model among the networks, from 1 on; 0: it has none."""
        return tuple(int(word) >> 16 for word in self.records("terms")[:, 1])

    @property
    def n_fallback_models(self) -> int:
        return sum(number != 0 for number in self.fallback_models)

    @property
    def n_networks(self) -> int:
        """Networks of the map; the fallback models stand behind them."""
        return self.networks.size // ARRAYS["networks"] - self.n_fallback_models

    @property
    def channels(self) -> tuple[int, ...]:
        """Channel of every term; 0: the temperature."""
        return tuple(int(word) & 0xFFFF for word in self.records("terms")[:, 1])

    @property
    def n_channels(self) -> int:
        return self.guards.size // ARRAYS["guards"]

    @property
    def sigma_grids(self) -> int:
        """Grids of sigma: one for covered cells, and one for the others if the table says which are covered."""
        return 2 if self.coverage.size else 1

    @property
    def parts(self) -> int:
        """Parts of the runtime that the table needs, one bit each."""
        parts = functools.reduce(lambda found, kind: found | 1 << int(kind), self.records("terms")[:, 0], 0)
        needed = {
            "bank": self.n_networks > 1,
            "coverage": self.coverage.size > 0,
            "uncertainty": self.sigma.size > 0,
            "probes": self.probes.size > 0,
            "narrow": self.numeric == "q31" and self.scale[2] != 0,
            "rezero": self.rezero != 0,
        }
        return parts | sum(PARTS[part] for part, is_needed in needed.items() if is_needed)

    @property
    def block_s(self) -> float:
        return self.block_us * 1e-6

    @property
    def header(self) -> list[int]:
        """The words between magic and arrays: layout and arithmetic, length, members."""
        counts = [getattr(self, a).size // ARRAYS[a] for a in ("networks", "centers")]
        members = [
            0, 0, self.id, self.calibrated, self.block_us, self.slope_blocks, self.lead_blocks, self.bias_frac_bits,
            self.parts, self.fallback, *self.authority, *self.effect, self.rezero, *self.scale, *self.envelope,
            *counts, self.n_channels, self.terms.size // ARRAYS["terms"],
            *self.coverage_cells, *self.sigma_cells, self.sigma.size, self.probes.size // ARRAYS["probes"],
        ]  # fmt: skip
        arrays = sum(getattr(self, a).size for a in ARRAYS)
        length = 3 + len(members) + arrays + 1
        return [LAYOUT + 65536 * _ARITHMETIC[self.numeric], length, *members]

    @property
    def words(self) -> list[int]:
        """The whole image, magic and CRC included."""
        body = [*self.header, *(int(w) for a in ARRAYS for w in getattr(self, a))]
        return [MAGIC, *body, crc32(body)]

    @property
    def crc(self) -> int:
        return self.words[-1]

    @property
    def parameter_bytes(self) -> int:
        """Bytes of w0, linear, scale, centers, widths, weights and parameters of terms."""
        networks = self.networks.size // ARRAYS["networks"]
        terms = self.terms.size // ARRAYS["terms"]
        return 4 * (3 * networks + 3 + self.centers.size + 6 * terms)

    @property
    def fallback_model_bytes(self) -> int:
        """Bytes of the parameters of the fallback models."""
        counts = self.records("networks")[self.n_networks :, 0]
        return 4 * (3 * counts.size + ARRAYS["centers"] * int(counts.sum()))

    @property
    def table_bytes(self) -> int:
        """Bytes of read-only memory that the table takes in a program where pointers have 32 bits."""
        arrays = sum(int(getattr(self, a).size) for a in ARRAYS)
        # The header without its length, and CRC and number of fallback models
        return 4 * (len(self.header) - 1 + len(ARRAYS) + 2 + arrays)

    def encode_inputs(self, values: ArrayLike) -> Words:
        """Bits of temperatures (C) or slopes (C per block) as the arithmetic takes them; NaN is missing."""
        x = np.asarray(values, dtype=np.float64)
        if self.numeric == "f32":
            bits = x.astype(np.float32).view(np.uint32)
            return np.where(np.isnan(x), np.uint32(0x7FC00000), bits)
        scaled = np.rint(np.where(np.isfinite(x), x, 0.0) * 2.0**_INPUT_BITS)
        whole = np.clip(scaled, -(2**31) + 1, 2**31 - 1).astype(np.int64)
        return np.where(np.isfinite(x), whole, MISSING_Q31).astype(np.int32).view(np.uint32)

    def decode_inputs(self, bits: ArrayLike) -> NDArray[np.float64]:
        """The other way; missing inputs become NaN."""
        words = np.ascontiguousarray(bits, dtype=np.uint32)
        if self.numeric == "f32":
            return _widened(words)
        whole = words.view(np.int32).astype(np.float64)
        return np.where(whole == MISSING_Q31, np.nan, whole * 2.0**-_INPUT_BITS)

    def decode_bias(self, bits: ArrayLike) -> NDArray[np.float64]:
        """Biases in deg/h from their bits."""
        words = np.ascontiguousarray(bits, dtype=np.uint32)
        if self.numeric == "f32":
            return _widened(words)
        return words.view(np.int32).astype(np.float64) * 2.0**-self.bias_frac_bits

    def numbers(self, words: Any) -> NDArray[Any]:
        """Members or arrays as numbers of the arithmetic: float32, or int64 for fixed point."""
        bits = np.ascontiguousarray(words, dtype=np.uint32)
        return bits.view(np.float32) if self.numeric == "f32" else bits.view(np.int32).astype(np.int64)

    def bits(self, numbers: NDArray[Any]) -> Words:
        """The other way."""
        kept = numbers.astype(np.float32 if self.numeric == "f32" else np.int32)
        return np.ascontiguousarray(kept).view(np.uint32)


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
