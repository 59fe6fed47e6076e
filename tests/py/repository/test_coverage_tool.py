"""`make cov` sees a branch that no test takes."""

from __future__ import annotations

import importlib.util
import shutil
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[3]
_SPEC = importlib.util.spec_from_file_location("gyrotc_coverage", ROOT / "tools" / "coverage.py")
assert _SPEC is not None and _SPEC.loader is not None
tool = importlib.util.module_from_spec(_SPEC)
_SPEC.loader.exec_module(tool)


@pytest.mark.slow
def test_without_the_tests_of_a_file_its_lines_are_told(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    for folder in ("include", "libc", "tests/c"):
        shutil.copytree(ROOT / folder, tmp_path / folder)
    for test in (tmp_path / "tests/c").glob("test_*.c"):
        if test.stem not in ("test_map", "test_broken"):
            test.unlink()
    monkeypatch.setattr(tool, "ROOT", tmp_path)
    monkeypatch.setattr(tool, "BUILDS", {"q31": ([],)})
    monkeypatch.setattr(tool, "FLAGS", [f.replace(str(ROOT), str(tmp_path)) for f in tool.FLAGS])
    monkeypatch.setattr(sys, "argv", ["coverage.py"])
    assert tool.main() == 1
    told = capsys.readouterr().out
    assert "libc/gtc_save.inl:" in told and "never taken" in told and "never reached" in told
