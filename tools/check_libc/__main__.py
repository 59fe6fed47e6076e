"""`python tools/check_libc [CHECK ...]`: check the C runtime by its text, the objects of compilers, and analysers.

Prints what is wrong, one line each; exit status 1 if there is anything.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable, Iterator
from pathlib import Path

import analysers
import objects
import words

CHECKS: dict[str, Callable[[Path], Iterator[str]]] = {
    "words": words.forbidden_words,
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
    """Run the checks that are named, by default all."""
    parser = argparse.ArgumentParser(prog="tools/check_libc", description=__doc__.splitlines()[0])
    parser.add_argument("checks", nargs="*", metavar="CHECK", help=f"of {', '.join(CHECKS)}; default: all")
    parser.add_argument("--root", type=Path, default=Path(__file__).resolve().parents[2], help="the source tree")
    arguments = parser.parse_args()
    unknown = set(arguments.checks) - set(CHECKS)
    if unknown:
        parser.error(f"no check named {', '.join(sorted(unknown))}")
    wrong = 0
    for name in arguments.checks or CHECKS:
        found = list(CHECKS[name](arguments.root.resolve()))
        print(f"{name}: {'passed' if not found else f'{len(found)} wrong'}")
        for text in found:
            print(f"  {text}")
        wrong += len(found)
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
