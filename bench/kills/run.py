"""`python -m bench.kills.run`: end jobs, with the shim preloaded, and print as JSON what was left.

Afterwards there is the earlier result or the new one, and nothing else.
"""

from __future__ import annotations

import argparse
import importlib
import itertools
import json
import os
import pkgutil
import random
import sys
import tempfile
from collections import Counter
from pathlib import Path

import gyrotc

from .driver import ACTIONS, Blow, End, adopt_orphans, run, seconds
from .fleets import fleet
from .jobs import Case, Content, commands, left_beside, writing, wrong


class Campaign:
    """Counts of what was done, and what was found wrong."""

    def __init__(self, root: Path) -> None:
        self.root = root
        self.counts: Counter[str] = Counter()
        self.found: list[str] = []
        self._expected: set[str] = set()
        self._changing: dict[Path, set[str]] = {}
        self._version = itertools.count()

    def kill(self, case: Case, blow: Blow) -> End:
        """Ends a job, looks at what is left, lets the job run again, looks again."""
        version = next(self._version)
        where = f"{case.name}, version {version}, {blow}"
        case.prepare(version)
        before = case.contents()
        end = run(case.job(version), self.root, blow)
        self.counts[blow.action] += 1
        self._look(case, where)
        found = case.contents()
        if "Traceback" in end.reported:
            self._tell(where, f"a traceback: {end.reported[-600:]}")
        if blow.action in ("TERM", "INT") and not blow.workers:
            if end.status not in (0, -ACTIONS[blow.action]) or (end.status and end.reported):
                self._tell(where, f"ends with {end.status}: {end.reported[-300:]}")
            if self._left():
                self._tell(where, f"left {self._left()} itself")
        again = run(case.job(version), self.root)
        if again.status != 0:
            self._tell(where, f"the next job ends with {again.status}: {again.reported}")
        self._look(case, f"{where}, then again")
        reported = (1, 2) if case.name == "check" else (1,)  # a file that cannot be read is a result of its own
        if end.status not in reported:
            for result, *contents in zip(case.results, before, found, case.contents(), strict=True):
                self._compare(where, result, *contents)
        if left := self._left():
            self._tell(where, f"the next job leaves {sorted(left)}")
        return end

    def _look(self, case: Case, where: str) -> None:
        for result in case.results:
            for what in wrong(result):
                self._tell(where, f"{result.name} {what}")
        for what in case.disagree():
            self._tell(where, what)

    def _compare(self, where: str, result: Path, before: Content, found: Content, after: Content) -> None:
        """What was found is what was there, or what an undisturbed job makes; but for files that are never the same."""
        changing = self._changing.get(result, set())
        old, now, new = ({k: b"" if k in changing else v for k, v in c.items()} for c in (before, found, after))
        if now not in (old, new):
            names = sorted(n for n in {*old, *now, *new} if now.get(n) not in (old.get(n), new.get(n)))
            self._tell(where, f"{result.name} is neither as before nor as after: {names or 'a mixture'}")

    def _left(self) -> set[str]:
        return left_beside(self.root, self._expected)

    def _tell(self, where: str, what: str) -> None:
        self.found.append(f"{where}: {what}")
        print(f"\n{self.found[-1]}", file=sys.stderr, flush=True)

    def first(self, case: Case) -> int:
        """Lets a job run undisturbed, twice; the number of its calls that change files."""
        version = next(self._version)
        seen = []
        for _ in range(2):
            case.prepare(version)
            end = run(case.job(version), self.root)
            if end.status != 0:
                raise SystemExit(f"{case.name} fails by itself: {end.reported}")
            seen.append(case.contents())
        for result, one, other in zip(case.results, *seen, strict=True):
            self._changing.setdefault(result, set()).update(n for n in one if one[n] != other.get(n))
        self._expected = {path.name for path in self.root.iterdir() if not path.name.startswith(".")}
        self.counts["calls"] += end.calls
        return end.calls


def between_calls(root: Path, every: int) -> Campaign:
    """Every way of writing, ended in every way at every `every`-th call."""
    campaign = Campaign(root)
    cases = writing(root)
    for case in cases:
        campaign.first(case)
    campaign.counts.clear()
    for case in cases:
        calls = campaign.first(case)
        for number, action in enumerate(ACTIONS):
            first = 1 + (17 * number) % min(every, calls)  # so that few kills meet different calls
            for at in range(first, calls + 1, every):
                campaign.kill(case, Blow(action, at))
    return campaign


def of_commands(root: Path, number: int, draw: random.Random) -> Campaign:
    """Commands ended at random calls, and signalled at random times."""
    for module in pkgutil.walk_packages(gyrotc.__path__, "gyrotc."):
        if not module.name.endswith("__main__"):  # so that the jobs, which are forks, need not
            importlib.import_module(module.name)
    campaign = Campaign(root)
    cases = [*commands(root), fleet(root, root / "short.toml")]
    calls = {case.name: campaign.first(case) for case in cases}
    lengths = {case.name: seconds(case.job(0), root) for case in cases}
    campaign.first(cases[0])
    for k in range(number):
        case = cases[k % len(cases)]
        campaign.counts[case.name] += 1
        campaign.kill(case, _drawn(case, calls[case.name], lengths[case.name], draw))
        print(f"\r{k + 1} of {number}", end="", file=sys.stderr, flush=True)
    return campaign


def _drawn(case: Case, calls: int, length: float, draw: random.Random) -> Blow:
    action = draw.choice(list(ACTIONS))
    if case.worker_calls and draw.random() < 0.5:
        return Blow(action, draw.randint(1, case.worker_calls), workers=True)
    if ACTIONS[action] > 0 and draw.random() < 0.5:
        return Blow(action, after_s=draw.uniform(0.0, 1.05) * length)
    return Blow(action, draw.randint(1, calls))


def main() -> None:
    """The command."""
    parser = argparse.ArgumentParser(prog="python -m bench.kills.run", description=__doc__)
    parser.add_argument("--commands", type=int, required=True, help="whole commands to end")
    parser.add_argument("--every", type=int, required=True, help="try every n-th call")
    parser.add_argument("--seed", type=int, required=True)
    arguments = parser.parse_args()
    adopt_orphans()
    done = {}
    with tempfile.TemporaryDirectory(prefix="gyrotc-kills-") as work:
        root = Path(work).resolve()
        os.environ.update(TMPDIR=str(root / "tmp"), XDG_CACHE_HOME=str(root / "cache"))
        for name in ("tmp", "cache", "exchange", "link", "copy", "commands"):
            (root / name).mkdir()
        done["writing, names exchanged"] = between_calls(root / "exchange", arguments.every)
        os.environ["SHIM_NO_EXCHANGE"] = "1"
        done["writing, names not exchanged"] = between_calls(root / "link", arguments.every)
        os.environ["SHIM_NO_LINKS"] = "1"
        done["writing, names not exchanged, no links (as on FAT)"] = between_calls(root / "copy", arguments.every)
        del os.environ["SHIM_NO_EXCHANGE"], os.environ["SHIM_NO_LINKS"]
        draw = random.Random(arguments.seed)
        done["commands"] = of_commands(root / "commands", arguments.commands, draw)
    counts = {name: {**campaign.counts, "wrong": len(campaign.found)} for name, campaign in done.items()}
    ended = sum(n for counted in counts.values() for key, n in counted.items() if key in ACTIONS)
    print(json.dumps({"seed": arguments.seed, "ended": ended, "counts": counts}))


if __name__ == "__main__":
    main()
