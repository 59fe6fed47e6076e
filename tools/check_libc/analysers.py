"""Findings of analysers: MISRA C:2012 by cppcheck, gcc -fanalyzer, clang-tidy.

A deviation from MISRA stands where it is made, in a comment `MISRA <rule>: <reason>`, which covers the lines
from there to the next empty one, or `MISRA <rule> throughout: <reason>`, which covers all files.
"""

from __future__ import annotations

import re
import shutil
import tempfile
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from objects import DOCUMENTED, M4F, OPTIONS, first_lines, present, run, sources
from words import files

MOST_DEVIATIONS = 10
_MARK = re.compile(r"MISRA (?P<rule>\d+\.\d+)(?P<all> throughout)?: (?P<reason>[^*]+)")
_FOUND = re.compile(r"(?P<file>[^:]+):(?P<line>\d+): misra-c2012-(?P<rule>\d+\.\d+)")
#: Arithmetic of pointers into arrays that cppcheck follows wrongly across files.
_NOT_SO = {"ctuArrayIndex"}
_UNUSED = "misra-c2012-2.5"


@dataclass(frozen=True, slots=True)
class Deviation:
    """A comment that permits breaking a rule: in which lines of which file, or everywhere (no lines)."""

    rule: str
    path: Path
    lines: range

    def covers(self, rule: str, path: Path, line: int) -> bool:
        """Test whether it permits what was found."""
        return rule == self.rule and (not self.lines or (path == self.path and line in self.lines))


def deviations(root: Path) -> list[Deviation]:
    """Return all deviations that the sources declare."""
    found = []
    for path in files(root):
        text = path.read_text(encoding="ascii")
        for match in _MARK.finditer(text):
            first = text.count("\n", 0, match.start()) + 1
            end = text.find("\n\n", match.start())
            last = text.count("\n", 0, end if end >= 0 else len(text)) + 1
            found.append(Deviation(match["rule"], path, range(0) if match["all"] else range(first, last + 1)))
    return found


def _cppcheck(root: Path) -> set[str]:
    """Lines `file:line: id` for every set of options that the preprocessor can see, with and without banks and terms.

    What is unused in one of them is unused only if it is so in all.
    """
    command = ["cppcheck", "--addon=misra", "--std=c99", "--platform=unix32", "--quiet", "--force", "-U__FAST_MATH__",
               "-UGTC_CONFIG_HEADER", f"-I{root / 'include'}", "--template={file}:{line}: {id}"]  # fmt: skip
    found = []
    for options in ([], ["-DGTC_WITH_BANK=1"]):
        with tempfile.TemporaryDirectory() as work:
            done = run([*command, *options, *sources(root)], Path(work))
        found.append({line for line in done.stderr.splitlines() if line.rsplit(" ", 1)[-1] not in _NOT_SO})
    plain, whole = found
    return {line for line in plain | whole if not line.endswith(_UNUSED)} | (plain & whole)


def misra(root: Path) -> Iterator[str]:
    """Every breach of a rule is declared at its line; no more than ten rules; no declaration is stale."""
    yield from present("cppcheck")
    if shutil.which("cppcheck") is None:
        return
    declared = deviations(root)
    used = set()
    for line in sorted(_cppcheck(root)):
        match = _FOUND.match(line)
        if match is None:
            yield line.removeprefix(f"{root}/")
            continue
        permits = [d for d in declared if d.covers(match["rule"], Path(match["file"]), int(match["line"]))]
        used.update(permits)
        if not permits:
            yield f"{Path(match['file']).relative_to(root)}:{match['line']}: MISRA C:2012, rule {match['rule']}"
    for deviation in declared:
        if deviation not in used:
            yield f"{deviation.path.relative_to(root)}: nothing breaks rule {deviation.rule} where it is permitted"
    rules = sorted({d.rule for d in declared})
    if len(rules) > MOST_DEVIATIONS:
        yield f"{len(rules)} rules are deviated from ({', '.join(rules)}), more than {MOST_DEVIATIONS}"


def fanalyzer(root: Path) -> Iterator[str]:
    """gcc's own analyser of paths, on the host and for a bare target."""
    for compiler in (("gcc", "-O1"), M4F):
        yield from present(compiler[0])
        if shutil.which(compiler[0]) is None:
            continue
        with tempfile.TemporaryDirectory() as work:
            flags = [
                *compiler,
                *DOCUMENTED,
                *OPTIONS["every option"],
                "-fanalyzer",
                "-Werror",
                f"-I{root / 'include'}",
            ]
            done = run([*flags, "-c", *sources(root)], Path(work))
            if done.returncode != 0:
                yield f"{compiler[0]}: {first_lines(done.stderr)}"


def tidy(root: Path) -> Iterator[str]:
    """clang-tidy with the checks of clang-tidy.yaml."""
    yield from present("clang-tidy")
    if shutil.which("clang-tidy") is None:
        return
    flags = ["--quiet", "--warnings-as-errors=*", f"--config-file={Path(__file__).with_name('clang-tidy.yaml')}"]
    done = run(
        [
            "clang-tidy",
            *flags,
            *sources(root),
            "--",
            "-std=c99",
            *OPTIONS["every option"],
            f"-I{root / 'include'}",
        ],
        root,
    )
    if done.returncode != 0:
        yield from sorted(set(re.findall(r"^.*(?:error|warning): .*$", done.stdout, re.MULTILINE))) or [
            done.stderr[:500]
        ]
