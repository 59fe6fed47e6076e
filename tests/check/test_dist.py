"""Archives of a release: what they hold, that they are made the same twice, what is refused."""

from __future__ import annotations

import gzip
import hashlib
import json
import os
import re
import shutil
import subprocess
import sys
import tarfile
import zipfile
from pathlib import Path

import archives
import pytest
import reference
import version
from conftest import ROOT

TOP = f"gyrotc-{version.header_version(ROOT)}"


@pytest.fixture(scope="module")
def archive(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The sdist, made at a fixed time."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("SOURCE_DATE_EPOCH", "1700000000")
        return archives.sdist(tmp_path_factory.mktemp("dist"))


@pytest.fixture(scope="module")
def unpacked(archive: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("unpacked")
    archives.unpack(archive, folder)
    return folder / TOP


def test_made_twice_it_is_the_same(archive: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("SOURCE_DATE_EPOCH", "1700000000")
    assert archives.sdist(tmp_path).read_bytes() == archive.read_bytes()
    with tarfile.open(archive) as opened:
        assert {(e.mtime, e.uid, e.uname, e.mode) for e in opened} == {(1700000000, 0, "", 0o644)}
    assert gzip.decompress(archive.read_bytes()) and archive.read_bytes()[4:8] == b"\0\0\0\0"


def test_it_holds_generator_core_runtime_templates_targets_pages_and_licence(unpacked: Path) -> None:
    tracked = subprocess.run(
        ["git", "ls-files", "gen", "include", "libc"], cwd=ROOT, capture_output=True, text=True, check=False
    )
    if tracked.returncode != 0:
        pytest.skip("git is not installed, or this is no clone")
    for name in tracked.stdout.splitlines():
        inside = name.removeprefix("gen/") if name.startswith("gen/") else f"gyrotc/runtime/{name}"
        assert (unpacked / inside).read_bytes() == (ROOT / name).read_bytes(), name
    for name in ("LICENSE", "README.md", "PKG-INFO", "gyrotc/manual/howto-firmware.md", "gyrotc/runtime/LICENSE"):
        assert (unpacked / name).is_file()
    for name in reference.PAGES:
        page = unpacked / "gyrotc" / "manual" / name
        assert page.read_text("utf-8") == reference.PAGES[name]().rstrip() + "\n"
    assert not [p for p in unpacked.rglob("*") if p.suffix in (".so", ".pyc")]


def test_the_unpacked_generator_emits_the_golden_files_alone(unpacked: Path, tmp_path: Path) -> None:
    """Without the sources beside it: it finds the runtime that it carries."""
    program = (
        "import sys; sys.meta_path = [f for f in sys.meta_path if 'gyrotc' not in type(f).__module__]\n"
        "from pathlib import Path\n"
        "import gyrotc; from gyrotc.tables.emission import emit; from gyrotc.model import load_model\n"
        "assert Path(gyrotc.__file__).parents[1] == Path.cwd(), gyrotc.__file__\n"
        "emit(load_model(Path(sys.argv[1])), Path(sys.argv[2]))"
    )
    model = ROOT / "examples" / "minimal" / "model.json"
    done = subprocess.run(
        [sys.executable, "-c", program, model, tmp_path / "out"],
        cwd=unpacked,
        env={"PATH": "/usr/bin:/bin", "PYTHONPATH": str(unpacked)},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    for name in ("gtc_rlg_0042.c", "gtc_rlg_0042.h"):
        assert (tmp_path / "out" / "c" / name).read_bytes() == (model.parent / name).read_bytes()


def test_bills_of_materials_name_what_is_needed(tmp_path: Path) -> None:
    generator, c = (json.loads(path.read_text("utf-8")) for path in archives.sboms(tmp_path))
    for bom in (generator, c):
        assert (bom["bomFormat"], bom["specVersion"]) == ("CycloneDX", "1.5")
        assert bom["metadata"]["component"]["version"] == version.header_version(ROOT)
        refs = [component["bom-ref"] for component in bom["components"]]
        assert len(refs) == len(set(refs)) > 5 and bom["dependencies"][0]["dependsOn"] == refs
        assert all(component["licenses"] for component in bom["components"])
    names = {component["name"] for component in generator["components"]}
    assert {"numpy", "scipy", "pyarrow", "pydantic", "Eigen", "nanobind"} <= names
    assert "pytest" not in names, "a tool of developers is no part of the product"
    for component in c["components"]:
        content = (ROOT / component["name"]).read_bytes()
        assert component["hashes"][0]["content"] == hashlib.sha256(content).hexdigest()


def test_every_file_has_a_licence_that_lies_in_licenses() -> None:
    """REUSE: one rule for all; the text of the licence it names is there. `reuse lint` says the rest."""
    rules = (ROOT / "REUSE.toml").read_text("utf-8")
    assert 'path = "**"' in rules and 'SPDX-License-Identifier = "MIT"' in rules
    text = (ROOT / "LICENSES" / "MIT.txt").read_text("utf-8")
    assert (ROOT / "LICENSE").read_text("utf-8").startswith(text)
    reuse = shutil.which("reuse")
    if reuse is None:
        pytest.skip("reuse is not installed")
    done = subprocess.run([reuse, "lint"], cwd=ROOT, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout


TOOLS = ("release.sh", "version.py", "archives.py", "reference.py")


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
    """Measured, then prepared where nothing is set up yet; archives of the tag, packages by its own generator."""
    command = clone / "gen" / "gyrotc" / "cli" / "schema.py"
    command.write_text(
        command.read_text("utf-8").replace("Print the JSON Schema of", "Print of the tag the JSON Schema of"), "utf-8"
    )
    _run("git", "commit", "-qam", "The command of the release", cwd=clone)
    _measured_with(clone, _run("git", "rev-parse", "--short=8", "HEAD", cwd=clone).strip())
    _run("git", "commit", "-qam", "The records of the release", cwd=clone)
    reported = _run("tools/release.sh", "prepare", "0.2.0", cwd=clone, python="")
    assert "git tag -a v0.2.0" in reported
    assert "## 0.2.0 (20" in (clone / "CHANGELOG.md").read_text("utf-8")
    _run("git", "commit", "-qam", "Release 0.2.0", cwd=clone)
    _run("git", "tag", "-a", "v0.2.0", "-m", "x", cwd=clone)
    (clone / "libc" / "gtc_f32.c").write_text("not of the tag", "utf-8")
    _run("tools/release.sh", "archive", "v0.2.0", "--sdist", cwd=clone)
    made = clone / "build" / "release" / "0.2.0"
    names = {"gyrotc-0.2.0.tar.gz", "gyrotc-c-0.2.0.tar.gz", "sbom-c.cdx.json", "sbom-generator.cdx.json", "SHA256SUMS"}
    assert {p.name for p in made.iterdir()} == names
    library = made / "gyrotc-c-0.2.0.tar.gz"
    with tarfile.open(library) as archive:
        assert {f"gyrotc-c-0.2.0/{name}" for name in ("LICENSE", "CMakeLists.txt", "zephyr/module.yml")} <= set(
            archive.getnames()
        )
        source = archive.extractfile("gyrotc-c-0.2.0/libc/gtc_f32.c")
        assert source is not None and b"not of the tag" not in source.read()
    page = "gyrotc-0.2.0/gyrotc/manual/reference-cli.md"
    assert "Print of the tag the JSON Schema of" in _run("tar", "-xzOf", "gyrotc-0.2.0.tar.gz", page, cwd=made)
    _run("sha256sum", "-c", "--quiet", "SHA256SUMS", cwd=made)
    listed = {line.split(maxsplit=1)[1] for line in (made / "SHA256SUMS").read_text("ascii").splitlines()}
    files = {p.relative_to(made).as_posix() for p in made.rglob("*") if p.is_file()}
    assert listed == files - {"SHA256SUMS"}
    (clone / "libc" / "gtc_f32.c").unlink()
    _run("git", "checkout", "-q", ".", cwd=clone)
    assert "there is a tag v0.2.0 already" in _run("tools/release.sh", "prepare", "0.2.0", cwd=clone, status=2)


def _measured_with(folder: Path, commit: str) -> None:
    """Write a commit into every record, as if it had been measured with its sources."""
    for record in (folder / "docs" / "results").glob("*.json"):
        record.write_text(re.sub(r'"commit": "[^"]*"', f'"commit": "{commit}"', record.read_text("utf-8")), "utf-8")


@pytest.mark.parametrize("path", ["gen/gyrotc/model.py", "libc/gtc_f32.c", "include/gtc.h"])
def test_a_release_whose_records_are_of_other_sources_is_refused_by_their_names(clone: Path, path: str) -> None:
    """A line of the sources may not differ; the version may, as the test above shows."""
    measured = _run("git", "rev-parse", "--short=8", "HEAD", cwd=clone).strip()
    _measured_with(clone, measured)
    with (clone / path).open("a", encoding="utf-8") as source:
        source.write("\n" if path.endswith(".py") else "/* changed */\n")
    version = _run(sys.executable, "tools/version.py", cwd=clone).strip()
    _run("git", "commit", "-qam", "Change", cwd=clone)
    changelog = clone / "CHANGELOG.md"
    changelog.write_text(re.sub(r"\(unreleased\)", "(2026-01-01)", changelog.read_text("utf-8"), count=1), "utf-8")
    _run("git", "commit", "-qam", "Release", cwd=clone)
    _run("git", "tag", f"v{version}", cwd=clone)
    reported = _run("tools/release.sh", "archive", f"v{version}", "--sdist", cwd=clone, status=2)
    assert f"accuracy ({measured}), blind ({measured})" in reported and not (clone / "build" / "release").exists()


@pytest.mark.parametrize(
    ("words", "why"),
    [
        (("prepare", "2"), "is no version"),
        (("archive", "0.2.0"), "is no tag"),
        (("archive", "v0.2.0"), "there is no tag v0.2.0"),
        (("prepare",), "is no version"),
        ((), "expected prepare or archive"),
    ],
)
def test_what_is_no_release_is_refused(clone: Path, words: tuple[str, ...], why: str) -> None:
    assert why in _run("tools/release.sh", *words, cwd=clone, status=2)


def test_archives_need_what_make_setup_makes_and_say_so(clone: Path) -> None:
    _run("git", "tag", "v9.9.9", cwd=clone)
    reported = _run("tools/release.sh", "archive", "v9.9.9", cwd=clone, status=2, python="")
    assert "there is no .venv here: make setup" in reported


def test_a_tag_of_another_version_is_refused(clone: Path) -> None:
    _run("git", "tag", "v9.9.9", cwd=clone)
    assert "holds another version" in _run("tools/release.sh", "archive", "v9.9.9", cwd=clone, status=2)
    assert not (clone / "build" / "release").exists()


def test_pip_from_the_sources_carries_runtime_and_licences(tmp_path: Path) -> None:
    """As `pip install ./gen`, or from git with `#subdirectory=gen`, builds it: a wheel that can emit."""
    made = tmp_path / "made"
    _run(sys.executable, "-m", "pip", "wheel", "-q", "--no-deps", "-w", str(made), "./gen", cwd=ROOT)
    (wheel,) = made.glob("*.whl")
    with zipfile.ZipFile(wheel) as archive:
        names = set(archive.namelist())
        (name,) = (n for n in names if n.endswith(".dist-info/METADATA"))
        metadata = archive.read(name).decode()
    assert {
        "gyrotc/runtime/include/gtc.h",
        "gyrotc/runtime/libc/gtc_f32.c",
        "gyrotc/runtime/LICENSE",
    } <= names
    texts = {n.rpartition("/")[2] for n in names if ".dist-info/licenses/" in n}
    assert {"LICENSE", "MPL-2.0.txt", "nanobind.txt", "robin-map.txt"} <= texts
    for word in ("MPL-2.0", "BSD-3-Clause", "Project-URL: Source", "# gyrotc"):
        assert word in metadata, word
