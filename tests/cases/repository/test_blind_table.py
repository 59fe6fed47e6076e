"""How answers of a blind run are counted, and when it fails."""

from __future__ import annotations

from typing import Any

import pytest

from tests.blind import both
from tests.blind.grade import shipped_worse
from tests.blind.table import ended, gains_of


def _answered(stratum: str, truth: list[str], k: float, named: list[str], p: float, **other: Any) -> dict[str, Any]:
    said = [{"id": name, "p": p, "true": name in truth} for name in named]
    verdict = "explained" if named else "consistent"
    row = {"number": 1, "stratum": stratum, "truth": truth, "k": k, "verdict": verdict, "named": named, "said": said}
    return {**row, "shipped": 0.0, "worse": 0.0, "surely_worse": 0.0, **other}


def test_what_is_asked_on_fresh_seeds_counts_each_recording_where_it_belongs() -> None:
    rows = [
        _answered("clean", [], 0.0, [], 0.0),
        _answered("clean", [], 0.0, [], 0.0, verdict="unexplained", alpha=1.4),
        _answered("foreign", ["foreign"], 3.0, ["hysteresis"], 0.99),
        _answered("one", ["hysteresis"], 2.0, ["warm_up"], 0.7),
        _answered("one", ["hysteresis"], 3.0, ["hysteresis"], 0.99, shipped=1.0, worse=1.0),
    ]
    entries = both.checked([both.kept("other", 1, row) for row in rows])
    found = {entry["name"]: (entry["hits"], entry["of"], entry["met"]) for entry in entries}
    assert found["a cause or structure claimed, clean"] == (1, 2, False)
    assert found["... of these, in noise steeper than flicker"] == (1, 1, False)
    assert found["a cause named, clean"] == (0, 2, True)
    assert found["foreign given a name"] == (1, 1, False)
    assert found["family right, k ≥ 2.5"] == (1, 1, True)
    assert found["a wrong family named"] == (1, 2, False)
    assert found["stated with 95 % or more and true"] == (1, 2, False)
    assert found["shipped although worse on the exam"] == (1, 1, False)


def test_a_blind_run_fails_by_its_published_requirements(capsys: pytest.CaptureFixture[str]) -> None:
    met, missed, free = (
        {"name": n, "goal": g, "met": m} for n, g, m in (("a", "0", True), ("b", "0", False), ("c", "-", False))
    )
    assert ended([met, free]) == 0
    assert ended([met, missed, free]) == 1 and capsys.readouterr().out == "missed: b\n"


def _row(named: list[str], before2: float, after2: float) -> dict[str, object]:
    gain = {"before2": before2, "after2": after2, "noise2": 1.0, "shipped": 0.0}
    return {"stratum": "one", "truth": ["hysteresis"], "k": [3.0], "named": named, "gain": gain}


def test_what_is_gained_is_counted_over_all_that_was_hidden() -> None:
    """Over what was named rightly alone a cause that is never named gains nothing, and costs nothing."""
    reported = {t["name"]: t for t in gains_of([_row(["hysteresis"], 3.0, 1.0), _row([], 3.0, 3.0)])}
    assert reported["held-out gain as share of the oracle's, k ≥ 1.7 (pooled)"]["value"] == pytest.approx(1.0)
    of_all = reported["... of all that hide hysteresis, named or not"]
    assert of_all["value"] == pytest.approx(0.5) and of_all["of"] == 2 and not of_all["met"]


@pytest.mark.parametrize(("after", "high", "worse", "surely"), [(0.9, 0.2, 0, 0), (1.1, 0.1, 1, 0), (1.1, -0.05, 1, 1)])
def test_what_is_worse_than_before_is_reported_apart_from_what_is_worse_by_more_than_noise(
    after: float, high: float, worse: int, surely: int
) -> None:
    gain = {"exam_rms_before_dph": 1.0, "exam_rms_after_dph": after, "rms_removed_dph": {"high": high}}
    reported = shipped_worse({"extended": {"gain": gain}})
    assert reported == {"shipped": 1.0, "worse": worse, "surely_worse": surely}
    assert shipped_worse({"extended": None})["shipped"] == 0.0
