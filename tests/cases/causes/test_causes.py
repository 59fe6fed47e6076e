"""A cause is one file with all that the others need of it, and nothing outside `causes` knows one by its name."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from gyrotc.causes import CATALOGUE, History, Reach, Scene, register, separate_by
from gyrotc.mirror import Course, CourseChannel, TermOutcome
from middle_values import middle_values

PACKAGE = Path(__file__).resolve().parents[3] / "gen" / "gyrotc"
MOST_LITERALS = 15  # of them three are fields of what a lot or a prior holds: no rule about a cause


def test_a_cause_has_its_own_id_and_rank() -> None:
    for cause in list(CATALOGUE.values()):
        with pytest.raises(ValueError, match=cause.id):
            register(cause)


DIAGNOSED = [id for id, term in CATALOGUE.items() if term.search is not None]
TABLED = [id for id, term in CATALOGUE.items() if term.table is not None]
TIME = np.arange(0.0, 28800.0, 10.0)
WAVE = 20.0 + 30.0 * np.sin(TIME / 3000.0)


@pytest.mark.parametrize("id", CATALOGUE)
def test_every_cause_says_what_it_is(id: str) -> None:
    term = CATALOGUE[id]
    assert term.id == id and term.equation and term.source
    words = term.words
    assert all((words.name, words.signature, words.remedy, words.experiment))
    assert words.name[0].isupper() and not words.name.endswith(".")
    assert set(words.beside) <= set(CATALOGUE), "an experiment beside a cause that there is"
    linear = [p.linear for p in term.parameters]
    assert linear == sorted(linear), "the linear parameters come last"
    assert term.cavity or term.bias or term.record


@pytest.mark.parametrize("id", DIAGNOSED)
def test_every_cause_that_is_searched_has_columns_at_every_point_of_its_grid(id: str) -> None:
    term = CATALOGUE[id]
    assert term.search and term.features and term.unit
    points = term.search.grid(Reach(span_c=100.0, longest_s=28800.0))
    assert points
    channel = WAVE if term.needs.channel else None
    history = History(TIME, WAVE, on_s=TIME, channel=channel, day=3.0)
    defaults = {p.name: p.default for p in term.nonlinear() if p.default is not None}
    for values in (points[0], points[-1]):
        columns = term.features(history, {**defaults, **values})
        assert columns.shape[0] == TIME.size and np.isfinite(columns).all()
    if term.search.over is not None:
        assert term.search.over in {p.name for p in term.nonlinear()}
        assert all(set(values) == {term.search.over} for values in points)
        assert not term.search.grid(Reach(1.0, 60.0)) or term.search.step, "none where nothing would show"
    assert (term.kind == "input") == (term.amplitudes is None and term.kind != "static")


@pytest.mark.parametrize("id", TABLED)
def test_every_cause_of_a_table_does_there_what_it_does_in_the_simulation(id: str) -> None:
    """The recursion over blocks of one row against the physics, where the cavity is the sensor."""
    term, values = CATALOGUE[id], middle_values(CATALOGUE[id])
    assert term.table
    number = np.arange(TIME.size)
    course = Course(WAVE, number > 0, number)
    nothing = np.zeros_like(WAVE)
    outcome = TermOutcome(WAVE, nothing, nothing, np.zeros(WAVE.size, dtype=np.int32))
    table = term.table
    channel = CourseChannel(WAVE, np.zeros(WAVE.size, dtype=np.int32), np.zeros(WAVE.size, dtype=np.bool_))
    table.recursion(values, 10.0).apply(course, channel, outcome)
    scene = Scene(TIME, TIME, WAVE, WAVE, WAVE, WAVE, 0.0)
    if term.cavity is not None:
        assert np.abs(outcome.temperature - term.cavity(scene, values)).max() < np.abs(np.diff(WAVE)).max()
    if term.bias is not None:
        want = term.bias(scene, values, np.random.default_rng(0))
        assert np.abs(outcome.added - want).max() < 0.01 * np.ptp(want)


@pytest.mark.parametrize("one", DIAGNOSED)
def test_every_pair_has_an_experiment_whichever_comes_first(one: str) -> None:
    for other in DIAGNOSED:
        if other != one:
            assert separate_by(one, other) == separate_by(other, one) != ""


def literals() -> Iterator[str]:
    """Where the id of a cause stands as a text outside `causes`."""
    for path in sorted(PACKAGE.rglob("*.py")):
        if path.parent.name == "causes":
            continue
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.Constant) and node.value in CATALOGUE:
                yield f"{path.relative_to(PACKAGE)}:{node.lineno} {node.value}"
    quoted = re.compile("[\"'](" + "|".join(CATALOGUE) + ")[\"']")
    for path in sorted(PACKAGE.rglob("*.j2")):
        yield from (f"{path.name} {found}" for found in quoted.findall(path.read_text(encoding="utf-8")))


def test_nothing_outside_causes_knows_a_cause_by_its_name() -> None:
    """A rule about a pair may; each says its reason at its line, and they stay few."""
    found = list(literals())
    assert len(found) == MOST_LITERALS, found
