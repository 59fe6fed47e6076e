"""Where a few training runs are cut so that parts can be left out."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pytest
from gyrotc.recordings.records import Run
from gyrotc.train.cross_validation import Span, training_spans


@dataclass
class Samples:
    temperature_c: np.ndarray
    time_s: np.ndarray
    run: np.ndarray


def runs(n: int) -> list[Run]:
    """Runs of which only the names matter here."""
    made = []
    for k in range(n):
        run = object.__new__(Run)
        object.__setattr__(run, "file", f"{k}.csv")
        made.append(run)
    return made


def profile(*legs: tuple[float, float], noise: float = 0.05, start: float = 0.0) -> Samples:
    """Temperature along legs of (minutes, change in C), one sample in 10 s, with noise."""
    edges = np.cumsum([0.0, *(60.0 * minutes for minutes, _ in legs)])
    levels = 20.0 + np.cumsum([0.0, *(change for _, change in legs)])
    time = np.arange(0.0, edges[-1], 10.0)
    rng = np.random.default_rng(5)
    temperature = np.interp(time, edges, levels) + rng.normal(0.0, noise, len(time))
    return Samples(temperature, time + start, np.zeros(len(time), dtype=np.int64))


def edges_of(spans: tuple[Span, ...]) -> list[float]:
    return [spans[0].from_s, *(s.to_s for s in spans)]


def test_a_cycle_is_cut_at_its_turning_points() -> None:
    spans = training_spans(runs(1), profile((20, -60.0), (30, 90.0), (20, -40.0)))
    assert [s.kind for s in spans] == ["branch"] * 3
    assert edges_of(spans) == pytest.approx([0.0, 1200.0, 3000.0, 4200.0], abs=60.0)


def test_holds_and_steps_on_the_way_are_no_turning_points() -> None:
    spans = training_spans(runs(1), profile((10, 20.0), (30, 0.0), (10, 20.0), (30, 0.0), (20, -40.0)))
    assert len(spans) == 2
    assert edges_of(spans)[1] == pytest.approx(4800.0, abs=1900.0)


def test_branches_shorter_than_five_minutes_join_their_neighbour() -> None:
    spans = training_spans(runs(1), profile((20, -60.0), (3, 5.0), (20, -40.0), (20, 60.0)))
    assert len(spans) == 2
    spans = training_spans(runs(1), profile((20, -60.0), (20, 60.0), (2, -10.0)))
    assert edges_of(spans) == pytest.approx([0.0, 1200.0, 2520.0], abs=60.0)


def test_without_turning_points_there_are_five_equal_parts() -> None:
    spans = training_spans(runs(1), profile((10, 0.0), noise=0.1))
    assert [s.kind for s in spans] == ["part"] * 5
    np.testing.assert_allclose(np.diff(edges_of(spans)), 120.0)


def test_spans_cover_every_sample_once() -> None:
    for samples in (profile((20, -60.0), (30, 90.0), start=7000.0), profile((60, 30.0))):
        spans = training_spans(runs(1), samples)
        inside = sum(s.contains(samples.run, samples.time_s).astype(int) for s in spans)
        assert (inside == 1).all()


def test_the_guard_gap_lies_around_the_span_in_its_own_run_only() -> None:
    one = profile((20, -60.0), (30, 90.0), (20, -40.0))
    both = Samples(
        *(np.tile(x, 2) for x in (one.temperature_c, one.time_s)), np.repeat([0, 1], len(one.time_s))
    )
    spans = training_spans(runs(2), both)
    assert {s.run for s in spans} == {0, 1}
    middle = spans[1]
    near = middle.contains(both.run, both.time_s, guard=True)
    inside = middle.contains(both.run, both.time_s)
    assert (near & ~inside).sum() == 20, "100 s of 10 s samples on both sides"
    assert not near[both.run == 1].any()


def test_a_short_span_has_a_short_guard_gap() -> None:
    spans = training_spans(runs(1), profile((5, 0.0)))
    assert all(s.guard_s == pytest.approx(0.25 * (s.to_s - s.from_s)) for s in spans)


def test_three_runs_are_left_out_whole() -> None:
    one = profile((20, -60.0), (30, 90.0))
    three = Samples(
        *(np.tile(x, 3) for x in (one.temperature_c, one.time_s)), np.repeat([0, 1, 2], len(one.time_s))
    )
    assert training_spans(runs(3), three) == ()


def test_what_was_cut_can_be_printed_and_recorded() -> None:
    span = training_spans(runs(1), profile((50, 30.0)))[1]
    assert str(span) == "0.csv 600 ... 1200 s (part)"
    assert span.result().content() == {
        "file": "0.csv",
        "from_s": 600.0,
        "to_s": 1200.0,
        "kind": "part",
        "guard_s": 100.0,
    }
