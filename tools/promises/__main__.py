"""What the C runtime and the generator promise, checked on text, objects and by analysers: `python tools/promises`.

Prints what is broken, one line each; exit status 1 if there is anything. Standard library only, but for mypy.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable, Iterator
from pathlib import Path

import ages
import analysers
import figures
import objects
import oldest
import origins
import prose
import source

CHECKS: dict[str, Callable[[Path], Iterator[str]]] = {
    "words": source.forbidden_words,
    "functions": source.long_functions,
    "origins": origins.unexplained_numbers,
    "figures": figures.stale_figures,
    "ages": ages.unnamed,
    "sentences": prose.long_sentences,
    "files": prose.missing_files,
    "vocabulary": prose.private_words,
    "oldest": oldest.younger_than_supported,
    "warnings": objects.warnings,
    "cplusplus": objects.cplusplus,
    "symbols": objects.symbols,
    "writable": objects.writable,
    "fused": objects.fused,
    "misra": analysers.misra,
    "fanalyzer": analysers.fanalyzer,
    "tidy": analysers.tidy,
}


def main() -> int:
    """Runs the checks that are named, by default all."""
    parser = argparse.ArgumentParser(prog="tools/promises", description=__doc__.splitlines()[0])
    parser.add_argument("checks", nargs="*", metavar="CHECK", help=f"of {', '.join(CHECKS)}; default: all")
    parser.add_argument("--root", type=Path, default=Path(__file__).resolve().parents[2], help="the source tree")
    arguments = parser.parse_args()
    unknown = set(arguments.checks) - set(CHECKS)
    if unknown:
        parser.error(f"no check named {', '.join(sorted(unknown))}")
    broken = 0
    for name in arguments.checks or CHECKS:
        found = list(CHECKS[name](arguments.root.resolve()))
        print(f"{name}: {'kept' if not found else f'{len(found)} broken'}")
        for text in found:
            print(f"  {text}")
        broken += len(found)
    return 1 if broken else 0


if __name__ == "__main__":
    sys.exit(main())
