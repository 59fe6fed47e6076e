"""Each kind of term is described once; the C sources, which a compiler reads, say the same."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from gyrotc.mirror import KINDS, TableKind, recursions_of_table
from gyrotc.results import Numeric
from gyrotc.tables import NUMERICS, outside, quantise
from models import random_model, random_terms

ROOT = Path(__file__).resolve().parents[3]
CONFIG, TABLE, PRIVATE, LIMITS = (
    (ROOT / name).read_text(encoding="ascii")
    for name in ("include/gtc_config.h", "include/gtc_table.h", "libc/gtc_private.h", "libc/gtc_limits.inl")
)
#: Parameters of a term of any kind in a table.
N_PARAMETERS = 6


def _rows_of_limits() -> list[list[tuple[str, list[float]]]]:
    """Return the ranges of each kind, row by row: the comment, and least and most in float32 and in fixed point."""
    text = LIMITS.split("term_limits[GTC_N_KINDS]")[1].split("};\n#endif")[0]
    kinds = re.findall(r"^    \{\n(.*?)^    \},$", text, re.DOTALL | re.MULTILINE)
    rows = [re.findall(r"RANGE\(([^)]*)\),(?: +/\* (.*?) \*/)?$", kind, re.MULTILINE) for kind in kinds]
    return [[(comment, [_number(x) for x in numbers.split(",")]) for numbers, comment in kind] for kind in rows]


def _number(text: str) -> float:
    first, *more = text.split(" - ")
    return float(first.rstrip("F")) - sum(float(x) for x in more)


def test_every_kind_is_described() -> None:
    assert set(KINDS) == set(TableKind)


def test_kinds_have_the_numbers_of_the_header() -> None:
    numbers = {
        name: int(number) for name, number in re.findall(r"#define GTC_TERM_([A-Z_]+) (\d+)U", TABLE) if name != "WORDS"
    }
    assert numbers == {kind.name: kind.value for kind in TableKind}
    assert re.findall(r"#define GTC_N_KINDS (\d+)U", TABLE) == [str(len(KINDS))]


def test_the_kinds_with_a_channel_are_those_of_the_sources() -> None:
    found = re.search(r"#define CHANNEL_KINDS \\\n(.*)", PRIVATE)
    assert found is not None
    of_sources = {TableKind[name] for name in re.findall(r"GTC_TERM_([A-Z_]+)", found[1])}
    options = re.search(r"#if (.*)\n#define GTC_WITH_CHANNELS 1", CONFIG)
    assert options is not None
    assert of_sources == {TableKind[name] for name in re.findall(r"GTC_WITH_([A-Z_]+)", options[1])}
    assert of_sources == {kind for kind in TableKind if kind.description.reads_channel}


def test_the_kinds_with_a_state_are_those_of_the_sources() -> None:
    options = re.search(r"#if (.*) /\* terms with a state \*/", CONFIG)
    assert options is not None
    of_sources = {TableKind[name] for name in re.findall(r"GTC_WITH_([A-Z_]+)", options[1])}
    assert of_sources == {kind for kind in TableKind if kind.description.has_state}


@pytest.mark.parametrize("kind", TableKind)
def test_the_words_of_a_kind_have_the_ranges_of_the_sources_in_their_order(kind: TableKind) -> None:
    """Words that a kind does not use are 0, and words that are multiplied in fixed point stay below 2^30."""
    rows = _rows_of_limits()[kind - 1]
    words = kind.description.words
    assert len(rows) == N_PARAMETERS
    title = kind.name.lower().replace("_", "-")
    assert [comment for comment, _ in rows] == [
        *(f"{title}: {word.name}" for word in words),
        *[""] * (N_PARAMETERS - len(words)),
    ]
    for _, limits in rows[len(words) :]:
        assert limits == [0.0, 0.0, 0.0, 0.0]
    multiplied = [limits[2:] for word, (_, limits) in zip(words, rows, strict=False) if word.is_multiplied]
    assert all(max(-least, most) <= 2**30 for least, most in multiplied)


@pytest.mark.parametrize("kind", TableKind)
def test_the_names_of_words_in_the_sources_are_places_that_the_kind_has(kind: TableKind) -> None:
    places = [int(n) for n in re.findall(rf"#define {kind.name}_[A-Z_]+ (\d+)U", PRIVATE)]
    assert places == list(range(len(places)))
    assert 0 < len(places) <= len(kind.description.words)


@pytest.mark.parametrize("numeric", NUMERICS)
@pytest.mark.parametrize("unknown", [0, len(KINDS) + 1])
def test_a_term_of_an_unknown_kind_is_an_error(numeric: Numeric, unknown: int) -> None:
    table = quantise(random_model(4, terms=random_terms(4)), numeric)
    terms = np.array(table.terms)
    terms[0] = unknown
    strange = replace(table, terms=terms)
    assert outside(strange) == f"kind of a term is {unknown}"
    with pytest.raises(ValueError, match=str(unknown)):
        recursions_of_table(strange)
