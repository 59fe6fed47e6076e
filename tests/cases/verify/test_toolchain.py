"""Targets and toolchains that are sound, programs that end badly, objects that are compiled once."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import pytest
from conftest import require
from emitted import emitted
from gyrotc.common import CheckFailed, InputError
from gyrotc.results import cache
from gyrotc.verify import (
    Object,
    Target,
    all_targets,
    board_entries,
    compile_c,
    compile_objects,
    compiler_version,
    load_target,
    run_program,
    shared_object,
    symbols,
    toolchain,
    writable_bytes,
)
from jobs import job_of
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


class _Compiled:
    """Counts what the compiler is asked for."""

    count = 0


@pytest.fixture
def compiled(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[_Compiled]:
    """A cache of the test's own, as a new process finds it."""
    counted = _Compiled()

    def counting(*arguments: object, **options: object) -> list[Path]:
        counted.count += 1
        return compile_objects(*arguments, **options)  # type: ignore[arg-type]

    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    monkeypatch.setattr(toolchain, "compile_objects", counting)
    yield counted


def _asked(source: Path, work: Path, target: Target = HOST, *, fresh: bool = False) -> Object:
    return shared_object(target, source, work, include=source.parent, fresh=fresh)


@pytest.fixture
def source(tmp_path: Path) -> Path:
    folder = tmp_path / "c"
    folder.mkdir()
    (folder / "size.h").write_text("#define SIZE 3\n")
    path = folder / "one.c"
    path.write_text(
        '#include "size.h"\nint one(void);\nint one(void)\n{\n    static int x[SIZE];\n    return x[0]++;\n}\n'
    )
    return path


def test_an_object_is_taken_again_for_the_same_text_headers_flags_and_compiler_alone(
    source: Path, tmp_path: Path, compiled: _Compiled
) -> None:
    first = _asked(source, tmp_path)
    assert first.writable_bytes == 12 and [s.name for s in first.symbols if s.kind == "T"] == ["one"]
    assert _asked(source, tmp_path) == first and compiled.count == 1, "the second comes from disk"
    other = tmp_path / "elsewhere"
    other.mkdir()
    for name in ("one.c", "size.h"):
        (other / name).write_bytes((source.parent / name).read_bytes())
    assert _asked(other / "one.c", other).code == first.code and compiled.count == 1, "places do not matter"
    (source.parent / "size.h").write_text("#define SIZE 4\n")
    assert _asked(source, tmp_path).writable_bytes == 16 and compiled.count == 2
    _asked(source, tmp_path, HOST.model_copy(update={"flags": ("-O1",)}))
    assert compiled.count == 3
    _asked(source, tmp_path, fresh=True)
    assert compiled.count == 4


def test_an_object_is_compiled_again_after_a_header_of_the_system_changed(
    source: Path, tmp_path: Path, compiled: _Compiled
) -> None:
    system = tmp_path / "some system"
    system.mkdir()
    (source.parent / "size.h").rename(system / "size.h")
    target = HOST.model_copy(update={"flags": (*HOST.flags, "-isystem", str(system))})
    assert _asked(source, tmp_path, target) == _asked(source, tmp_path, target)
    assert compiled.count == 1
    (system / "size.h").write_text("#define SIZE 7\n")
    assert _asked(source, tmp_path, target).writable_bytes == 28
    assert compiled.count == 2


def test_another_compiler_of_the_same_name_makes_its_own_objects(
    source: Path, tmp_path: Path, compiled: _Compiled, monkeypatch: pytest.MonkeyPatch
) -> None:
    _asked(source, tmp_path)
    known = toolchain.compiler_identity(HOST.compiler)
    assert len(known) == 4, "version, driver, compiler proper, assembler"
    for changed in range(len(known)):
        monkeypatch.setattr(
            toolchain, "compiler_identity", lambda _, k=changed: [*known[:k], known[k] + "1", *known[k + 1 :]]
        )
        _asked(source, tmp_path)
        assert compiled.count == 2 + changed
    monkeypatch.setattr(toolchain, "compiler_identity", lambda _: [])
    _asked(source, tmp_path)
    assert compiled.count == 6, "a compiler that cannot be distinguished from others compiles each time"


def _kept(path: Path, content: bytes) -> bytes:
    """Return the file that keeps a content under the name of `path`."""
    cache.keep(path.name, content)
    return path.read_bytes()


def test_what_is_damaged_or_foreign_is_never_linked(source: Path, tmp_path: Path, compiled: _Compiled) -> None:
    sound = _asked(source, tmp_path)
    [path] = cache.folder().glob("*.object")
    whole = path.read_bytes()
    _asked(source, tmp_path, HOST.model_copy(update={"flags": ("-O1",)}))
    [other] = set(cache.folder().glob("*.object")) - {path}
    head = len(cache.head_of_content("", b""))
    spoiled = (
        b"",
        whole[:-1],
        whole[:-9] + bytes([whole[-9] ^ 1]) + whole[-8:],
        other.read_bytes(),  # with other flags, sound in itself
        whole[:head] + whole[head:].replace(b"one", b"two", 1),
        _kept(path, b"{}\n" + sound.code),
        _kept(path, whole[head:].replace(b'"graph":""', b'"graph":1', 1)),
    )
    for k, content in enumerate(spoiled, 3):
        path.write_bytes(content)
        assert _asked(source, tmp_path) == sound
        assert compiled.count == k, "compiled again"
    cache.folder().chmod(0o777)
    assert _asked(source, tmp_path) == sound and compiled.count == 3 + len(spoiled), "others may write there"


@pytest.mark.parametrize("name", ["host-gcc-O2"])
def test_a_target_shows_the_same_with_kept_objects(name: str, tmp_path: Path, compiled: _Compiled) -> None:
    target = all_targets()[name]
    require(target.missing())
    job = replace(job_of(emitted(tmp_path / "a")), trusted=False)
    first = [entry.content() for entry in board_entries(job, target)]
    assert all(entry["status"] == "pass" for entry in first)
    before = compiled.count
    assert [entry.content() for entry in board_entries(job, target)] == first
    assert compiled.count == before, "runtime and table are compiled once"
