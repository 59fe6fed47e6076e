"""Compile and run C for a target: compiler, flags, how to run. One short TOML file describes each target."""

from __future__ import annotations

import shutil
import subprocess
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from importlib import resources
from pathlib import Path
from typing import Annotated

from pydantic import BaseModel, ConfigDict, Field

from .errors import CheckFailed, GyrotcError

if sys.version_info >= (3, 11):
    import tomllib
else:
    import tomli as tomllib

__all__ = ["C_FLAGS", "Run", "Target", "all_targets", "compile_c", "compiler_version", "run_program"]

C_FLAGS = (
    "-std=c99", "-pedantic", "-ffp-contract=off", "-Wall", "-Wextra", "-Wconversion", "-Wsign-conversion",
    "-Werror", "-ffunction-sections", "-fdata-sections",
)  # fmt: skip
_RUN_LIMIT_S = 600


class Target(BaseModel):
    """One target: `compiler` with `flags`, run by `run` (empty: natively)."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    name: Annotated[str, Field(pattern=r"^[a-z0-9][A-Za-z0-9_.-]*$")]
    compiler: str
    package: str
    flags: tuple[str, ...] = ()
    run: tuple[str, ...] = ()
    numerics: tuple[str, ...] = ("f32", "q31")
    default: bool = True

    def missing(self) -> str | None:
        """The package that brings what this target lacks here; None if it can run."""
        tools = [self.compiler, *self.run[:1]]
        return None if all(shutil.which(tool) for tool in tools) else self.package


@dataclass(frozen=True, slots=True)
class Run:
    """How a program ended and what it printed."""

    returncode: int
    stdout: bytes
    stderr: str


def all_targets() -> dict[str, Target]:
    """Every target by name, in the order of the file names."""
    found = {}
    folder = resources.files("gyrotc") / "targets"
    for entry in sorted(folder.iterdir(), key=lambda e: e.name):
        if entry.name.endswith(".toml"):
            target = Target.model_validate(tomllib.loads(entry.read_text(encoding="utf-8")))
            found[target.name] = target
    return found


def compile_c(
    target: Target, sources: Sequence[Path], program: Path, *, include: Path, defines: Sequence[str] = ()
) -> list[str]:
    """Compiles and links a program; returns the command.

    Raises:
        CheckFailed: The compiler refused; the message holds its first lines.
    """
    flags = [*C_FLAGS, *target.flags, *(f"-D{d}" for d in defines)]
    files = [str(s) for s in sources]
    command = [target.compiler, *flags, f"-I{include}", *files, "-Wl,--gc-sections", "-o", str(program)]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    if done.returncode != 0:
        lines = "\n".join(done.stderr.splitlines()[:12])
        raise CheckFailed(f"{target.name}: {target.compiler} failed:\n{lines}")
    return [target.compiler, *flags]


def run_program(target: Target, program: Path, data: bytes = b"") -> Run:
    """Runs a compiled program with `data` on its standard input; bounded in time."""
    command = [*target.run, str(program)]
    try:
        done = subprocess.run(command, input=data, capture_output=True, check=False, timeout=_RUN_LIMIT_S)
    except subprocess.TimeoutExpired as error:
        raise GyrotcError(f"{target.name}: the program did not end within {_RUN_LIMIT_S} s") from error
    return Run(done.returncode, done.stdout, done.stderr.decode("utf-8", "replace"))


def compiler_version(compiler: str) -> str:
    """Name and version in one short text, e.g. ``gcc 12.2.0``."""
    done = subprocess.run([compiler, "-dumpfullversion"], capture_output=True, text=True, check=False)
    version = done.stdout.strip()
    if done.returncode != 0 or not version or len(version.splitlines()) != 1:
        done = subprocess.run([compiler, "-dumpversion"], capture_output=True, text=True, check=False)
        version = done.stdout.strip()
    return f"{compiler} {version}"
