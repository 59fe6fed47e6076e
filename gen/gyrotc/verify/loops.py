"""How often loops of the runtime turn at most: from the `for` of their text and the counts of a table."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace

from ..common.errors import CheckFailed
from ..target.table import ARRAYS, Table

__all__ = ["MEMORY", "POWER", "SHORT_QUOTIENTS", "Counts", "LoopText", "counts_of", "totals"]

_STATEMENT = re.compile(r"^\s*(?:for|while) \(")
_FOR = re.compile(
    r"for \((?P<v>\w+) = (?P<start>[^;]+); (?P=v) (?P<to><=?) (?P<end>[^;]+); (?P=v)(?:\+\+| \+= (?P<by>\d+)U)\)"
)
MEMORY = 1  # kind of a term: docs/FORMAT.md, section 3
_BITS = 32  # of a word: loops over its bits


@dataclass(frozen=True, slots=True)
class Counts:
    """Of a table, what limits its loops."""

    by_name: dict[str, int]
    centers: int  # of the largest network
    is_narrow: bool  # fixed point: the loop for large scales is taken
    missing_blocks: int  # most of any channel
    words: int  # of the image
    kinds: tuple[int, ...]  # of the terms
    stand_ins: int = 0
    stand_in_centers: int = 0  # of the largest of their networks


def counts_of(table: Table) -> Counts:
    sizes = {name: getattr(table, name).size // (record or 1) for name, record in ARRAYS.items()}
    named = {f"n_{name}": sizes[name] for name in ("networks", "centers", "terms", "sigma", "probes")}
    named |= {"n_channels": table.n_channels, "slope_blocks": table.slope_blocks}
    n_map = len(table.networks) // ARRAYS["networks"] - table.n_stand_ins
    return Counts(
        named,
        int(table.networks.reshape(-1, ARRAYS["networks"])[:, 0].max()),
        table.numeric == "q31" and table.scale[2] != 0,
        int(table.guards.reshape(-1, ARRAYS["guards"])[:, 6].max()),
        len(table.words),
        tuple(int(k) for k in table.terms.reshape(-1, ARRAYS["terms"])[:, 0]),
        table.n_stand_ins,
        int(max(table.networks.reshape(-1, ARRAYS["networks"])[n_map:, 0], default=0)),
    )


_WORDS = "for (i = 0; i < n; i++) {"  # of gtc_crc_words()
_SAVED = 256  # more words than any state that is saved has
_NUMBERS = "for (i = 0U; i < n; i++) {"  # of numbers_fit(); n is that of the records which the loop around it goes over
#: Words of a record that are numbers with a range, by what the loop over the records is bounded by: docs/FORMAT.md,
#: section 3.
_RECORDS = {"n_sigma": 1, "network[0].bits": 5, "n_networks": 7, "n_terms": 6, "n_channels": 4}
#: Lines whose quotient has 32 bits: of means and slopes, which fit a word (GTC_ASSERT_RANGE of `mean` and `quotient`),
#: and of a part by its whole, in 2^-31.
SHORT_QUOTIENTS = (
    "const uint_least64_t q = (magnitude + (den / 2U)) / den;",
    "part = (part << 31) / whole;",
)
#: Whole numbers of the header are looked at from the counts on before they are looked at from the first on.
_WHOLES = "for (i = first; i < N_WHOLE; i++) {"
POWER = ("while (rest != 0U) {", "for (rest = blocks; rest != 0U; rest >>= 1) {")

#: Loops that are no plain count, by their text; docs/numerics.md says why each ends.
_OTHER: dict[str, Callable[[Counts, int], int]] = {
    "for (i = state->table->slope_blocks - 1U; i > 0U; i--) {": lambda c, _: c.by_name["slope_blocks"] - 1,
    "for (bit = (uint_least32_t)1U << last; bit > 1U; bit >>= 1) {": lambda c, _: (
        c.by_name["slope_blocks"] - 1
    ),
    "for (i = 1U; i < number; i++) {": lambda c, _: c.by_name["n_networks"] - 1,  # before a stand-in
    # A running block, those until every channel counts as missing, and the rest of the last one.
    "while (rest > 0U) {": lambda c, _: c.missing_blocks + 3,
    "while (center != end) {": lambda c, unrolled: 0 if c.is_narrow else c.centers // unrolled,
    "for (center = centers; center != end; center = &center[GTC_CENTER_WORDS]) {": (
        lambda c, _: c.centers if c.is_narrow else 0
    ),
    "while (rest != 0U) {": lambda _c, _: _BITS,
    "for (rest = blocks; rest != 0U; rest >>= 1) {": lambda _c, _: _BITS,
    "while (whole > 0xFFFFFFFFU) {": lambda _c, _: _BITS,
    "while (bit != 0U) {": lambda _c, _: _BITS,
    # Words of several arrays, of which all together are as many as `totals` says.
    _WORDS: lambda c, _: max(c.words, _SAVED),
}


@dataclass(slots=True)
class LoopText:
    """The C text by its lines, with what its loops say."""

    lines: list[str]
    macros: dict[str, int]
    counts: Counts

    def is_loop(self, line: int) -> bool:
        return 0 < line <= len(self.lines) and _STATEMENT.match(self.lines[line - 1]) is not None

    def at(self, line: int) -> str:
        return self.lines[line - 1].strip()

    def most(self, line: int, around: str, of_stand_in: bool = False) -> int:
        """The most turns of a loop, in the loop with the text `around`, for each time that it is come to.

        Args:
            line, around: The loop's line; the text of the loop around it.
            of_stand_in: In a function that asks no network of the map.

        Raises:
            CheckFailed: Its text gives no bound.
        """
        text = self.at(line)
        if text == _NUMBERS:
            return next((n for name, n in _RECORDS.items() if name in around), self.macros["N_NUMBERS"])
        if text in _OTHER:
            centers = self.counts.stand_in_centers if of_stand_in else self.counts.centers
            return _OTHER[text](replace(self.counts, centers=centers), 1 + self.macros.get("GTC_UNROLL", 1))
        found = _FOR.match(text)
        end = self._number(found["end"]) if found else None
        if found is None or end is None:
            raise CheckFailed(f"no bound for the loop of line {line}: {text}")
        n = end - (self._number(found["start"]) or 0) + (found["to"] == "<=")
        return max(0, -(-n // int(found["by"] or 1)))

    def _number(self, text: str) -> int | None:
        word = re.sub(r"^\(uint_least32_t\)", "", text).rsplit("->", 1)[-1]
        if word == "network[0].bits":
            return self.counts.centers
        if number := re.fullmatch(r"(\d+)U?L?", word):
            return int(number[1])
        return self.counts.by_name.get(word, self.macros.get(word))


def totals(macros: Mapping[str, int], function: str, table: Table) -> dict[str, int]:
    """Turns that all calls of a function that takes the words of an array make together."""
    size = {name: getattr(table, name).size // (record or 1) for name, record in ARRAYS.items()}
    numbers = (
        macros["N_NUMBERS"] + 7 * size["networks"] + 5 * size["centers"] + 5 * size["guards"] + 6 * size["terms"]
        + size["sigma"]
    )  # fmt: skip
    words = macros["GTC_SAVE_WORDS"] if function in ("save", "restore") else len(table.words)
    counts = macros["N_WHOLE"] - macros["FIRST_COUNT"]
    wholes = macros["N_WHOLE"] + (2 if function == "check" else 1) * counts
    return {_NUMBERS: numbers, _WORDS: words, _WHOLES: wholes}
