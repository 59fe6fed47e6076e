"""A release in a clone: prepared, tagged, made into archives of what the tag holds; anything else is refused."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest
from conftest import ROOT

TOOLS = ("release.sh", "version.py", "archives.py", "packages.py")


def _run(*command: str, cwd: Path, status: int = 0) -> str:
    environment = os.environ | {
        "PYTHON": sys.executable,
        "GIT_AUTHOR_NAME": "a", "GIT_AUTHOR_EMAIL": "a@b", "GIT_COMMITTER_NAME": "a", "GIT_COMMITTER_EMAIL": "a@b",
    }  # fmt: skip
    done = subprocess.run(command, cwd=cwd, env=environment, capture_output=True, text=True, check=False)
    assert done.returncode == status, done.stdout + done.stderr
    return done.stdout + done.stderr


@pytest.fixture
def clone(tmp_path: Path) -> Path:
    """The last commit, with the tools of this tree."""
    if not (ROOT / ".git").exists():
        pytest.skip("the sources are an archive without history")
    folder = tmp_path / "clone"
    made = subprocess.run(
        ["git", "clone", "-q", "--shared", str(ROOT), str(folder)],
        capture_output=True,
        text=True,
        check=False,
    )
    if made.returncode != 0:
        pytest.skip(f"git does not clone the sources: {made.stderr.strip()[:100]}")
    for name in TOOLS:
        (folder / "tools" / name).write_bytes((ROOT / "tools" / name).read_bytes())
        (folder / "tools" / name).chmod(0o755)
    _run("git", "add", "-A", cwd=folder)
    _run("git", "commit", "-q", "--allow-empty", "-m", "tools", cwd=folder)
    return folder


def test_from_tag_to_archives(clone: Path) -> None:
    told = _run("tools/release.sh", "prepare", "0.2.0", cwd=clone)
    assert "git tag -a v0.2.0" in told
    assert "## 0.2.0 (20" in (clone / "CHANGELOG.md").read_text("utf-8")
    _run("git", "commit", "-qam", "Release 0.2.0", cwd=clone)
    _run("git", "tag", "-a", "v0.2.0", "-m", "x", cwd=clone)
    (clone / "libc" / "gtc_crc.c").write_text("not of the tag", "utf-8")
    _run("tools/release.sh", "archive", "v0.2.0", "--sdist", cwd=clone)
    made = clone / "build" / "release" / "0.2.0"
    assert {"gyrotc-0.2.0.tar.gz", "sbom-c.cdx.json", "SHA256SUMS", "packages"} <= {
        p.name for p in made.iterdir()
    }
    assert any("0.2.0" in p.name for p in (made / "packages").iterdir())
    _run("sha256sum", "-c", "--quiet", "SHA256SUMS", cwd=made)


@pytest.mark.parametrize(
    ("words", "why"),
    [
        (("prepare", "2"), "is no version"),
        (("archive", "0.2.0"), "is no tag"),
        (("archive", "v0.2.0"), "there is no tag v0.2.0"),
        ((), "expected prepare or archive"),
    ],
)
def test_what_is_no_release_is_refused(clone: Path, words: tuple[str, ...], why: str) -> None:
    assert why in _run("tools/release.sh", *words, cwd=clone, status=2)


def test_a_tag_of_another_version_is_refused(clone: Path) -> None:
    _run("git", "tag", "v9.9.9", cwd=clone)
    assert "holds another version" in _run("tools/release.sh", "archive", "v9.9.9", cwd=clone, status=2)
    assert not (clone / "build" / "release").exists()
