"""Nobody's recordings, models or folders run code here; what is compiled and run has limits and leaves no process."""

from __future__ import annotations

import re
import shutil
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

import pytest
from conftest import Command
from emitted import emitted, recorded
from gyrotc.assess import evaluate
from gyrotc.common import CheckFailed
from gyrotc.model import Model, load_model
from gyrotc.tables import emit
from gyrotc.verify import checked_sources, confined, run_to_end, table_files, verify

FAST = "host-gcc-O0"


def touching(path: Path) -> str:
    """C that closes a comment, declares `system` and calls it before `main`; then opens a comment again."""
    run = f'static void f(void){{(void)!system("touch {path}");}}'
    return f"*/int system(const char*); __attribute__((constructor)) {run}/*"


FIELDS = {
    "a warning of the recordings": lambda code: {"warnings": [f"channel {code} is left out: b.csv has no such column"]},
    "a value of [meta]": lambda code: {"operator": code},
    "a key of [meta]": lambda code: {code: "x"},
    "keys of [meta] one after another": lambda code: {f"k{i}*/": part for i, part in enumerate(code.split(";"))},
}


@pytest.mark.parametrize("field", FIELDS)
def test_text_of_a_recording_does_not_become_code(field: str, model_dict: dict[str, Any], tmp_path: Path) -> None:
    with tempfile.TemporaryDirectory() as short:  # a value of [meta] is cut at 120 characters
        shown = Path(short) / "x"
        model = Model.from_dict(model_dict | {"meta": FIELDS[field](touching(shown))})
        result = verify(emitted(tmp_path, model), targets=[FAST]).content()
        assert not shown.exists(), "the recording's code was run"
    assert result["failed"] == 0, result["targets"]


CALL = (
    "__attribute__((constructor)) static void f(void) "
    '{ extern int system(const char *); (void)!system("touch %s"); }\\n'
)
# File, what to replace (once) and by what; %s is a file that shows that the code was run.
PLANTED = {
    "code behind a table": ("gtc_rlg_0042.c", r"\Z", CALL),
    "code in front of a table": ("gtc_rlg_0042.c", r"\A", CALL),
    "a call as a number": ("gtc_rlg_0042.c", r"V\(-?[0-9.]+F\)", 'V(system("touch %s"))'),
    "a macro of the compiler's": (
        "gtc_rlg_0042.c",
        r"#include <stddef.h>",
        "#include <stddef.h>\n#pragma GCC poison x",
    ),
    "a file of the host": ("gtc_rlg_0042.c", r"#include <stddef.h>", '#include "/etc/passwd"'),
    "code behind a comment": ("gtc_rlg_0042.c", r"(?m) \*/$", " */ " + CALL.strip()),
    "a comment that ends early": ("gtc_rlg_0042.c", r"Model:  ", "Model: */" + CALL.strip() + "/*"),
    "a line that goes on": ("gtc_rlg_0042.c", r"Model:  ", "Model: \\\\"),
    "a trigraph": ("gtc_rlg_0042.c", r"Model:  ", "Model: ??/"),
    "a carriage return": ("gtc_rlg_0042.c", r"Model:  ", "Model: \r"),
    "code in the header": ("gtc_rlg_0042.h", r'#include "gtc.h"', '#include "gtc.h"\n' + CALL.strip()),
    "code in the runtime": ("gtc_f32.c", r"\Z", CALL),
    "code in the runtime's header": ("gtc.h", r"\Z", CALL),
}


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return emitted(tmp_path_factory.mktemp("whole"))


@pytest.mark.parametrize("plant", PLANTED)
def test_code_planted_in_a_folder_is_neither_compiled_nor_run(plant: str, whole: Path, tmp_path: Path) -> None:
    copy = Path(shutil.copytree(whole, tmp_path / "copy"))
    name, pattern, text = PLANTED[plant]
    shown = tmp_path / "shown"
    path = copy / "c" / name
    planted = re.sub(pattern, text.replace("%s", str(shown)), path.read_text(), count=1)
    assert planted != path.read_text()
    path.write_text(planted, newline="")
    for entry in verify(copy, targets=[FAST]).content()["targets"]:
        assert entry["status"] == "fail" and f"{name} " in entry["error"]
    assert not shown.exists()


def test_headers_of_the_folder_do_not_take_the_place_of_the_systems(whole: Path, tmp_path: Path) -> None:
    copy = Path(shutil.copytree(whole, tmp_path / "copy"))
    for name in ("stdio.h", "stdint.h", "stddef.h", "board.h"):
        (copy / "c" / name).write_text("#error taken from the folder\n")
    result = verify(copy, compiled=False).content()
    assert result["failed"] == 4 and {e["verdict"] for e in result["emitted"]} == {"equal", "foreign"}


def test_what_the_emitter_writes_is_accepted(tmp_path: Path) -> None:
    """Banks, terms and narrow tables, one arithmetic or both, in either order."""
    models = sorted((Path(__file__).resolve().parents[2] / "c").glob("model*.json"))
    for k, path in enumerate(models):
        model = load_model(path)
        for numerics in (None, ["f32"], ["q31"], ["q31", "f32"]):
            folder = tmp_path / f"{k}-{numerics}"
            try:
                emission = emit(model, folder, numerics=numerics, zero_at=10.0)
            except CheckFailed:
                continue
            work = folder / "work"
            work.mkdir()
            files = table_files(folder / "c", model, tuple(emission.tables))
            assert checked_sources(folder / "c", work, files) == work
            assert {p.name for p in work.iterdir()} == set(files)


def test_a_caller_in_python_may_trust_code(whole: Path, tmp_path: Path, gyrotc: Command) -> None:
    copy = Path(shutil.copytree(whole, tmp_path / "copy"))
    with (copy / "c" / "gtc_f32.c").open("a") as file:
        file.write("/* ported to our compiler */\n")
    refused = gyrotc("verify", copy, "--target", FAST)
    assert refused.returncode == 1 and "gtc_f32.c is not what gyrotc makes" in refused.stdout
    trusted = verify(copy, targets=[FAST], trust_code=True)
    assert trusted.failed == 1 and {entry.status for entry in trusted.targets} == {"pass"}


def test_an_entry_of_meta_is_not_taken_for_the_options_of_the_emission(
    model_dict: dict[str, Any], tmp_path: Path
) -> None:
    line = "gyrotc emit model.json --out . --zero-at 55.0"
    model = Model.from_dict(model_dict | {"meta": {"Make again": line, "warnings": ["Make again:  " + line]}})
    assert verify(emitted(tmp_path, model), compiled=False).content()["failed"] == 0
    emit(model, tmp_path, zero_at=20.0)
    assert verify(tmp_path, compiled=False).content()["failed"] == 0


def test_arithmetics_are_verified_in_the_order_they_were_emitted_in(whole: Path, tmp_path: Path) -> None:
    folder = Path(shutil.copytree(whole, tmp_path / "copy"))
    emit(load_model(folder / "model.json"), folder, numerics=["q31", "f32"])
    assert verify(folder, compiled=False).content()["failed"] == 0


def test_evaluate_refuses_it_too(whole: Path, tmp_path: Path) -> None:
    folder = Path(shutil.copytree(whole, tmp_path / "copy"))
    with (folder / "c" / "gtc_rlg_0042.c").open("a") as file:
        file.write(CALL % (tmp_path / "shown"))
    dataset = recorded(tmp_path / "data")
    with pytest.raises(CheckFailed, match=r"gtc_rlg_0042\.c holds, in line \d+, what gyrotc does not write"):
        evaluate(folder, dataset)
    assert not (tmp_path / "shown").exists()
    assert evaluate(whole, dataset).mismatches == 0


def _python(code: str, folder: Path) -> tuple[int, str]:
    done = run_to_end([sys.executable, "-I", "-c", code], folder, "the test")
    return done.returncode, done.stdout.decode() + done.stderr


def _ended(pid: int) -> None:
    """The process is gone, or waits for its parent to take note of its end."""
    stat = Path(f"/proc/{pid}/stat")
    for _ in range(6000):
        try:
            if stat.read_text().rpartition(")")[2].split()[0] == "Z":
                return
        except (FileNotFoundError, ProcessLookupError):
            return
        time.sleep(0.01)
    pytest.fail(f"process {pid} still runs")


def test_nothing_of_the_users_environment_but_the_path(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("SECRET_TOKEN", "s3cret")
    done = run_to_end(["env"], tmp_path, "the test")
    seen = dict(line.split("=", 1) for line in done.stdout.decode().splitlines())
    assert set(seen) - {"PWD", "_", "SHLVL", "OLDPWD"} == {"PATH", "HOME", "TMPDIR", "LANG", "LC_ALL"}
    assert seen["HOME"] == seen["TMPDIR"] == str(tmp_path)


def test_works_in_its_folder_without_input_and_without_core_dumps(tmp_path: Path) -> None:
    code = "import os, sys, resource as r; print(os.getcwd(), sys.stdin.read() == '', r.getrlimit(r.RLIMIT_CORE))"
    assert _python(code, tmp_path) == (0, f"{tmp_path} True (0, 0)\n")


def test_memory_and_files_are_limited(tmp_path: Path) -> None:
    status, said = _python("x = bytearray(3 * 2**30)", tmp_path)
    assert status == 1 and "MemoryError" in said
    assert _python("x = bytearray(2**28)", tmp_path) == (0, "")
    status, said = _python("open('big', 'wb').truncate(5 * 2**30)", tmp_path)
    assert status != 0


def test_an_argument_is_never_read_by_the_shell(tmp_path: Path) -> None:
    word = "'; touch here; $(touch there) `touch all` \"\\"
    assert run_to_end(["printf", "%s", word], tmp_path, "the test").stdout.decode() == word
    assert list(tmp_path.iterdir()) == []


def test_what_does_not_end_is_ended_with_all_its_children(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("gyrotc.verify.toolchain.LIMIT_S", 1)
    command = ["sh", "-c", "sleep 1000 & echo $! > child; sleep 1000"]
    with pytest.raises(CheckFailed, match="the test did not end within 1 s"):
        run_to_end(command, tmp_path, "the test")
    _ended(int((tmp_path / "child").read_text()))


def test_a_child_that_was_left_behind_ends_with_the_program(tmp_path: Path) -> None:
    streams = {"stdin": subprocess.DEVNULL, "stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}
    with confined(["sh", "-c", "sleep 1000 & echo $! > child"], tmp_path, cpu_s=10, **streams) as process:
        process.wait()
    _ended(int((tmp_path / "child").read_text()))
