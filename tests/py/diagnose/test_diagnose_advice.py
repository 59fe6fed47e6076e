"""What a result says in words: a sentence for each verdict, and the step that would tell more."""

from __future__ import annotations

from typing import get_args

import pytest
from gyrotc.causes import CATALOGUE
from gyrotc.diagnose.summary import VERDICTS, next_steps, not_testable
from gyrotc.recordings.load import load
from gyrotc.results.diagnosed import DiagnosisVerdict, NamedCause
from gyrotc.train.fitting import FitOptions
from recordings import ACCEPTED


@pytest.mark.parametrize("verdict", get_args(DiagnosisVerdict))
def test_each_verdict_has_a_sentence_and_all_but_ambiguous_a_step(verdict: DiagnosisVerdict) -> None:
    assert VERDICTS[verdict].endswith(".")
    steps = next_steps(verdict, [], [], shipped=True)
    assert bool(steps) == (verdict != "ambiguous")


def test_where_temperature_hardly_changes_nothing_is_decided(tmp_path) -> None:  # type: ignore[no-untyped-def]
    ACCEPTED["Parquet"](tmp_path / "RLG-1")
    result = not_testable(load(tmp_path / "RLG-1"), FitOptions(), 0.25)
    assert result.verdict == "not_testable"
    assert "0.25 C" in result.text
    assert not result.causes and result.extended is None


@pytest.mark.parametrize("id", ["thermal_gradient", "turn_on_offset"])
def test_a_cause_that_the_fixture_can_imitate_says_so_and_what_tells(id: str) -> None:
    """Tilt and scale factor times Earth's rate: no recording on one axis tells them, another mounting does."""
    words = CATALOGUE[id].words
    cause = NamedCause(
        id=id,
        family=CATALOGUE[id].family,
        name=words.name,
        p_value=1e-4,
        parameters={},
        equivalent=(),
        separate_by=None,
        gain=None,
        signature=words.signature,
        remedy=words.remedy,
    )
    told = [step for step in next_steps("explained", [cause], [], shipped=True) if "Earth's rate" in step]
    assert len(told) == 1 and (
        "turned by 180 degrees" in told[0] or "without touching the fixture" in told[0]
    )
