"""Recordings of both blind worlds, eighty fixed ones and a fresh draw: of each class hardly any is named wrong."""

from __future__ import annotations

import secrets
from collections import Counter
from collections.abc import Iterable, Sequence
from pathlib import Path

import pytest
from named_causes import named_causes

from tests.blind import fixed
from tests.blind.effects import FAMILY
from tests.blind.fixed import Drawn

# Wrong answers of the eighty, where more than one is allowed: an asymmetric lag is named `cavity_lag`, and texture of
# relays `map_too_coarse`.
ALLOWED = {"own world: foreign, a cause named": 2}


FRESH, MOST_FRESH = 6, 2  # more wrong ones of six are drawn once in two thousand times where one of twenty is wrong


def mistakes(drawn: Iterable[Drawn]) -> Counter[str]:
    """How many answers are wrong, by class of either world; each is printed."""
    wrong: Counter[str] = Counter()
    for one in drawn:
        names = named_causes(one.folder, 10.0, 100.0)
        families, hidden = {FAMILY[n] for n in names}, {FAMILY[n] for n in one.hidden if n in FAMILY}
        of = {
            "nothing hidden, a cause named": one.stratum in ("clean", "stress", "sensor lag") and names,
            "foreign, a cause named": one.stratum == "foreign" and names,
            "another family named": one.stratum in ("one", "two") and families - hidden,
            "k of 2.5 or more, another answer": one.stratum == "one" and one.k >= 2.5 and families != hidden,
        }
        for kind in (kind for kind, found in of.items() if found):
            wrong[f"{one.folder.name.split('-')[0]} world: {kind}"] += 1
            print(one.folder.name, one.hidden, f"{one.k:.1f}", names, kind)
    return wrong


@pytest.mark.parametrize("numbers", [(fixed.OWN_NUMBERS, ()), ((), fixed.OTHER_NUMBERS)], ids=["own", "other"])
def test_of_eighty_no_more_are_wrong_than_each_class_allows(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, numbers: tuple[Sequence[int], Sequence[int]]
) -> None:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    wrong = mistakes(fixed.of_any_kind(fixed.OF_ANY_KIND, tmp_path, *numbers))
    assert all(count <= ALLOWED.get(kind, 1) for kind, count in wrong.items()), wrong


def test_of_a_fresh_draw_hardly_any_is_wrong(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    seed = secrets.randbits(32)
    print("seed", seed)
    half = range(FRESH // 2)
    wrong = mistakes(fixed.of_any_kind(seed, tmp_path, half, half))
    assert max(wrong.values(), default=0) <= MOST_FRESH, (seed, wrong)
