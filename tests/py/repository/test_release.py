"""A release in a clone: prepared, tagged, made into archives of what the tag holds; anything else is refused."""

from __future__ import annotations

import os
import subprocess
import sys
import zipfile
from pathlib import Path

import pytest
from conftest import ROOT

pytestmark = pytest.mark.slow

TOOLS = ("release.sh", "version.py", "archives.py", "packages.py", "reference.py")


def _run(*command: str, cwd: Path, status: int = 0, python: str = sys.executable) -> str:
    environment = os.environ | {
        "PYTHON": python,
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
    """Prepared where nothing is set up yet; archives of the tag, packages by the tag's own generator."""
    told = _run("tools/release.sh", "prepare", "0.2.0", cwd=clone, python="")
    assert "git tag -a v0.2.0" in told
    assert "## 0.2.0 (20" in (clone / "CHANGELOG.md").read_text("utf-8")
    emitter = clone / "gen" / "gyrotc" / "tables" / "amalgamate.py"
    emitter.write_text(emitter.read_text("utf-8").replace("in one file;", "in one file of the tag;"), "utf-8")
    command = clone / "gen" / "gyrotc" / "cli" / "shell.py"
    command.write_text(command.read_text("utf-8").replace("fish.", "fish of the tag."), "utf-8")
    _run("git", "commit", "-qam", "Release 0.2.0", cwd=clone)
    _run("git", "tag", "-a", "v0.2.0", "-m", "x", cwd=clone)
    (clone / "libc" / "gtc_crc.c").write_text("not of the tag", "utf-8")
    _run("tools/release.sh", "archive", "v0.2.0", "--sdist", cwd=clone)
    made = clone / "build" / "release" / "0.2.0"
    assert {"gyrotc-0.2.0.tar.gz", "sbom-c.cdx.json", "SHA256SUMS", "packages"} <= {
        p.name for p in made.iterdir()
    }
    packages = list((made / "packages").iterdir())
    assert len(packages) == 4 and all(p.is_file() and "0.2.0" in p.name for p in packages)
    (arduino,) = (p for p in packages if "arduino" in p.name)
    with zipfile.ZipFile(arduino) as archive:
        source = archive.read("gyrotc/src/gtc.c").decode()
    assert "in one file of the tag;" in source and "not of the tag" not in source
    page = "gyrotc-0.2.0/gyrotc/manual/reference-cli.md"
    assert "fish of the tag." in _run("tar", "-xzOf", "gyrotc-0.2.0.tar.gz", page, cwd=made)
    _run("sha256sum", "-c", "--quiet", "SHA256SUMS", cwd=made)
    listed = {line.split(maxsplit=1)[1] for line in (made / "SHA256SUMS").read_text("ascii").splitlines()}
    files = {p.relative_to(made).as_posix() for p in made.rglob("*") if p.is_file()}
    assert listed == files - {"SHA256SUMS"}
    (clone / "libc" / "gtc_crc.c").unlink()
    _run("git", "checkout", "-q", ".", cwd=clone)
    assert "there is a tag v0.2.0 already" in _run(
        "tools/release.sh", "prepare", "0.2.0", cwd=clone, status=2
    )


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


def test_archives_need_what_make_setup_makes_and_say_so(clone: Path) -> None:
    _run("git", "tag", "v9.9.9", cwd=clone)
    told = _run("tools/release.sh", "archive", "v9.9.9", cwd=clone, status=2, python="")
    assert "there is no .venv here: make setup" in told


def test_a_tag_of_another_version_is_refused(clone: Path) -> None:
    _run("git", "tag", "v9.9.9", cwd=clone)
    assert "holds another version" in _run("tools/release.sh", "archive", "v9.9.9", cwd=clone, status=2)
    assert not (clone / "build" / "release").exists()
