"""The sections on blind runs are made from their files, by one text for both worlds."""

from __future__ import annotations

import json
import shutil
import sys
from pathlib import Path
from types import ModuleType

import pytest

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT))

from tests.blind import page  # noqa: E402
from tests.blind.other import run as other  # noqa: E402

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
