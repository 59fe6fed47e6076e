"""`python -m bench [NAME ...]`: run campaigns, keep their records, make docs/results.md; without names, list them."""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
from importlib.util import find_spec
from pathlib import Path

from . import page, records
from .campaigns import CAMPAIGNS, Settings, module_of, say

_PEERS = ("sklearn", "emlearn", "fastcan", "sysidentpy", "minisom", "pandas", "polars")
_ENVIRONMENT = records.ROOT / "build" / "bench"


def main() -> int:
    """Return 1 if a figure misses its aim."""
    given = _arguments()
    if not given.names:
        _list()
        return 0
    if any(CAMPAIGNS[name].peers for name in given.names) and not all(map(find_spec, _PEERS)):
        return _with_peers()
    settings = Settings(given.quick, given.seed, given.base, given.sets, given.real.absolute(), given.workers)
    missed = 0
    for name in given.names:
        say(f"{name}: {CAMPAIGNS[name].title}")
        module = module_of(name)
        record = json.loads(json.dumps(module.measure(settings)))
        table = module.table(record)
        print(table.markdown(), flush=True)
        if given.quick:
            continue
        for row in table.missed():
            missed += 1
            print(f"missed: {row}", flush=True)
        if CAMPAIGNS[name].keeps_record:
            page.keep(given.docs, name, record)
    return 1 if missed else 0


def _arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(prog="python -m bench", description=__doc__)
    parser.add_argument("names", nargs="*", metavar="NAME", help=", ".join(CAMPAIGNS))
    parser.add_argument("--docs", type=Path, default=records.ROOT / "docs", help="folder of pages and records")
    parser.add_argument("--quick", action="store_true", help="a first small part, to see that it works; keep nothing")
    parser.add_argument("--seed", type=int, help="first seed of what is drawn")
    parser.add_argument("--base", default="", help="oracle: the commit to compare with")
    parser.add_argument("--sets", default="", help="take these sets of a campaign, with commas between")
    parser.add_argument("--real", type=Path, default=Settings().real, help="folder of measured recordings")
    parser.add_argument("--workers", type=int, default=Settings().workers, help="processes")
    given = parser.parse_args()
    given.names = [name for word in given.names for name in word.split()]
    given.sets = tuple(filter(None, (name.strip() for name in given.sets.split(","))))
    unknown = [name for name in given.names if name not in CAMPAIGNS]
    if unknown:
        parser.error(f"no campaign is called {', '.join(unknown)}; there are {', '.join(CAMPAIGNS)}")
    if "oracle" in given.names and not given.base:
        parser.error("oracle compares two commits: make bench ONLY=oracle BASE=COMMIT")
    return given


def _list() -> None:
    print("make bench ONLY=name runs a campaign, keeps docs/results/name.json and makes docs/results.md:\n")
    for name, campaign in CAMPAIGNS.items():
        print(f"  {name:11} {campaign.title}; {campaign.takes}")
    print("\nQUICK=1 tries a small part and keeps nothing; SEED=n draws again; SETS=a,b takes these sets.")


def _with_peers() -> int:
    """Run the same in build/bench, which has gyrotc and the libraries that it is compared with."""
    python = _ENVIRONMENT / "bin" / "python"
    if not python.exists():
        subprocess.run([sys.executable, "-m", "venv", _ENVIRONMENT], check=True)
    install = [python, "-m", "pip", "install", "-q", "--disable-pip-version-check", "-e", "./gen[bench]"]
    subprocess.run(install, cwd=records.ROOT, check=True)
    os.execv(python, [str(python), "-m", "bench", *sys.argv[1:]])


if __name__ == "__main__":
    sys.exit(main())
