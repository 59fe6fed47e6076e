"""Gyros whose recordings hold the same rows under different serials: one of them flies with a table of the other."""

from __future__ import annotations

from collections import Counter, defaultdict
from collections.abc import Sequence

from ..results.fleet import Copy, FleetEntry

__all__ = ["copies", "with_copies"]

_DIGITS = 16  # of a hash
_LEAST = 2  # hashes; one alone might be chance among 100,000 gyros
_CROWD = 16  # gyros of which one hash is known: enough to name


def copies(entries: Sequence[FleetEntry]) -> list[Copy]:
    """Pairs of gyros of different serials that share rows, in the order of the entries."""
    words = [_words(entry.sketch) for entry in entries]
    holders: dict[str, list[int]] = defaultdict(list)
    for number, of_one in enumerate(words):
        for word in of_one:
            if len(holders[word]) < _CROWD:
                holders[word].append(number)
    common: Counter[tuple[int, int]] = Counter()
    for numbers in holders.values():
        if len(numbers) > 1:
            common.update((a, b) for k, a in enumerate(numbers) for b in numbers[k + 1 :])
    return [
        Copy(
            name=entries[a].name,
            serial=one,
            other=entries[b].name,
            other_serial=other,
            share=min(1.0, count / min(len(words[a]), len(words[b]))),
        )
        for (a, b), count in sorted(common.items())
        if count >= min(_LEAST, len(words[a]))
        and (one := entries[a].serial or "") != (other := entries[b].serial or "")
    ]


def _words(sketch: str) -> list[str]:
    return [sketch[k : k + _DIGITS] for k in range(0, len(sketch), _DIGITS)]


def with_copies(entries: Sequence[FleetEntry], found: Sequence[Copy]) -> list[FleetEntry]:
    """The entries, each of a pair with the finding `copy_of_other` and the others' names."""
    others: dict[str, list[str]] = defaultdict(list)
    for copy in found:
        others[copy.name].append(copy.other)
        others[copy.other].append(copy.name)
    return [
        entry.model_copy(
            update={"findings": (*entry.findings, "copy_of_other"), "copy_of": tuple(others[entry.name])}
        )
        if entry.name in others and entry.model_hash is not None
        else entry
        for entry in entries
    ]
