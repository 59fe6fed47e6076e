"""Result folders: what gyrotc did not write is never lost, and what it wrote is there as it was or whole and new."""

from __future__ import annotations

import errno
import json
import os
import random
import subprocess
import sys
import threading
from contextlib import suppress
from pathlib import Path
from typing import Any

import pytest
from gyrotc.common.errors import GyrotcError, InputError
from gyrotc.store import folder as folders
from gyrotc.store import update as exchanging
from gyrotc.store import update as updating
from gyrotc.store.files import json_text, write_atomically
from gyrotc.store.folder import result_folder, write_result
from gyrotc.store.marker import MARKER, check_apart, faults, read_marker


def write(out: Path, text: str, command: str = "build", serial: str = "A", **options: object) -> None:
    """A result of a few files."""
    with result_folder(out, command, **options) as stage:  # type: ignore[arg-type]
        stage.of(serial)
        (stage.folder / "c").mkdir()
        (stage.folder / "c" / "table.c").write_text(text)
        write_atomically(stage.folder / "model.json", text)


def update(out: Path, *names: str, text: str = "later") -> None:
    """Some entries of it."""
    with result_folder(out, "verify", kind="", entries=names) as stage:
        for name in names:
            path = stage.folder / name
            path.parent.mkdir(exist_ok=True)
            if "." not in name:
                path.mkdir()
                path = path / "table.c"
            path.write_text(text)


def content(folder: Path) -> dict[str, str]:
    """Every file but the markers."""
    return {
        p.relative_to(folder).as_posix(): p.read_text()
        for p in sorted(folder.rglob("*"))
        if p.is_file() and p.name != MARKER
    }


@pytest.fixture(params=["exchange", "link"])
def out(request: pytest.FixtureRequest, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A place for a result, on a system that exchanges names and on one that does not."""
    if request.param == "link":
        for module in (exchanging, folders, updating):
            monkeypatch.setattr(module, "exchange", lambda *_: False)
    return tmp_path / "out"


def test_a_result_is_replaced_and_nothing_is_left_beside_it(out: Path) -> None:
    for text in ("one", "two", "three"):
        write(out, text)
        assert content(out) == {"c/table.c": text, "model.json": text}
        assert not faults(out)
    marker = read_marker(out)
    assert marker is not None
    assert (marker.kind, marker.command, marker.serial) == ("result", "build", "A")
    beside = {p.name for p in out.parent.iterdir()} - {"out"}
    assert beside == ({out.readlink().name} if out.is_symlink() else set())


def test_entries_are_replaced_and_the_rest_stays(out: Path) -> None:
    write(out, "one")
    kept = (out / "model.json").stat().st_ino
    update(out, "verify.json")
    update(out, "verify.json", "c", text="two")
    assert content(out) == {"c/table.c": "two", "model.json": "one", "verify.json": "two"}
    assert (out / "model.json").stat().st_ino == kept
    assert not faults(out)
    update(out, "c", text="three")
    assert content(out)["c/table.c"] == "three" and not faults(out)
    write(out, "four")
    assert content(out) == {"c/table.c": "four", "model.json": "four"}


def test_a_failed_job_leaves_all_as_it_was(out: Path) -> None:
    write(out, "one")
    for error in (RuntimeError, KeyboardInterrupt):
        with pytest.raises(error), result_folder(out, "build") as stage:
            (stage.folder / "model.json").write_text("half")
            raise error
    with pytest.raises(GyrotcError, match="No space left"), result_folder(out, "build"):
        raise OSError(28, "No space left on device")
    assert content(out) == {"c/table.c": "one", "model.json": "one"} and not faults(out)


def test_a_foreign_file_stops_the_job_before_it_begins(out: Path) -> None:
    write(out, "one")
    (out / "c" / "mine.c").write_text("mine")
    with pytest.raises(InputError, match=r"c/mine\.c"), result_folder(out, "build"):
        pytest.fail("began")
    with pytest.raises(InputError, match=r"c/mine\.c"), result_folder(out, "emit", entries=["c"]):
        pytest.fail("began")
    update(out, "verify.json")
    assert content(out)["c/mine.c"] == "mine"


def test_an_empty_foreign_folder_a_link_and_an_edited_file_are_seen(out: Path) -> None:
    for name, change in {
        "notes/": (out / "notes").mkdir,
        "link": lambda: (out / "link").symlink_to("/"),
        "model.json": lambda: (out / "model.json").write_text("edited"),
    }.items():
        write(out, "one")
        change()
        with pytest.raises(InputError, match=name), result_folder(out, "build"):
            pytest.fail("began")
        subprocess.run(["rm", "-r", out / name], check=True)


def test_folders_of_others_are_refused(out: Path) -> None:
    out.mkdir()
    write(out, "into an empty folder")
    (out / MARKER).unlink()
    with pytest.raises(InputError, match="was not written by gyrotc"), result_folder(out, "build"):
        pytest.fail("began")
    with pytest.raises(InputError, match=r"model\.json"), result_folder(out, "fit", entries=["model.json"]):
        pytest.fail("began")
    (out / MARKER).write_text("{")
    with pytest.raises(InputError, match="is no marker"), result_folder(out, "build"):
        pytest.fail("began")


def test_another_kind_and_another_serial_are_refused(out: Path) -> None:
    write(out, "one")
    with pytest.raises(InputError, match=r"holds the result of gyrotc build"), result_folder(out, "plan"):
        pytest.fail("began")
    with pytest.raises(InputError, match="serial A, and this is of B"):
        write(out, "two", serial="B")
    write(out, "two", command="fit")
    with result_folder(out, "build") as stage:
        stage.of("B", any_serial=True)
    assert content(out) == {}


def test_inputs_and_sources_are_out_of_reach(tmp_path: Path) -> None:
    data = tmp_path / "lab" / "data"
    data.mkdir(parents=True)
    (tmp_path / "alias").symlink_to(data)
    package = Path(folders.__file__).parents[1]
    for out in (
        data,
        data / "out",
        tmp_path / "lab",
        tmp_path / "alias" / "x",
        package,
        package / "x",
        Path("/"),
    ):
        with pytest.raises(InputError), result_folder(out, "build", inputs=[data]):
            pytest.fail("began")
    with pytest.raises(InputError), result_folder(package, "emit", entries=["c"]):
        pytest.fail("began")
    check_apart(tmp_path, tmp_path, [data], whole=False)  # a job that only adds may stand above a .venv
    assert list(data.iterdir()) == []
    write(tmp_path / "lab" / "out", "beside", inputs=[data])


def test_parts_have_markers_of_their_own(out: Path) -> None:
    for text in ("one", "two"):
        with result_folder(out, "build") as stage:
            for axis in ("x", "y"):
                with result_folder(stage.folder / axis, "build") as part:
                    part.of("A", axis)
                    (part.folder / "model.json").write_text(text)
                    write_atomically(part.folder / "diagnosis" / "page", text)
                    with result_folder(part.folder / "diagnosis", "diagnose") as inner:
                        (inner.folder / "diagnose.json").write_text(text)
            (stage.folder / "report.html").write_text(text)
        update(out / "x", "verify.json")
        update(out / "y" / "diagnosis", "page", text="redrawn")
        assert not faults(out)
    marker = read_marker(out / "x")
    assert marker is not None and marker.axis == "x" and marker.parts == ("diagnosis",)
    (out / "x" / "mine").write_text("")
    with pytest.raises(InputError, match="x/mine"), result_folder(out, "build"):
        pytest.fail("began")


def test_a_second_job_is_told_who_holds_the_place(out: Path) -> None:
    with result_folder(out, "build"), pytest.raises(InputError) as caught:
        write(out, "two", "fit")
    assert f"gyrotc build, process {os.getpid()} on " in str(caught.value) and ", since 2" in str(
        caught.value
    )
    write(out, "two")
    assert not list(out.parent.glob(".*.lock"))


def test_leftovers_of_dead_jobs_go_and_those_of_others_stay(out: Path) -> None:
    code = (
        "import os, sys; from pathlib import Path; from gyrotc.store.folder import result_folder\n"
        "with result_folder(Path(sys.argv[1]), 'build') as stage:\n"
        "    (stage.folder / 'half').write_text('x'); os._exit(9)"
    )
    subprocess.run([sys.executable, "-c", code, str(out)], check=False)
    assert len(list(out.parent.iterdir())) == 2, "a lock and a folder"
    mine = out.parent / ".out.gyrotc-part-mine"
    mine.mkdir()
    (mine / "thesis.tex").write_text("years")
    write(out, "one")
    left = {p.name for p in out.parent.iterdir() if p.name != "out"} - {
        out.readlink().name if out.is_symlink() else ""
    }
    assert left == {mine.name} and (mine / "thesis.tex").read_text() == "years"


def _forged(folder: Path, *parts: str) -> None:
    folder.mkdir(parents=True, exist_ok=True)
    text = {
        "schema": "gyrotc.result/1", "gyrotc_version": "0.1.0", "kind": "result", "command": "build",
        "serial": "A", "axis": None,
    }  # fmt: skip
    (folder / MARKER).write_text(json.dumps(text | {"files": {}, "parts": parts}))


@pytest.mark.parametrize("way", ["absolute", "above", "behind a link", "behind two"])
def test_a_forged_marker_reaches_nothing_outside(out: Path, way: str) -> None:
    """Before: a folder beside `--out` (from a supplier's archive) with a marker whose part is a folder of the user's
    deleted every file in that."""
    thesis = out.parent / "docs" / "written" / "thesis"
    thesis.parent.mkdir(parents=True)
    thesis.write_text("years")
    write(out.parent / "other", "another result")
    kept = content(out.parent)
    for place in (out, out.with_name(".out.gyrotc-part-00000000")):
        place.mkdir()
        if way.startswith("behind"):
            (place / "x").symlink_to(".x.gyrotc-part-1" if way.endswith("two") else out.parent / "docs")
            (place / ".x.gyrotc-part-1").symlink_to(out.parent / "docs")
        above = {"absolute": f"{out.parent}/", "above": "../"}.get(way, "")
        parts = [f"{above}docs/written", f"{above}other"] if above else ["x/written"]
        _forged(place, *parts)
        with suppress(InputError):
            write(out, "new")
    assert {k: v for k, v in content(out.parent).items() if k in kept} == kept
    assert thesis.read_text() == "years" and faults(out.parent / "other") == []


def test_what_a_forged_leftover_holds_goes_nowhere_else(
    tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    """A file that somebody put into a result is carried over into the next, and never through a link out of it."""
    (tmp_path / "home").mkdir()
    project, left = tmp_path / "project", tmp_path / ".project.gyrotc-part-00000000"
    project.mkdir()
    (project / "docs").symlink_to(tmp_path / "home")
    _forged(left)
    (left / "docs").mkdir()
    (left / "docs" / "authorized_keys").write_text("mine")
    update(project, "c")
    assert not any((tmp_path / "home").iterdir())
    assert "is left there" in capfd.readouterr().err and (left / "docs" / "authorized_keys").is_file()


def test_what_comes_into_a_result_while_it_is_replaced_is_carried_over(out: Path) -> None:
    write(out, "one")
    with result_folder(out, "build") as stage:
        (stage.folder / "model.json").write_text("two")
        (out / "notes.txt").write_text("thought of it just now")
        (out / "c" / "more.c").write_text("and this")
    assert content(out) == {
        "model.json": "two", "notes.txt": "thought of it just now", "c/more.c": "and this",
    }  # fmt: skip


def test_a_reader_never_finds_the_place_empty(out: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(os, "fsync", lambda _: None)
    write(out, "0")
    done, missing = threading.Event(), []

    def read() -> None:
        while not done.is_set():
            if not out.is_dir():
                missing.append(1)

    reader = threading.Thread(target=read)
    reader.start()
    try:
        for number in range(20):
            write(out, str(number))
    finally:
        done.set()
        reader.join()
    assert missing == []


def test_a_link_is_followed(tmp_path: Path) -> None:
    (tmp_path / "real").mkdir()
    (tmp_path / "alias").symlink_to("real")
    write(tmp_path / "alias", "one")
    write(tmp_path / "alias", "two")
    assert (tmp_path / "alias").is_symlink() and content(tmp_path / "real")["model.json"] == "two"


def test_json_replaces_only_what_gyrotc_wrote(tmp_path: Path) -> None:
    path = tmp_path / "new" / "x.json"
    for number in range(2):
        write_result(path, json.dumps({"schema": "gyrotc.plan/1", "n": number}))
    assert json.loads(path.read_text())["n"] == 1
    write_result(path, json.dumps({"x": {"schema": "gyrotc.plan/1"}}))
    write_result(path, json.dumps({"x": {"schema": "gyrotc.plan/1"}}))
    (tmp_path / "mine.json").write_text('{"name": "mine"}')
    (tmp_path / "run-01.csv").write_text("time_s\n")
    for other in ("mine.json", "run-01.csv", "new"):
        with pytest.raises(InputError):
            write_result(tmp_path / other, "{}")
    assert (tmp_path / "run-01.csv").read_text() == "time_s\n"
    write_result(Path("/dev/null"), "{}")
    with pytest.raises(OSError) as full:
        write_result(Path("/dev/full"), "{}")
    assert full.value.errno == errno.ENOSPC
    assert sorted(p.name for p in (tmp_path / "new").iterdir()) == ["x.json"]


@pytest.mark.parametrize("seed", range(20))
def test_json_text_is_that_of_the_standard_library(seed: int) -> None:
    """The bytes of results do not depend on how fast they are written."""
    rng = random.Random(seed)
    plain = [True, False, None, 0, -17, 1e-300, -2.5, 1e22, "", "x, y", 'ä"\\\n[{', "\u2028"]

    def drawn(depth: int) -> Any:
        kind = rng.randrange(6 if depth else 3)
        if kind < 3:
            return rng.choice(plain)
        inner = [drawn(depth - 1) for _ in range(rng.randrange(5))]
        if kind < 5:
            return inner if kind == 3 else tuple(inner)
        return {f"{rng.choice(['a', 'é', ': ', ','])}{k}": part for k, part in enumerate(inner)}

    for content in (drawn(5) for _ in range(300)):
        assert json_text(content) == json.dumps(content, indent=1) + "\n"
    for wrong in (float("nan"), [1.0, float("inf")], {"a": [[float("-inf")]]}):
        with pytest.raises(ValueError):
            json_text(wrong)
