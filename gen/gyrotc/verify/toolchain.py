"""Compile and run C for a target: compiler, flags, how to run. One short TOML file describes each target.

Bare-metal targets are linked with parts of `bare/`: start-up code, and the few functions of the C
library that the test programs use. Their standard input is the file `stdin.bin` of the working folder.
"""

from __future__ import annotations

import functools
import re
import shutil
import subprocess
import tempfile
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Literal

from pydantic import BaseModel, ConfigDict, Field, ValidationError

from ..common.errors import CheckFailed, InputError
from ..common.inputs_texts import read_toml
from ..store.opening import write_own
from ..store.scratch import scratch_folder
from .confined import ProgramRun, run_to_end

__all__ = [
    "C_FLAGS",
    "ProgramRun",
    "Symbol",
    "Target",
    "all_targets",
    "compile_c",
    "compile_objects",
    "compiler_version",
    "disassembly",
    "link",
    "load_target",
    "run_program",
    "symbols",
    "writable_bytes",
]

C_FLAGS = (
    "-std=c99", "-pedantic", "-ffp-contract=off", "-Wall", "-Wextra", "-Wconversion", "-Wsign-conversion",
    "-Werror", "-ffunction-sections", "-fdata-sections",
)  # fmt: skip
_HERE = Path(__file__).resolve().parent
_BARE = _HERE / "bare"
_STDIN = "stdin.bin"
_VERSION_OF_GCC = "<version of gcc>"  # in `package`: stands for the number of the installed release
_SHOWN_LINES = 12  # of what a compiler says: the first error stands there
_SYMBOL = re.compile(r"(?P<address>[0-9A-Fa-f]+) (?P<size>[0-9A-Fa-f]+) (?P<kind>\S) (?P<name>\S+)")


class Target(BaseModel):
    """One target: `compiler` with `flags`, run by `run` (empty: natively)."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    name: Annotated[str, Field(pattern=r"^[a-z0-9][A-Za-z0-9_.-]*$")]
    compiler: str
    package: str  # Debian packages that bring compiler and emulator
    flags: tuple[str, ...] = ()
    link: tuple[str, ...] = ()  # for the linker alone
    bare: tuple[str, ...] = ()  # files of bare/ that are linked in
    script: str | None = None  # linker script in bare/
    run: tuple[str, ...] = ()
    numerics: tuple[str, ...] = ("f32", "q31")
    byte_order: Literal["little", "big"] = "little"
    counts: Literal["instructions", "cycles"] | None = None  # what the board's counter counts ...
    ticks_per_count: Annotated[float, Field(gt=0.0)] = 1.0  # ... and how often it ticks for each
    reads_input: bool = True  # recordings can be replayed on it
    default: bool = False  # tried when no target is named

    def missing(self) -> str | None:
        """The packages that bring what this target lacks here; None if it can be built and run."""
        tools = [self.compiler, *self.run[:1]]
        if all(shutil.which(tool) for tool in tools) and _links(self):
            return None
        if _VERSION_OF_GCC in self.package and shutil.which("gcc"):
            return self.package.replace(_VERSION_OF_GCC, compiler_version("gcc").split()[-1].split(".")[0])
        return self.package

    @property
    def all_flags(self) -> tuple[str, ...]:
        """Flags of the compiler, as results report them."""
        return (*C_FLAGS, *self.flags)


@dataclass(frozen=True, slots=True)
class Symbol:
    """A symbol of an object or program: its `kind` is nm's letter, its size is in bytes."""

    name: str
    kind: str
    size: int
    address: int


def load_target(path: Path) -> Target:
    """The target that a TOML file describes.

    Raises:
        InputError: The file cannot be read, or a field is wrong.
    """
    try:
        return Target.model_validate(read_toml(path, "a target file"))
    except ValidationError as error:
        raise InputError(str(path), str(error), "a target file") from error


def all_targets() -> dict[str, Target]:
    """Every target by name, in the order of the file names."""
    found = [load_target(path) for path in sorted((_HERE / "targets").glob("*.toml"))]
    return {target.name: target for target in found}


def compile_objects(
    target: Target, sources: Sequence[Path], folder: Path, *, include: Path, defines: Sequence[str] = ()
) -> list[Path]:
    """Compiles each source into `folder`; returns the objects.

    Raises:
        CheckFailed: The compiler refused; the message holds its first lines.
    """
    bare = [f"-I{_BARE}"] if target.bare else []
    flags = [*target.all_flags, *(f"-D{d}" for d in defines), *bare, f"-I{include.absolute()}"]
    objects = []
    for source in sources:
        objects.append(folder.absolute() / f"{source.stem}.o")
        command = [target.compiler, *flags, "-c", str(source.absolute()), "-o", str(objects[-1])]
        _command(target, command, folder)
    return objects


def link(target: Target, objects: Sequence[Path], program: Path) -> None:
    """Links objects, and the bare parts of the target, into a program.

    Raises:
        CheckFailed: The linker refused.
    """
    parts = compile_objects(target, [_BARE / f for f in target.bare], program.parent, include=_BARE)
    script = ["-T", str(_BARE / target.script)] if target.script else []
    files = [str(f.absolute()) for f in (*objects, *parts)]
    arguments = [*target.all_flags, *script, *files, *target.link, "-Wl,--gc-sections"]
    _command(target, [target.compiler, *arguments, "-o", str(program.absolute())], program.parent)


def compile_c(
    target: Target, sources: Sequence[Path], program: Path, *, include: Path, defines: Sequence[str] = ()
) -> None:
    """Compiles and links a program, objects beside it.

    Raises:
        CheckFailed: The compiler or the linker refused.
    """
    objects = compile_objects(target, sources, program.parent, include=include, defines=defines)
    link(target, objects, program)


def run_program(target: Target, program: Path, data: bytes = b"") -> ProgramRun:
    """Runs a program with `data` on its standard input; bounded in time.

    Raises:
        CheckFailed: It did not end.
    """
    with tempfile.TemporaryFile() as stdin:
        if target.bare:
            write_own(program.parent / _STDIN, data)
        else:
            stdin.write(data)
            stdin.seek(0)
        del data
        command = [*target.run, str(program.absolute())]
        return run_to_end(command, program.parent, f"{target.name}: the program", stdin)


def symbols(target: Target, *files: Path) -> list[Symbol]:
    """Symbols with a size, of objects or programs."""
    rows = [_SYMBOL.fullmatch(line) for line in _inspected(target, "nm", ("-S",), files)]
    return [
        Symbol(row["name"], row["kind"], int(row["size"], 16), int(row["address"], 16)) for row in rows if row
    ]


def disassembly(target: Target, program: Path) -> list[str]:
    """Lines of the code of a program, with those of its text in between."""
    return _inspected(target, "objdump", ("-d", "-l", "--no-show-raw-insn"), [program])


def writable_bytes(target: Target, *files: Path) -> int:
    """Bytes of writable static data in objects (what is constant once it is relocated does not count)."""
    rows = [line.split() for line in _inspected(target, "size", ("-A",), files)]
    sizes = [(row[0], int(row[1])) for row in rows if len(row) == 3 and row[1].isdigit()]
    writable = (".data", ".bss", ".sdata", ".sbss", "COMMON")
    return sum(n for name, n in sizes if name.startswith(writable) and ".rel.ro" not in name)


def _inspected(target: Target, tool: str, options: Sequence[str], files: Sequence[Path]) -> list[str]:
    """Lines that a tool of the toolchain (nm, size, objdump) prints."""
    name = _tool(target.compiler, tool)
    done = run_to_end([name, *options, *(str(f.absolute()) for f in files)], files[0].parent, name)
    if done.returncode != 0:
        raise CheckFailed(f"{target.name}: {name} failed: {done.stderr[:200]}")
    return done.stdout.decode("utf-8", "replace").splitlines()


@functools.cache
def _tool(compiler: str, tool: str) -> str:
    """Path of the tool that belongs to a compiler."""
    asked = [compiler, f"-print-prog-name={tool}"]
    return subprocess.run(asked, capture_output=True, text=True, check=False).stdout.strip() or tool


@functools.cache
def compiler_version(compiler: str) -> str:
    """Name and version in one short text, e.g. ``gcc 12.2.0``."""
    for option in ("-dumpfullversion", "-dumpversion"):
        done = subprocess.run([compiler, option], capture_output=True, text=True, check=False)
        version = done.stdout.strip()
        if done.returncode == 0 and len(version.splitlines()) == 1:
            return f"{compiler} {version}"
    return compiler


def _command(target: Target, command: list[str], folder: Path) -> None:
    done = run_to_end(command, folder, f"{target.name}: {target.compiler}")
    if done.returncode != 0:
        lines = "\n".join(done.stderr.splitlines()[:_SHOWN_LINES])
        raise CheckFailed(f"{target.name}: {target.compiler} failed:\n{lines}")


@functools.cache
def _links(target: Target) -> bool:
    """Whether an empty program can be built: a compiler may lack the C library of the target."""
    with scratch_folder() as work:
        source = work / "empty.c"
        write_own(source, "int main(void)\n{\n    return 0;\n}\n")
        try:
            compile_c(target, [source], work / "empty", include=work)
        except CheckFailed:
            return False
    return True
