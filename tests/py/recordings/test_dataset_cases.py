"""Every form of a recording that is accepted, and every fault that is refused, with its message."""

from __future__ import annotations

from pathlib import Path

import pytest
from gyrotc.common.errors import InputError
from gyrotc.recordings.load import load
from recordings import ACCEPTED, REFUSED, ROWS


@pytest.mark.parametrize("case", REFUSED)
def test_refused_with_place_found_and_expected(case: str, tmp_path: Path) -> None:
    refused = REFUSED[case]
    folder = tmp_path / refused.folder
    refused.make(folder)
    with pytest.raises(InputError) as caught:
        load(folder)
    for part in refused.message:
        assert part in str(caught.value)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("case", ACCEPTED)
def test_accepted(case: str, tmp_path: Path) -> None:
    folder = tmp_path / "RLG-1"
    ACCEPTED[case](folder)
    dataset = load(folder)
    for run in dataset.runs:
        assert len(run.rows()) == run.n_rows == ROWS
        assert run.in_span(run.rows().time_s).any()
