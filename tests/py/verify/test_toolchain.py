"""Targets and toolchains: files that are sound, a meter that counts right, programs that end badly."""

from __future__ import annotations

from pathlib import Path

import pytest
from gyrotc.common.errors import CheckFailed, InputError
from gyrotc.verify.toolchain import (
    Target,
    all_targets,
    compile_c,
    compile_objects,
    compiler_version,
    load_target,
    run_program,
    symbols,
    writable_bytes,
)
from metered import metered

FOLDER = Path(__import__("gyrotc").__file__).parent / "verify" / "targets"
HOST = all_targets()["host-gcc-O2"]


@pytest.mark.parametrize("path", sorted(FOLDER.glob("*.toml")), ids=lambda p: p.stem)
def test_target_file_is_short_named_as_the_target_and_explained(path: Path) -> None:
    target = load_target(path)
    assert target.name == path.stem
    assert path.read_text().startswith("# ")
    assert len(path.read_text().splitlines()) <= 20
    assert target.package and "q31" in target.numerics


def test_there_are_enough_kinds_of_target() -> None:
    compilers = {(t.compiler, tuple(f for f in t.flags if f[:2] == "-m")) for t in all_targets().values()}
    assert len(compilers) >= 12
    assert sum(t.byte_order == "big" for t in all_targets().values()) >= 2


def test_target_file_with_an_unknown_key_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "x.toml"
    path.write_text('name = "x"\ncompiler = "cc"\npackage = "gcc"\nflag = ["-O2"]\n')
    with pytest.raises(InputError, match="flag"):
        load_target(path)
    path.write_text("name = ")
    with pytest.raises(InputError, match=r"x\.toml"):
        load_target(path)
    with pytest.raises(InputError, match=r"y\.toml"):
        load_target(tmp_path / "y.toml")


def test_missing_names_the_package_for_absent_tools_and_absent_libraries() -> None:
    assert HOST.missing() is None
    assert HOST.model_copy(update={"compiler": "no-such-compiler"}).missing() == "gcc"
    assert HOST.model_copy(update={"run": ("no-such-emulator",)}).missing() == "gcc"
    assert HOST.model_copy(update={"link": ("-lno_such_library",)}).missing() == "gcc"


@pytest.mark.parametrize("name", ["cortex-m0", "cortex-m4f"])
def test_meter_counts_instructions_and_stack(name: str, tmp_path: Path) -> None:
    """1000 turns of two instructions and one before them; 40 bytes of stack."""
    counts, stack = metered(name, tmp_path)
    assert counts == pytest.approx(2001, abs=0.3)
    assert stack == 40


def _program(folder: Path, body: str) -> Path:
    source = folder / "p.c"
    source.write_text(f"int main(void);\nint main(void)\n{{\n{body}\n}}\n")
    return source


def test_fault_of_a_bare_target_ends_the_run(tmp_path: Path) -> None:
    target = all_targets()["cortex-m4f"]
    source = _program(tmp_path, "    *(volatile int *)0xFFFFFFF0UL = 1;\n    return 0;")
    compile_c(target, [source], tmp_path / "p", include=tmp_path)
    assert run_program(target, tmp_path / "p").returncode == 99


def test_program_that_never_ends_is_stopped(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("gyrotc.verify.toolchain.LIMIT_S", 1)
    compile_c(HOST, [_program(tmp_path, "    for (;;) {\n    }")], tmp_path / "p", include=tmp_path)
    with pytest.raises(CheckFailed, match="did not end"):
        run_program(HOST, tmp_path / "p")


def test_warnings_are_errors(tmp_path: Path) -> None:
    source = _program(tmp_path, "    int a = 3.5;\n    return a;")
    with pytest.raises(CheckFailed, match=r"p\.c:4"):
        compile_c(HOST, [source], tmp_path / "p", include=tmp_path)


def test_symbols_and_writable_data(tmp_path: Path) -> None:
    source = tmp_path / "data.c"
    source.write_text(
        "extern const int table[10];\nconst int table[10] = { 1 };\n"
        "extern const int *const pointer;\nconst int *const pointer = table;\n"
        "int twelve(void);\nint twelve(void)\n{\n    static int counter[3];\n    counter[0]++;\n"
        "    return counter[0];\n}\n"
    )
    (item,) = compile_objects(HOST, [source], tmp_path, include=tmp_path)
    found = {s.name: s for s in symbols(HOST, item)}
    assert found["table"].size == 40 and found["twelve"].kind == "T"
    assert writable_bytes(HOST, item) == 12


def test_compiler_version_is_one_short_text() -> None:
    assert compiler_version("gcc").split()[0] == "gcc"
    assert compiler_version("gcc").split()[1][0].isdigit()


def test_flags_of_results_are_those_of_the_compiler() -> None:
    target = Target(name="x", compiler="cc", package="p", flags=("-Og",))
    assert target.all_flags[0] == "-std=c99" and target.all_flags[-1] == "-Og"
