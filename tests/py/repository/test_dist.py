"""Archives of `make dist`: what they hold, that they are made the same twice, and the bills of materials."""

from __future__ import annotations

import gzip
import hashlib
import json
import shutil
import subprocess
import sys
import tarfile
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[3]
sys.path.insert(0, str(ROOT / "tools"))

import archives  # noqa: E402
import reference  # noqa: E402
import version  # noqa: E402

pytestmark = pytest.mark.slow

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
    for name in ("LICENSE", "README.md", "PKG-INFO", "gyrotc/manual/porting.md", "gyrotc/runtime/LICENSE"):
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
        "import gyrotc; from gyrotc.tables.emit import emit; from gyrotc.model import load_model\n"
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
    assert {"numpy", "scipy", "pyarrow", "pydantic", "NLopt", "Eigen", "nanobind"} <= names
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
