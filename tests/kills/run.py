"""300 jobs and more killed or let down by the disk: afterwards the earlier result or the new one, nothing besides.

usage: python -m tests.kills.run [--commands N] [--only NAME ...] [--every K] [--seed S] [--json FILE]
"""

from __future__ import annotations

import argparse
import json
import os
import random
import secrets
import sys
import tempfile
from collections import Counter
from pathlib import Path

from .driver import ACTIONS, End, compiled_shim, run, seconds
from .jobs import Case, commands, left_beside, writing, wrong

_IN_SHIM = "GYROTC_TEST_SHIM"


class Campaign:
    """Counts of what was done, and what was found wrong."""

    def __init__(self, root: Path) -> None:
        self.root = root
        self.counts: Counter[str] = Counter()
        self.found: list[str] = []
        self.expected: set[str] = set()

    def kill(self, case: Case, action: str, at: int = 0, after_s: float | None = None) -> End:
        """Ends a job, looks at what is left, lets the job run again, looks again."""
        end = run(case.job, self.root, action, at, after_s)
        where = f"{case.name}, {action} at {f'call {at}' if after_s is None else f'{after_s:.3f} s'}"
        self.counts[action] += 1
        for result in case.results:
            self.found += [f"{where}: {result.name} {what}" for what in wrong(result)]
        if "Traceback" in end.told:
            self.found.append(f"{where}: a traceback: {end.told[-600:]}")
        if action in ("TERM", "INT") and left_beside(self.root, self.expected):
            self.found.append(f"{where}: left {left_beside(self.root, self.expected)} itself")
        again = run(case.job, self.root)
        if again.status != 0:
            self.found.append(f"{where}: the next job ends with {again.status}: {again.told}")
        for result in case.results:
            self.found += [f"{where}, then again: {result.name} {what}" for what in wrong(result)]
        if left := left_beside(self.root, self.expected):
            self.found.append(f"{where}: the next job leaves {sorted(left)}")
        return end

    def first(self, case: Case) -> int:
        """Lets a job run undisturbed; the number of its calls that change files."""
        end = run(case.job, self.root)
        if end.status != 0:
            raise SystemExit(f"{case.name} fails by itself: {end.told}")
        self.expected = {path.name for path in self.root.iterdir() if not path.name.startswith(".")}
        return end.calls


def between_calls(root: Path, every: int) -> Campaign:
    """Every way of writing, ended in every way at every `every`-th call."""
    campaign = Campaign(root)
    cases = writing(root)
    for case in cases:
        campaign.first(case)
    for case in cases:
        calls = run(case.job, root).calls
        campaign.counts["calls"] += calls
        for number, action in enumerate(ACTIONS):
            first = 1 + (17 * number) % min(every, calls)  # so that few kills meet different calls
            for at in range(first, calls + 1, every):
                campaign.kill(case, action, at)
    return campaign


def of_commands(root: Path, number: int, only: set[str], draw: random.Random) -> Campaign:
    """Commands ended at random calls, and signalled at random times."""
    campaign = Campaign(root)
    cases = [case for case in commands(root) if not only or case.name in only]
    calls = {case.name: campaign.first(case) for case in cases}
    lengths = {case.name: seconds(case.job, root) for case in cases}
    campaign.first(cases[0])
    for k in range(number):
        case = cases[k % len(cases)]
        action = draw.choice(list(ACTIONS))
        campaign.counts[case.name] += 1
        if ACTIONS[action] > 0 and draw.random() < 0.5:
            campaign.kill(case, action, after_s=draw.uniform(0.0, 1.05) * lengths[case.name])
        else:
            campaign.kill(case, action, draw.randint(1, calls[case.name]))
        print(f"\r{k + 1} of {number}", end="", file=sys.stderr, flush=True)
    return campaign


def _again_with_shim() -> None:
    """This process again, with the shim preloaded."""
    with tempfile.TemporaryDirectory(prefix="gyrotc-kills-") as work:
        library = compiled_shim(Path(work))
        environment = os.environ | {"LD_PRELOAD": str(library), _IN_SHIM: "1"}
        command = [sys.executable, "-m", "tests.kills.run", *sys.argv[1:]]
        raise SystemExit(
            os.waitstatus_to_exitcode(
                os.waitpid(os.spawnve(os.P_NOWAIT, sys.executable, command, environment), 0)[1]
            )
        )


def main() -> None:
    """The command."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--commands", type=int, default=300, help="whole commands to end")
    parser.add_argument("--every", type=int, default=1, help="try every n-th call only; 0: none")
    parser.add_argument("--only", nargs="+", default=(), help="these commands only")
    parser.add_argument("--seed", type=int, default=secrets.randbits(32))
    parser.add_argument("--json", type=Path, default=None, help="write the counts here")
    arguments = parser.parse_args()
    if _IN_SHIM not in os.environ:
        _again_with_shim()
    print(f"seed {arguments.seed}", flush=True)
    done = {}
    with tempfile.TemporaryDirectory(prefix="gyrotc-kills-") as work:
        root = Path(work).resolve()
        os.environ.update(TMPDIR=str(root / "tmp"), XDG_CACHE_HOME=str(root / "cache"))
        for name in ("tmp", "cache", "exchange", "link", "commands"):
            (root / name).mkdir()
        if arguments.every:
            done["writing, names exchanged"] = between_calls(root / "exchange", arguments.every)
            os.environ["SHIM_NO_EXCHANGE"] = "1"
            done["writing, names not exchanged"] = between_calls(root / "link", arguments.every)
            del os.environ["SHIM_NO_EXCHANGE"]
        if arguments.commands:
            draw = random.Random(arguments.seed)
            done["commands"] = of_commands(root / "commands", arguments.commands, set(arguments.only), draw)
    counts = {name: dict(campaign.counts) for name, campaign in done.items()}
    faults = [fault for campaign in done.values() for fault in campaign.found]
    ended = sum(n for counted in counts.values() for key, n in counted.items() if key in ACTIONS)
    print(
        json.dumps({"seed": arguments.seed, "ended": ended, "counts": counts, "wrong": len(faults)}, indent=1)
    )
    for fault in faults[:40]:
        print(fault, file=sys.stderr)
    if arguments.json:
        result = {"seed": arguments.seed, "ended": ended, "counts": counts, "wrong": len(faults)}
        arguments.json.write_text(json.dumps(result, indent=1) + "\n", encoding="utf-8")
    raise SystemExit(1 if faults else 0)


if __name__ == "__main__":
    main()
