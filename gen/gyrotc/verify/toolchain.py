"""Compile and run C for a target, with limits and nothing of the user's; a TOML file describes each target.

What is compiled and run may be somebody else's. Every command runs in the folder of its work, with an environment of
its own, limits of time, memory and file size, no core dumps, and all of its processes end with it.

What was compiled before is not compiled again, above all the runtime, which is the same for every serial:
`shared_object` keeps objects and what was measured on them between calls.

Bare-metal targets are linked with parts of `bare/`: start-up code, and the few functions of the C
library that the test programs use. Their standard input is the file `stdin.bin` of the working folder.
"""

from __future__ import annotations

import functools
import json
import os
import platform
import re
import shutil
import signal
import subprocess
import tempfile
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import IO, Annotated, Literal

from pydantic import BaseModel, ConfigDict, Field, ValidationError

from ..common.errors import CheckFailed
from ..common.inputs import read_toml, refused
from ..results import cache
from ..results.base import NUMERICS
from ..results.files import sha256, write_own
from ..results.folder import scratch_folder
from ..results.json_text import canonical_json, digest_of

LIMIT_S = 600  # s, elapsed: docs/design.md, "Trust"
# Of each process. Data: four times what a compiler at -O3 or an emulator with its translations takes (below 0.5 GiB).
# Addresses: qemu-user reserves the 4 GiB of a 32-bit processor, which are addresses without memory behind them.
# A file: the answers to a recording of 350 million rows. Shells count in KiB, and files in blocks of 512 bytes.
_LIMITS = {"c": 0, "d": 2 * 2**20, "v": 16 * 2**20, "f": 8 * 2**20}
_SAID_BYTES = 64 * 2**20  # kept of what a program says on stderr

ByteStream = IO[bytes] | int

_groups: set[int] = set()  # of processes that run now
_linked: set[Target] = set()  # for which this process linked a program


@dataclass(frozen=True, slots=True)
class ProgramRun:
    """Exit status and output of a program."""

    returncode: int
    stdout: bytes
    stderr: str


@contextmanager
def confined(
    command: Sequence[str], folder: Path, *, stdin: ByteStream, stdout: ByteStream, stderr: ByteStream, cpu_s: int
) -> Iterator[subprocess.Popen[bytes]]:
    """A process in `folder`, whose whole group ends with the block.

    A shell sets the limits, those that the system has: what Python does between fork and exec is not safe with threads.
    """
    limits = "; ".join(f"ulimit -{option} {n} 2>/dev/null" for option, n in {**_LIMITS, "t": cpu_s}.items())
    process = subprocess.Popen(
        ["/bin/sh", "-c", f'{limits}; exec "$@"', "sh", *command],
        cwd=folder,
        env=_environment(folder.absolute()),
        stdin=stdin,
        stdout=stdout,
        stderr=stderr,
        start_new_session=True,
    )
    _groups.add(process.pid)
    try:
        yield process
    finally:
        _groups.discard(process.pid)
        _end(process.pid)
        process.wait()
        for pipe in (process.stdin, process.stdout, process.stderr):
            if pipe is not None:
                with suppress(BrokenPipeError):  # what was still to be written to it
                    pipe.close()


def end_all() -> None:
    """End the programs that other threads run: the job is interrupted, and nobody waits for them any more."""
    for group in tuple(_groups):
        _end(group)


def _end(group: int) -> None:
    with suppress(ProcessLookupError, PermissionError):
        os.killpg(group, signal.SIGKILL)


def run_to_end(
    command: Sequence[str],
    folder: Path,
    what: str,
    stdin: ByteStream = subprocess.DEVNULL,
    printed: IO[bytes] | None = None,
) -> ProgramRun:
    """Run a command in `folder` to its end.

    Args:
        printed: Takes what it prints, which the result then is without.

    Raises:
        CheckFailed: It did not end; `what` says in words who it is.
    """
    # Files, not pipes: a recording goes in and comes out, and is never in memory as a whole.
    with tempfile.TemporaryFile() as own, tempfile.TemporaryFile() as stderr:
        stdout = printed or own
        # The clock ends it; the limit of processor time is for what escapes the clock, and must not come first.
        with confined(command, folder, stdin=stdin, stdout=stdout, stderr=stderr, cpu_s=2 * LIMIT_S) as process:
            try:
                process.wait(LIMIT_S)
            except subprocess.TimeoutExpired as error:
                raise CheckFailed(f"{what} did not end within {LIMIT_S} s") from error
        for stream in (stdout, stderr):
            stream.seek(0)
        return ProgramRun(process.returncode, own.read(), stderr.read(_SAID_BYTES).decode("utf-8", "replace"))


def _environment(folder: Path) -> dict[str, str]:
    """Return the part of the user's environment that a compiler or a program sees: where programs are."""
    path = os.environ.get("PATH", os.defpath)
    return {"PATH": path, "HOME": str(folder), "TMPDIR": str(folder), "LANG": "C", "LC_ALL": "C"}


C_FLAGS = (
    "-std=c99", "-pedantic", "-ffp-contract=off", "-Wall", "-Wextra", "-Wconversion", "-Wsign-conversion",
    "-Werror", "-ffunction-sections", "-fdata-sections",
)  # fmt: skip
_HERE = Path(__file__).resolve().parent
_BARE = _HERE / "bare"
_STDIN = "stdin.bin"
_VERSION_OF_GCC = "<version of gcc>"  # in `package`: stands for the number of the installed release
_SHOWN_LINES = 12  # of what a compiler says: the first error stands there
_SYMBOL = re.compile(r"[0-9A-Fa-f]+ (?P<size>[0-9A-Fa-f]+) (?P<kind>\S) (?P<name>\S+)")


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
    numerics: tuple[str, ...] = NUMERICS
    byte_order: Literal["little", "big"] = "little"
    counts: Literal["instructions", "cycles"] | None = None  # what the board's counter counts ...
    ticks_per_count: Annotated[float, Field(gt=0.0)] = 1.0  # ... and how often it ticks for each
    reads_input: bool = True  # recordings can be replayed on it
    default: bool = False  # tried when no target is named

    def missing(self) -> str | None:
        """The packages that bring what this target lacks here; None if it can be built and run."""
        if self.has_tools() and _links(self):
            return None
        if _VERSION_OF_GCC in self.package and shutil.which("gcc"):
            return self.package.replace(_VERSION_OF_GCC, compiler_version("gcc").split()[-1].split(".")[0])
        return self.package

    def has_tools(self) -> bool:
        """Test whether compiler and emulator are installed; the compiler may lack the C library of the target."""
        return all(shutil.which(tool) for tool in (self.compiler, *self.run[:1]))

    @property
    def all_flags(self) -> tuple[str, ...]:
        """Flags of the compiler, as results report them."""
        return (*C_FLAGS, *self.flags)

    def compiling(self) -> Target:
        """Return the part of a target that the compiler sees; targets alike in it have the same objects."""
        return Target(name=self.name, compiler=self.compiler, package="", flags=self.flags, bare=self.bare)


@dataclass(frozen=True, slots=True)
class Symbol:
    """A symbol of an object or program: its `kind` is nm's letter, its size is in bytes."""

    name: str
    kind: str
    size: int


def load_target(path: Path) -> Target:
    """The target that a TOML file describes.

    Raises:
        InputError: The file cannot be read, or a field is wrong.
    """
    try:
        return Target.model_validate(read_toml(path, "a target file"))
    except ValidationError as error:
        raise refused(error, lambda field: f"{path}, field {field}", Target) from error


def all_targets() -> dict[str, Target]:
    """Every target by name, in the order of the file names."""
    found = [load_target(path) for path in sorted((_HERE / "targets").glob("*.toml"))]
    return {target.name: target for target in found}


def compile_objects(
    target: Target, sources: Sequence[Path], folder: Path, *, include: Path, defines: Sequence[str] = ()
) -> list[Path]:
    """Compile each source into `folder` and return the objects.

    Raises:
        CheckFailed: The compiler refused; the message holds its first lines.
    """
    flags = [*_flags(target, include), *(f"-D{d}" for d in defines)]
    objects = []
    for source in sources:
        objects.append(folder.absolute() / f"{source.stem}.o")
        command = [target.compiler, *flags, "-c", str(source.absolute()), "-o", str(objects[-1])]
        run_compiler(target, command, folder)
    return objects


def _flags(target: Target, include: Path) -> list[str]:
    bare = [f"-I{_BARE}"] if target.bare else []
    return [*target.all_flags, *bare, f"-I{include.absolute()}"]


@dataclass(frozen=True, slots=True)
class Object:
    """A compiled source, and what was measured on it.

    Attributes:
        headers: SHA-256 of each header by its path, which is relative where it lies in the folder of headers.
        code: The file.
        graph: Who calls whom, and the stack of each function, as gcc writes it; empty where it was not asked for.
    """

    headers: tuple[tuple[str, str], ...]
    code: bytes
    symbols: tuple[Symbol, ...]
    writable_bytes: int
    graph: str

    def put(self, path: Path) -> Path:
        """Write the file and return its path."""
        write_own(path, self.code)
        return path


_FILE_OF_RULE = re.compile(r"(?:\\.|[^\s\\])+")  # spaces in names are escaped
_ESCAPED = re.compile(r"\\(.)")
_GRAPH = ("-fstack-usage", "-fcallgraph-info=su")


def runtime_object(target: Target, c_folder: Path, numeric: str, work: Path, *, fresh: bool = False) -> Object:
    """Return the runtime of one arithmetic, with its graph of calls if the compiler writes one; as `shared_object`."""
    counted = target.compiler.endswith("-gcc") and target.counts == "instructions"
    flags = (*target.flags, *_GRAPH) if counted else target.flags
    return shared_object(
        target.model_copy(update={"flags": flags}), c_folder / f"gtc_{numeric}.c", work, include=c_folder, fresh=fresh
    )


def shared_object(target: Target, source: Path, work: Path, *, include: Path, fresh: bool = False) -> Object:
    """Compile a source, or take the object of an earlier call with the same text, headers, flags, compiler and gyrotc.

    The compiler lists the headers that it read, those of the system among them.

    Args:
        work: A folder for the compiler.
        fresh: Compiles in any case: an assembler may read files that no text tells.

    Raises:
        CheckFailed: The compiler refused.
    """
    name = "" if fresh else _name_of(target, source)
    found = cache.kept(name, functools.partial(_object, include)) if name else None
    if found is None:
        listing = target.model_copy(update={"flags": (*target.flags, "-MD")})
        (path,) = compile_objects(listing, [source], work, include=include)
        graph = path.with_suffix(".ci")
        found = Object(
            tuple(_headers(path.with_suffix(".d"), source, include)),
            path.read_bytes(),
            tuple(symbols(target, path)),
            writable_bytes(target, path),
            graph.read_text(encoding="utf-8", errors="replace") if graph.exists() else "",
        )
        if name:
            cache.keep(name, _content(found))
    return found


def _content(found: Object) -> bytes:
    """A line of JSON, then the file."""
    rows = [[s.name, s.kind, s.size] for s in found.symbols]
    measured = {
        "headers": [list(header) for header in found.headers],
        "symbols": rows,
        "writable_bytes": found.writable_bytes,
        "graph": found.graph,
    }
    return canonical_json(measured) + b"\n" + found.code


def _object(include: Path, content: bytes) -> Object | None:
    """Return the object that was kept, or None if one of its headers changed since."""
    line, _, code = content.partition(b"\n")
    measured = json.loads(line)
    headers = tuple((str(path), str(digest)) for path, digest in measured["headers"])
    if any(sha256(include / path) != digest for path, digest in headers):
        return None
    rows = tuple(Symbol(*row) for row in measured["symbols"])
    sound = code and type(measured["writable_bytes"]) is int and type(measured["graph"]) is str
    return Object(headers, code, rows, measured["writable_bytes"], measured["graph"]) if sound else None


def _headers(listed: Path, source: Path, include: Path) -> Iterator[tuple[str, str]]:
    """Yield path and SHA-256 of the headers that a compiler listed, as a rule of make, while it compiled a source."""
    _, _, files = listed.read_text(encoding="utf-8").replace("\\\n", " ").partition(": ")
    for word in _FILE_OF_RULE.findall(files):
        path = Path(_ESCAPED.sub(r"\1", word).replace("$$", "$"))
        if path != source.absolute():
            inside = path.is_relative_to(include.absolute())
            yield str(path.relative_to(include.absolute()) if inside else path), sha256(path)


def _name_of(target: Target, source: Path) -> str:
    """Return the name under which an object is kept: a hash of all that it is made of except headers.

    It is empty if compiler or processor cannot be determined.
    """
    compiler = compiler_identity(target.compiler)
    processor = _processor() if "-march=native" in target.flags else "any"
    if not compiler or not processor:
        return ""
    flags = [*target.all_flags, len(target.bare)]
    made_of = [cache.program_of(), compiler, processor, flags, source.name, sha256(source)]
    return f"{digest_of(made_of)}.object"


@functools.cache
def compiler_identity(compiler: str) -> list[str]:
    """Return what tells one installed compiler from another: its version, and the programs that it consists of."""
    parts = () if "clang" in compiler else ("cc1", "as")
    programs = [compiler, *(_tool(compiler, part) for part in parts)]
    found = [compiler_version(compiler)]
    for program in programs:
        path = shutil.which(program)
        if path is None:
            return []
        facts = Path(path).resolve().stat()
        found.append(f"{Path(path).resolve()} {facts.st_size} {facts.st_mtime_ns}")
    return found


@functools.cache
def _processor() -> str:
    """Return what tells the code of `-march=native` here from that of another machine; empty if not known."""
    with suppress(OSError):
        text = Path("/proc/cpuinfo").read_text(encoding="utf-8", errors="replace").split("\n\n")[0]
        lines = re.findall(r"^(?:model name|vendor_id|cpu family|model|flags|Features|CPU \w+)\s*:.*$", text, re.M)
        return digest_of([platform.machine(), *lines]) if lines else ""
    return ""


@functools.cache
def _bare_objects(target: Target) -> tuple[tuple[str, Object], ...]:
    """The parts of `bare/` that a target is linked with, by the names of their files."""
    with scratch_folder() as work:
        return tuple(
            (f"{Path(name).stem}.o", shared_object(target, _BARE / name, work, include=_BARE)) for name in target.bare
        )


def link(target: Target, objects: Sequence[Path], program: Path) -> None:
    """Link objects, and the bare parts of the target, into a program.

    Raises:
        CheckFailed: The linker refused.
    """
    parts = [part.put(program.parent / name) for name, part in _bare_objects(target.compiling())]
    script = ["-T", str(_BARE / target.script)] if target.script else []
    files = [str(f.absolute()) for f in (*objects, *parts)]
    arguments = [*target.all_flags, *script, *files, *target.link, "-Wl,--gc-sections"]
    run_compiler(target, [target.compiler, *arguments, "-o", str(program.absolute())], program.parent)
    _linked.add(_linking(target))


def compile_c(
    target: Target, sources: Sequence[Path], program: Path, *, include: Path, defines: Sequence[str] = ()
) -> None:
    """Compile and link a program, with its objects beside it.

    Raises:
        CheckFailed: The compiler or the linker refused.
    """
    objects = compile_objects(target, sources, program.parent, include=include, defines=defines)
    link(target, objects, program)


def run_program(
    target: Target, program: Path, data: Iterable[bytes] = (), printed: IO[bytes] | None = None
) -> ProgramRun:
    """Run a program with `data` on its standard input, for a bounded time. `printed` is that of `run_to_end`.

    Raises:
        CheckFailed: It did not end.
    """
    with tempfile.TemporaryFile() as stdin:
        if target.bare:
            write_own(program.parent / _STDIN, b"".join(data))
        else:
            stdin.writelines(data)
            stdin.seek(0)
        command = [*target.run, str(program.absolute())]
        return run_to_end(command, program.parent, f"{target.name}: the program", stdin, printed)


def symbols(target: Target, *files: Path) -> list[Symbol]:
    """Symbols with a size, of objects or programs."""
    rows = [_SYMBOL.fullmatch(line) for line in _inspected(target, "nm", ("-S",), files)]
    return [Symbol(row["name"], row["kind"], int(row["size"], 16)) for row in rows if row]


def writable_bytes(target: Target, *files: Path) -> int:
    """Bytes of writable static data in objects (what is constant once it is relocated does not count)."""
    rows = [line.split() for line in _inspected(target, "size", ("-A",), files)]
    sizes = [(row[0], int(row[1])) for row in rows if len(row) == 3 and row[1].isdigit()]
    writable = (".data", ".bss", ".sdata", ".sbss", "COMMON")
    return sum(n for name, n in sizes if name.startswith(writable) and ".rel.ro" not in name)


def _inspected(target: Target, tool: str, options: Sequence[str], files: Sequence[Path]) -> list[str]:
    """Lines that a tool of the toolchain (nm, size) prints."""
    name = _tool(target.compiler, tool)
    done = run_to_end([name, *options, *(str(f.absolute()) for f in files)], files[0].parent, name)
    if done.returncode != 0:
        raise CheckFailed(f"{target.name}: {name} failed: {done.stderr[:200]}")
    return done.stdout.decode("utf-8", "replace").splitlines()


@functools.cache
def _tool(compiler: str, tool: str) -> str:
    """Path of the tool that belongs to a compiler."""
    return _said_of_itself(compiler, f"-print-prog-name={tool}") or tool


@functools.cache
def compiler_version(compiler: str) -> str:
    """Name and version in one short text, e.g. ``gcc 12.2.0``."""
    for option in ("-dumpfullversion", "-dumpversion"):
        version = _said_of_itself(compiler, option)
        if len(version.splitlines()) == 1:
            return f"{compiler} {version}"
    return compiler


def _said_of_itself(compiler: str, option: str) -> str:
    """Return what a compiler prints about itself; empty if it fails."""
    done = run_to_end([compiler, option], Path(tempfile.gettempdir()), f"{compiler} {option}")
    return done.stdout.decode("utf-8", "replace").strip() if done.returncode == 0 else ""


def run_compiler(target: Target, command: list[str], folder: Path) -> None:
    """Run a compiler in a folder.

    Raises:
        CheckFailed: The compiler refused.
    """
    done = run_to_end(command, folder, f"{target.name}: {target.compiler}")
    if done.returncode != 0:
        lines = "\n".join(done.stderr.splitlines()[:_SHOWN_LINES])
        raise CheckFailed(f"{target.name}: {target.compiler} failed:\n{lines}")


def _links(target: Target) -> bool:
    """Test whether a program can be built: one was linked before, or an empty one can be."""
    return _linking(target) in _linked or _links_empty(_linking(target))


def _linking(target: Target) -> Target:
    """Return the part of a target that decides whether a program can be linked."""
    if target.bare:  # its parts are linked in, whose objects are those that will be needed
        return target
    flags = tuple(f for f in target.flags if not f.startswith("-O") and f != "-march=native")
    return target.model_copy(update={"name": target.compiler, "flags": flags, "default": False})


@functools.cache
def _links_empty(target: Target) -> bool:
    with scratch_folder() as work:
        source = work / "empty.c"
        write_own(source, "int main(void)\n{\n    return 0;\n}\n")
        try:
            compile_c(target, [source], work / "empty", include=work)
        except CheckFailed:
            return False
    return True
