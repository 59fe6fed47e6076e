"""Check what compilers make of libc/ and include/: warnings, symbols, data, fused operations."""

from __future__ import annotations

import re
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Iterator, Sequence
from pathlib import Path

#: What docs and headers tell users to compile with.
DOCUMENTED = ("-std=c99", "-ffp-contract=off")
WARNINGS = (
    "-pedantic", "-Wall", "-Wextra", "-Wconversion", "-Wsign-conversion", "-Wdouble-promotion", "-Wundef", "-Wshadow",
    "-Wfloat-equal", "-Wswitch-enum", "-Wmissing-declarations", "-Werror",
)  # fmt: skip
OPTIONS = {
    "default options": (),
    "every option": ("-DGTC_WITH_BANK=1", "-DGTC_HALF_MULTIPLY=0"),
    "products in halves": ("-DGTC_HALF_MULTIPLY=1", "-DGTC_MAX_TERMS=1"),
}
M0 = ("arm-none-eabi-gcc", "-mthumb", "-mcpu=cortex-m0", "-O2", "-ffreestanding")
M4F = (
    "arm-none-eabi-gcc",
    "-mthumb",
    "-mcpu=cortex-m4",
    "-mfloat-abi=hard",
    "-mfpu=fpv4-sp-d16",
    "-O2",
    "-ffreestanding",
)
M7 = (
    "arm-none-eabi-gcc",
    "-mthumb",
    "-mcpu=cortex-m7",
    "-mfloat-abi=hard",
    "-mfpu=fpv5-sp-d16",
    "-O3",
    "-ffreestanding",
)
HOST = ("gcc", "-O2", "-fno-pic")
AVR = ("avr-gcc", "-mmcu=atmega1284p", "-O2")
COMPILERS = {"gcc": HOST, "clang": ("clang", "-O2"), "Cortex-M0": M0, "Cortex-M4F": M4F, "AVR": AVR}
#: Functions of the compiler's own library, and the four of the C library that compilers call of their own accord.
HELPERS = re.compile(r"mem(?:cpy|set|move|cmp)|__aeabi_\w+|__gnu_thumb1_case_\w+|__(?:u?div|mul)[sd]i3")
FUSING = {
    "x86-64 with FMA": ("gcc", "-O3", "-march=haswell"),
    "x86-64 with FMA, clang": ("clang", "-O3", "-march=haswell"),
    "Cortex-M4F": M4F,
    "Cortex-M7": M7,
    "aarch64": ("aarch64-linux-gnu-gcc", "-O3"),
}
#: Multiply-add of any kind on x86-64, arm and aarch64.
MULTIPLY_ADD = re.compile(r"\b(vfn?m(?:add|sub)\w*|vfn?m[as]\w*|vn?ml[as]\w*\.f32|fn?m(?:add|sub)|fml[as])\b")
CONTROL = "float control(float a, float b, float c)\n{\n    return a * b + c;\n}\n"


def sources(root: Path) -> list[Path]:
    """Every C file of the runtime."""
    return sorted((root / "libc").glob("*.c"))


def run(command: Sequence[str | Path], cwd: Path) -> subprocess.CompletedProcess[str]:
    """Runs a tool that may fail."""
    return subprocess.run([str(c) for c in command], cwd=cwd, capture_output=True, text=True, check=False)


def present(tool: str) -> Iterator[str]:
    """Yield a fault if a tool is not there: a promise that was not checked is not kept."""
    if shutil.which(tool) is None:
        yield f"{tool} is not installed (tools/setup.sh check)"


def first_lines(text: str) -> str:
    """The head of a tool's complaint."""
    return "\n    ".join(text.strip().splitlines()[:6])


def emitted(root: Path, folder: Path) -> list[Path]:
    """Sources of the runtime as they are emitted for tables that need everything; their header is beside them."""
    script = (
        "import sys; from pathlib import Path; from gyrotc.tables.runtime import runtime_texts, stated_names\n"
        "from gyrotc.common import inputs\n"
        "root, out = map(Path, sys.argv[1:])\n"
        "inputs.runtime_folders = lambda: (root / 'include', root / 'libc')\n"
        "import gyrotc.tables.runtime as made; made.runtime_folders = inputs.runtime_folders\n"
        "sizes = {'GTC_MAX_SLOPE_BLOCKS': 20, 'GTC_MAX_TERMS': 4, 'GTC_BIAS_FRAC_BITS': 24}\n"
        "options = {name: 1 for name in stated_names()} | sizes\n"
        "for name, text in runtime_texts(options, ('f32', 'q31')).items():\n"
        "    (out / name).write_bytes(text)\n"
    )
    subprocess.run([sys.executable, "-c", script, str(root), str(folder)], check=True)
    return sorted(folder.glob("gtc_???.c"))


def warnings(root: Path) -> Iterator[str]:
    """Every file, and what is emitted of them, under every compiler with every option."""
    for name, compiler in COMPILERS.items():
        yield from present(compiler[0])
        if shutil.which(compiler[0]) is None:
            continue
        for what, options in OPTIONS.items():
            with tempfile.TemporaryDirectory() as work:
                flags = [*compiler, *DOCUMENTED, *WARNINGS]
                made = emitted(root, Path(work))
                target = [option for option in options if "HALF_MULTIPLY" in option]
                for files, include, stated in (
                    (sources(root), root / "include", options),
                    (made, work, target),
                ):
                    done = run([*flags, *stated, f"-I{include}", "-c", *files], Path(work))
                    if done.returncode != 0:
                        yield f"{name}, {what}: {first_lines(done.stderr)}"


def cplusplus(root: Path) -> Iterator[str]:
    """The headers, and that of an emitted table, included by C++."""
    headers = [root / "include" / "gtc.h", *(root / "examples" / "minimal").glob("gtc_*.h")]
    for compiler in ("g++", "clang++"):
        yield from present(compiler)
        if shutil.which(compiler) is None:
            continue
        with tempfile.TemporaryDirectory() as work:
            text = "".join(f'#include "{h}"\n' for h in headers) + "int main()\n{\n    return 0;\n}\n"
            (Path(work) / "user.cpp").write_text(text)
            flags = ["-std=c++11", "-Wall", "-Wextra", "-pedantic", "-Werror", f"-I{root / 'include'}"]
            done = run([compiler, *flags, "-c", "user.cpp"], Path(work))
            if done.returncode != 0:
                yield f"{compiler}: {first_lines(done.stderr)}"


def _compiled(root: Path, compiler: Sequence[str], work: Path, *options: str) -> list[Path]:
    """Objects of the runtime with every option on, by the documented flags."""
    flags = [*compiler, *DOCUMENTED, *OPTIONS["every option"][:1], *options, f"-I{root / 'include'}"]
    done = run([*flags, "-c", *sources(root)], work)
    if done.returncode != 0:
        raise RuntimeError(first_lines(done.stderr))
    return sorted(work.glob("*.o"))


def _binutil(compiler: str, tool: str) -> str:
    return compiler.replace("gcc", tool) if compiler.endswith("-gcc") else tool


def _symbols(root: Path, compiler: Sequence[str]) -> list[tuple[str, str]]:
    """Kind and name of every symbol of the runtime's objects."""
    with tempfile.TemporaryDirectory() as work:
        objects = _compiled(root, compiler, Path(work))
        lines = run([_binutil(compiler[0], "nm"), *objects], Path(work)).stdout.splitlines()
    found = [line.split() for line in lines]
    return [(words[-2], words[-1]) for words in found if len(words) >= 2]


def symbols(root: Path) -> Iterator[str]:
    """No symbol from outside but helpers and memory functions of compilers; public names begin with gtc_."""
    for name, compiler in (("x86-64", HOST), ("Cortex-M0", M0), ("Cortex-M4F", M4F)):
        found = _symbols(root, compiler)
        own = {symbol for kind, symbol in found if kind.isupper() and kind != "U"}
        for symbol in sorted({s for kind, s in found if kind == "U"} - own):
            if not HELPERS.fullmatch(symbol):
                yield f"{name}: needs {symbol}"
        for symbol in sorted(own):
            if not symbol.startswith("gtc_"):
                yield f"{name}: public name {symbol}"


def writable(root: Path) -> Iterator[str]:
    """No writable static data."""
    for name, compiler in (("x86-64", HOST), ("Cortex-M0", M0), ("Cortex-M4F", M4F)):
        for kind, symbol in _symbols(root, compiler):
            if kind in "bBdDC":
                yield f"{name}: {symbol} is writable"


def _multiply_adds(compiler: Sequence[str], objects: Sequence[Path], work: Path) -> list[str]:
    text = run([_binutil(compiler[0], "objdump"), "-d", "--no-show-raw-insn", *objects], work).stdout
    return [match[0] for match in MULTIPLY_ADD.finditer(text)]


def fused(root: Path) -> Iterator[str]:
    """No multiply-add in any object; and no expression that a compiler could make one of.

    A control that is free to be fused proves on each target that one would be seen.
    """
    for name, compiler in FUSING.items():
        yield from present(compiler[0])
        if shutil.which(compiler[0]) is None:
            continue
        with tempfile.TemporaryDirectory() as work:
            objects = _compiled(root, compiler, Path(work))
            found = _multiply_adds(compiler, objects, Path(work))
            if found:
                yield f"{name}: {len(found)} of {', '.join(sorted(set(found)))}"
            (Path(work) / "control.c").write_text(CONTROL)
            run([*compiler, "-ffp-contract=fast", "-c", "control.c"], Path(work))
            if not _multiply_adds(compiler, [Path(work) / "control.o"], Path(work)):
                yield f"{name}: a multiply-add would not be seen"
    yield from _contractible(root)


def _contractible(root: Path) -> Iterator[str]:
    """Expressions with a product and a sum in one: clang marks them where it may contract within expressions."""
    yield from present("clang")
    with tempfile.TemporaryDirectory() as work:
        flags = [
            "-std=c99",
            "-O0",
            "-ffp-contract=on",
            *OPTIONS["every option"],
            f"-I{root / 'include'}",
        ]
        for source in sources(root):
            done = run(["clang", *flags, "-S", "-emit-llvm", source, "-o", "-"], Path(work))
            for function in re.findall(r"^define [^@]*@(\w+).*?^\}", done.stdout, re.MULTILINE | re.DOTALL):
                body = re.search(rf"^define [^@]*@{function}\b.*?^\}}", done.stdout, re.MULTILINE | re.DOTALL)
                if body is not None and "llvm.fmuladd" in body[0]:
                    yield f"{source.name}: {function} has a product and a sum in one expression"
