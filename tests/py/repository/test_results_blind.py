"""The sections on blind runs are made from their files, by one text for both worlds."""

from __future__ import annotations

import json
import shutil
import sys
from pathlib import Path
from types import ModuleType

import pytest

ROOT = Path(__file__).resolve().parents[3]
sys.path.insert(0, str(ROOT))

from tests.blind import page  # noqa: E402
from tests.blind.grade import shipped_worse  # noqa: E402
from tests.blind.other import run as other  # noqa: E402
from tests.blind.table import _gains  # noqa: E402

DOCS = ROOT / "docs"


@pytest.mark.parametrize(
    ("world", "name", "mark"), [(page, "blind", "blind"), (other, "other-blind", "blind-other")]
)
def test_a_run_written_again_leaves_page_and_file_as_they_are(
    world: ModuleType, name: str, mark: str, tmp_path: Path
) -> None:
    (tmp_path / "results").mkdir()
    files = [shutil.copy(path, tmp_path / "results") for path in (DOCS / "results").glob(f"{name}-*.json")]
    assert files
    shutil.copy(DOCS / "results.md", tmp_path)
    before = (tmp_path / "results.md").read_text("utf-8")
    file = Path(files[0])
    written = file.read_text("utf-8")
    run = json.loads(written)
    page.write_section(tmp_path, (name, mark), run, {"written": run["written"]}, world._HEAD, world._section)
    assert (tmp_path / "results.md").read_text("utf-8") == before
    assert file.read_text("utf-8") == written
    page.write_section(
        tmp_path, (name, mark), run, {"written": "in another year"}, world._HEAD, world._section
    )
    assert "in another year" in (tmp_path / "results.md").read_text("utf-8"), "the check itself can fail"


def _row(named: list[str], before2: float, after2: float) -> dict[str, object]:
    gain = {"before2": before2, "after2": after2, "noise2": 1.0, "shipped": 0.0}
    return {"stratum": "one", "truth": ["hysteresis"], "k": [3.0], "named": named, "gain": gain}


def test_what_is_gained_is_counted_over_all_that_was_hidden() -> None:
    """Over what was named rightly alone a cause that is never named gains nothing, and costs nothing."""
    told = {t["name"]: t for t in _gains([_row(["hysteresis"], 3.0, 1.0), _row([], 3.0, 3.0)])}
    assert told["held-out gain as share of the oracle's, k ≥ 1.7 (pooled)"]["value"] == pytest.approx(1.0)
    of_all = told["... of all that hide hysteresis, named or not"]
    assert of_all["value"] == pytest.approx(0.5) and of_all["of"] == 2 and not of_all["met"]


@pytest.mark.parametrize(
    ("after", "high", "worse", "surely"), [(0.9, 0.2, 0, 0), (1.1, 0.1, 1, 0), (1.1, -0.05, 1, 1)]
)
def test_what_is_worse_than_before_is_told_apart_from_what_is_worse_by_more_than_noise(
    after: float, high: float, worse: int, surely: int
) -> None:
    gain = {"exam_rms_before_dph": 1.0, "exam_rms_after_dph": after, "rms_removed_dph": {"high": high}}
    told = shipped_worse({"extended": {"gain": gain}})
    assert told == {"shipped": 1.0, "worse": worse, "surely_worse": surely}
    assert shipped_worse({"extended": None})["shipped"] == 0.0
