"""Result folders and `--out`: what gyrotc did not write is never lost, what it wrote is whole, old or new."""

from __future__ import annotations

import errno
import io
import json
import os
import random
import select
import signal
import subprocess
import sys
import threading
from contextlib import suppress
from pathlib import Path
from typing import Any

import pytest
from conftest import HOST, Command
from gyrotc.cli import main
from gyrotc.common import GyrotcError, InputError
from gyrotc.results import (
    MARKER,
    held,
    json_text,
    read_marker,
    result_faults,
    result_folder,
    write_atomically,
    write_result,
)
from gyrotc.results import folder as folders
from recordings import columns, toml, write_csv


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


@pytest.fixture(params=["exchange", "renames"])
def out(request: pytest.FixtureRequest, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A place for a result, on a system that exchanges names and on one that does not."""
    if request.param == "renames":
        monkeypatch.setattr(folders, "exchange", lambda *_: False)
    return tmp_path / "out"


def test_a_result_is_replaced_and_nothing_is_left_beside_it(out: Path) -> None:
    for text in ("one", "two", "three"):
        write(out, text)
        assert content(out) == {"c/table.c": text, "model.json": text}
        assert not result_faults(out)
    marker = read_marker(out)
    assert marker is not None
    assert (marker.kind, marker.command, marker.serial) == ("result", "build", "A")
    assert [p.name for p in out.parent.iterdir()] == ["out"]


def test_entries_are_replaced_and_the_rest_stays(out: Path) -> None:
    write(out, "one")
    kept = (out / "model.json").stat().st_ino
    update(out, "verify.json")
    update(out, "verify.json", "c", text="two")
    assert content(out) == {"c/table.c": "two", "model.json": "one", "verify.json": "two"}
    assert (out / "model.json").stat().st_ino == kept
    assert not result_faults(out)
    update(out, "c", text="three")
    assert content(out)["c/table.c"] == "three" and not result_faults(out)
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
    assert content(out) == {"c/table.c": "one", "model.json": "one"} and not result_faults(out)


def test_a_foreign_file_stops_the_job_before_it_begins(out: Path) -> None:
    write(out, "one")
    (out / "c" / "mine.c").write_text("mine")
    with pytest.raises(InputError, match=r"c/mine\.c"), result_folder(out, "build"):
        pytest.fail("began")
    with pytest.raises(InputError, match=r"c/mine\.c"), result_folder(out, "emit", entries=["c"]):
        pytest.fail("began")
    (out / "notes").mkdir()
    update(out, "verify.json")
    assert content(out)["c/mine.c"] == "mine" and (out / "notes").is_dir()


def test_sha256sum_checks_a_result(out: Path) -> None:
    write(out, "one")
    update(out, "c", text="two")
    with result_folder(out, "evaluate", entries=["trace"]) as stage:
        (stage.folder / "trace").mkdir()
        (stage.folder / "trace" / "a \\ b\nc.csv").write_text("a name that sha256sum escapes")
    assert not result_faults(out)
    checked = ["sha256sum", "-c", "--strict", MARKER]
    done = subprocess.run(checked, cwd=out, capture_output=True, text=True, check=False)
    assert done.returncode == 0 and done.stdout.count(": OK") == 3, done.stdout + done.stderr
    (out / "model.json").write_text("edited")
    assert subprocess.run(checked, cwd=out, capture_output=True, check=False).returncode == 1


def test_an_edited_file_stops_who_replaces_it_and_nobody_else(out: Path) -> None:
    write(out, "one")
    (out / "model.json").write_text("edited")
    update(out, "c", text="two")
    assert content(out) == {"c/table.c": "two", "model.json": "edited"}
    assert [path.name for path in out.parent.iterdir()] == ["out"]
    assert result_faults(out) == ["model.json: missing or changed"]
    with pytest.raises(InputError, match=r"changed since gyrotc wrote it: model\.json"), result_folder(out, "build"):
        pytest.fail("began")


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
    listed = subprocess.run(["sha256sum", "model.json"], cwd=out, capture_output=True, text=True, check=True).stdout
    for text in ("{", "", listed, f"# gyrotc {{}}\n{listed}", "# gyrotc [\n"):
        (out / MARKER).write_text(text)
        with pytest.raises(InputError, match="is no marker"), result_folder(out, "build"):
            pytest.fail("began")


def test_another_kind_and_another_serial_are_refused(out: Path) -> None:
    write(out, "one")
    with pytest.raises(InputError, match=r"holds the result of gyrotc build"), result_folder(out, "compare"):
        pytest.fail("began")
    with pytest.raises(InputError, match="serial A, and this is of B"):
        write(out, "two", serial="B")
    write(out, "two", command="fit")
    assert content(out)["model.json"] == "two"


def test_inputs_and_sources_are_out_of_reach(tmp_path: Path) -> None:
    data = tmp_path / "lab" / "data"
    data.mkdir(parents=True)
    (tmp_path / "alias").symlink_to(data)
    package = Path(folders.__file__).parents[1]
    for out in (data, data / "out", tmp_path / "lab", tmp_path / "alias" / "x", package, package / "x", Path("/")):
        with pytest.raises(InputError), result_folder(out, "build", inputs=[data]):
            pytest.fail("began")
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
        assert not result_faults(out)
    marker = read_marker(out / "x")
    assert marker is not None and marker.axis == "x" and marker.parts == ("diagnosis",)
    (out / "x" / "mine").write_text("")
    with pytest.raises(InputError, match="x/mine"), result_folder(out, "build"):
        pytest.fail("began")


def test_a_second_job_is_refused(out: Path) -> None:
    with result_folder(out, "build"), pytest.raises(InputError, match="another job writes there"):
        write(out, "two", "fit")
    write(out, "two")
    assert not list(out.parent.glob(".*.lock"))


def test_leftovers_of_dead_jobs_go_and_those_of_others_stay(out: Path) -> None:
    code = (
        "import os, sys; from pathlib import Path; from gyrotc.results.folder import result_folder\n"
        "with result_folder(Path(sys.argv[1]), 'build') as stage:\n"
        "    (stage.folder / 'half').write_text('x'); os._exit(9)"
    )
    subprocess.run([sys.executable, "-c", code, str(out)], check=False)
    assert len(list(out.parent.iterdir())) == 2, "a lock and a folder"
    mine = out.parent / ".out.gyrotc-part-mine"
    mine.mkdir()
    (mine / "thesis.tex").write_text("years")
    write(out, "one")
    assert {p.name for p in out.parent.iterdir()} == {"out", mine.name}
    assert (mine / "thesis.tex").read_text() == "years"


@pytest.mark.parametrize("renamed", [1, 2])
def test_a_job_that_is_killed_between_two_renames_is_made_up_for(renamed: int, tmp_path: Path) -> None:
    """Where names cannot be exchanged the place is empty for a moment; the next job finds a whole result."""
    out = tmp_path / "out"
    write(out, "one")
    code = (
        "import os, sys; from pathlib import Path; from gyrotc.results import folder\n"
        "folder.exchange = lambda *_: False\n"
        "rename, calls = Path.rename, iter(range(9))\n"
        f"Path.rename = lambda *a: rename(*a) if next(calls) < {renamed} else os._exit(9)\n"
        "with folder.result_folder(Path(sys.argv[1]), 'build') as stage:\n"
        "    stage.of('A'); (stage.folder / 'model.json').write_text('two')\n"
    )
    subprocess.run([sys.executable, "-c", code, str(out)], check=False)
    assert out.exists() == (renamed == 2)
    update(out, "verify.json")
    assert content(out) in (
        {"c/table.c": "one", "model.json": "one", "verify.json": "later"}, {"model.json": "two", "verify.json": "later"}
    )  # fmt: skip
    assert not result_faults(out) and [p.name for p in tmp_path.iterdir()] == ["out"]


def test_an_earlier_result_comes_back_where_the_second_rename_fails(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A disk that refuses one call must not leave the place empty."""
    out = tmp_path / "out"
    write(out, "one")
    monkeypatch.setattr(folders, "exchange", lambda *_: False)
    rename, calls = Path.rename, iter(range(9))

    def failing(path: Path, target: Path) -> Path:
        if next(calls) == 1:
            raise OSError(errno.EIO, "Input/output error", str(target))
        return rename(path, target)

    monkeypatch.setattr(Path, "rename", failing)
    with pytest.raises(GyrotcError, match="Input/output error"):
        write(out, "two")
    assert content(out) == {"c/table.c": "one", "model.json": "one"} and not result_faults(out)
    assert [p.name for p in tmp_path.iterdir()] == ["out"]


def _forged(folder: Path, *parts: str) -> None:
    folder.mkdir(parents=True, exist_ok=True)
    head = {"kind": "result", "command": "build", "serial": "A", "axis": None, "parts": parts, "finished": True}
    (folder / MARKER).write_text(f"# gyrotc {json.dumps(head)}\n")


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
    assert thesis.read_text() == "years" and result_faults(out.parent / "other") == []


def test_what_comes_into_a_result_while_it_is_replaced_is_kept(out: Path, capfd: pytest.CaptureFixture[str]) -> None:
    write(out, "one")
    with result_folder(out, "build") as stage:
        (stage.folder / "model.json").write_text("two")
        (out / "notes.txt").write_text("thought of it just now")
        (out / "c" / "more.c").write_text("and this")
    assert content(out) == {"model.json": "two"}
    kept = out.with_name("out.left-1")
    assert content(kept) == {"notes.txt": "thought of it just now", "c/more.c": "and this"}
    assert str(kept) in capfd.readouterr().err


def test_a_reader_never_finds_the_place_empty(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    out = tmp_path / "out"
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
        write_result(path, json.dumps({"schema": "gyrotc.check/1", "n": number}))
    assert json.loads(path.read_text())["n"] == 1
    write_result(path, json.dumps({"x": {"schema": "gyrotc.check/1"}}))
    write_result(path, json.dumps({"x": {"schema": "gyrotc.check/1"}}))
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


def test_a_long_list_of_numbers_is_one_line_of_a_result() -> None:
    """No line end and blanks for each number."""
    series = [0.5, -17, 1e22] * 20
    for content in (series, {"a": [series, None]}, {"of": {"text": [*series, "x"]}, "short": series[:32]}):
        assert json.loads(json_text(content)) == content
    assert json_text({"a": series}).count("\n") == 3
    assert json_text({"a": series[:32]}).count("\n") == 36
    with pytest.raises(ValueError):
        json_text([*series, float("nan")])


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory, gyrotc: Command) -> Path:
    """Two small gyros in `A` and `B`, and a result of the first in `result`."""
    folder = tmp_path_factory.mktemp("outputs")
    table = columns(360)
    for serial in ("A", "B"):
        write_csv(folder / serial / "run-01.csv", table | {"rate_dph": table["rate_dph"] - 20.0})
        head = f'schema = 1\nserial = "{serial}"\nearth_rate = "removed"'
        (folder / serial / "dataset.toml").write_text(toml('file = "run-01.csv"', head=head))
    assert gyrotc("fit", folder / "A", "--out", folder / "result").returncode == 0
    return folder


def tree(folder: Path) -> dict[str, bytes]:
    return {p.relative_to(folder).as_posix(): p.read_bytes() for p in sorted(folder.rglob("*")) if p.is_file()}


def refused(command: Command, folder: Path, *arguments: object, reported: str) -> None:
    """The command ends with 2 and one line, and nothing in the folder has changed."""
    before = tree(folder)
    done = command(*arguments)
    assert done.returncode == 2 and reported in done.stderr, done.stdout + done.stderr
    assert done.stderr.count("\n") == 1 and "Traceback" not in done.stderr
    assert tree(folder) == before


@pytest.mark.parametrize("decoy", ["model.json", "manifest.json", "c"])
def test_a_firmware_project_is_not_taken_for_a_result(decoy: str, made: Path, tmp_path: Path, gyrotc: Command) -> None:
    project = tmp_path / "firmware"
    (project / ".git").mkdir(parents=True)
    (project / ".git" / "HEAD").write_text("ref")
    (project / decoy).mkdir() if decoy == "c" else (project / decoy).write_text("{}")
    (project / "thesis.tex").write_text("years of work")
    for command in ("build", "fit", "compare", "diagnose") if decoy == "c" else ("build",):
        refused(gyrotc, tmp_path, command, made / "A", "--out", project, reported="was not written by gyrotc")
    if decoy != "c":
        return
    refused(gyrotc, tmp_path, "simulate", "paper", "--out", project, reported="was not written by gyrotc")


def test_recordings_are_no_place_for_a_result(made: Path, gyrotc: Command) -> None:
    data = made / "A"
    for command in ("build", "fit", "compare", "diagnose"):
        refused(gyrotc, made, command, data, "--out", data, reported="is the data set")
        refused(gyrotc, made, command, data, "--out", data / "x", reported="inside the data set")
        refused(gyrotc, made, command, data, "--out", made, reported="above the data set")
    refused(gyrotc, made, "check", data, "--json", data / "run-01.csv", reported="run-01.csv")
    refused(gyrotc, made, "emit", made / "result", "--out", data / ".." / "A" / "run-01.csv", reported="is a file")


def test_emit_writes_into_a_folder_of_its_own(made: Path, tmp_path: Path, gyrotc: Command) -> None:
    (tmp_path / "src.c").write_text("mine")
    refused(gyrotc, tmp_path, "emit", made / "result", "--out", tmp_path, reported="was not written by gyrotc")
    out = tmp_path / "gyro"
    for _ in range(2):
        assert gyrotc("emit", made / "result", "--out", out, "--numeric", "f32").returncode == 0
    assert (out / "c" / "gtc_f32.c").is_file()
    (out / "c" / "main.c").write_text("edited")
    refused(gyrotc, tmp_path, "emit", made / "result", "--out", out, reported="c/main.c")


def test_a_job_of_another_kind_or_serial_is_refused(made: Path, tmp_path: Path, gyrotc: Command) -> None:
    out = tmp_path / "result"
    assert gyrotc("fit", made / "A", "--out", out).returncode == 0
    refused(gyrotc, tmp_path, "fit", made / "B", "--out", out, reported="holds the result of serial A")
    refused(gyrotc, tmp_path, "compare", made / "A", "--out", out, reported="holds the result of gyrotc fit")
    (out / MARKER).unlink()
    refused(gyrotc, tmp_path, "fit", made / "A", "--out", out, reported=MARKER)


def test_steps_add_to_one_folder_and_a_new_fit_begins_anew(made: Path, tmp_path: Path, gyrotc: Command) -> None:
    out = tmp_path / "result"
    steps = (
        ("fit", made / "A", "--out", out),
        ("emit", out / "model.json", "--out", out, "--numeric", "f32"),
        ("evaluate", out, made / "A", "--trace", out / "trace"),
        ("report", out),
        ("verify", out, "--target", "host-gcc-O2"),
    )
    for step in (*steps, *steps[1:4]):
        done = gyrotc(*step)
        assert done.returncode == 0, done.stderr
        assert not result_faults(out)
    assert {p.name for p in out.iterdir()} == {
        MARKER, "model.json", "training.json", "c", "evaluate.json", "trace", "report.html", "verify.json",
    }  # fmt: skip
    (out / "trace" / "notes.txt").write_text("mine")
    refused(gyrotc, tmp_path, *steps[2], reported="trace/notes.txt")
    (out / "trace" / "notes.txt").unlink()
    for trace in (out, out / "c"):
        refused(gyrotc, tmp_path, "evaluate", out, made / "A", "--trace", trace, reported="--trace")
    refused(gyrotc, tmp_path, "evaluate", out, made / "A", "--trace", made / "A", reported="is the data set")
    assert gyrotc(*steps[0]).returncode == 0
    assert {p.name for p in out.iterdir()} == {MARKER, "model.json", "training.json"}
    marker = read_marker(out)
    assert marker is not None and marker.serial == "A"


def test_two_jobs_into_one_place(made: Path, tmp_path: Path, gyrotc: Command) -> None:
    with held(tmp_path / "out"):
        refused(gyrotc, tmp_path, "fit", made / "A", "--out", tmp_path / "out", reported="another job writes there")
    assert gyrotc("fit", made / "A", "--out", tmp_path / "out").returncode == 0


def test_a_full_disk_and_a_place_that_cannot_be_written(made: Path, tmp_path: Path, gyrotc: Command) -> None:
    refused(gyrotc, tmp_path, "check", made / "A", "--json", "/dev/full", reported="No space left")
    refused(gyrotc, tmp_path, "fit", made / "A", "--out", "/proc/out", reported="/proc")
    refused(gyrotc, tmp_path, "fit", made / "A", "--out", made / "A" / "run-01.csv" / "x", reported="run-01.csv")
    program = Path(sys.executable).with_name("gyrotc")
    with Path("/dev/full").open("w") as full:
        done = subprocess.run(
            [program, "check", made / "A"], stdout=full, stderr=subprocess.PIPE, text=True, check=False
        )
    assert (done.returncode, done.stderr) == (2, "gyrotc: standard output: No space left on device\n")


def test_output_that_cannot_be_written_is_reported_once(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """Some releases of Python keep what they could not write, and try again at the end."""

    class Full(io.StringIO):
        def flush(self) -> None:
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr(sys, "stdout", Full())
    assert [main.flushed(status) for status in (2, 0)] == [2, 2]
    assert capsys.readouterr().err == "gyrotc: standard output: No space left on device\n"


def test_a_closed_pipe_is_reported_as_shells_expect(made: Path) -> None:
    program = Path(sys.executable).with_name("gyrotc")
    reader, writer = os.pipe()
    os.close(reader)
    done = subprocess.run([program, "check", made / "A"], stdout=writer, stderr=subprocess.PIPE, text=True, check=False)
    os.close(writer)
    assert (done.returncode, done.stderr) == (128 + signal.SIGPIPE, "")


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGINT, signal.SIGHUP])
def test_a_signal_cleans_up_and_ends_as_shells_expect(number: signal.Signals, made: Path, tmp_path: Path) -> None:
    """While it waits for a compiler, which says that it was started and then never ends."""
    tools, started, place = tmp_path / "tools", tmp_path / "started", tmp_path / "place"
    for folder in (tools, place):
        folder.mkdir()
    os.mkfifo(started)
    waiting = os.open(started, os.O_RDONLY | os.O_NONBLOCK)
    (tools / "gcc").write_text(f"#!/bin/sh\necho >'{started}'\nexec sleep 600\n")
    (tools / "gcc").chmod(0o755)
    program = Path(sys.executable).with_name("gyrotc")
    # A job in the background of a shell inherits that SIGINT is ignored; env undoes it, and becomes the program.
    job = subprocess.Popen(
        ["env", "--default-signal", program, "build", made / "A", *HOST, "--out", place / "out"],
        env=os.environ | {"PATH": f"{tools}:{os.environ['PATH']}"},
        stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True,
    )  # fmt: skip
    select.select([waiting, job.stderr], [], [])  # it ends or complains where no compiler is called
    writing = list(place.glob(".out.gyrotc-part-*"))
    job.send_signal(number)
    _, says = job.communicate()
    os.close(waiting)
    assert (job.returncode, says) == (-number, f"gyrotc: interrupted ({number.name})\n")
    assert writing and list(place.iterdir()) == []
