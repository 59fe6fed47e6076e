"""What every command shares: the application, its options, progress and remaining time on stderr, results on stdout."""

from __future__ import annotations

import re
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from enum import Enum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer
from rich.console import Console
from rich.table import Table
from rich.text import Text
from typer.core import TyperGroup

from .. import __version__
from ..common.inputs import MOVABLE, set_ceilings
from ..common.texts import terminal_line, terminal_text

if TYPE_CHECKING:
    from ..train.prior.use import LotPrior


# Words of options repeat literal types of modules that are too slow to import for `--help`; a test compares both.
class GyroAxis(str, Enum):
    """Axis of a gyro."""

    x = "x"
    y = "y"
    z = "z"


def completing(words: Sequence[str]) -> Callable[[str], list[str]]:
    """The completion of an option whose values the job itself checks: a list of words, or an axis of the data."""

    def begun(incomplete: str) -> list[str]:
        return [word for word in words if word.startswith(incomplete)]

    return begun


GROUPS = {
    "Record": ("simulate", "import", "check"),
    "Calibrate": ("build", "diagnose", "compare", "fit", "emit"),
    "Judge": ("evaluate", "verify", "report"),
    "Many units": ("fleet", "lot"),
    "Share": ("certificate",),
    "Forms": ("schema",),
}
"""Names of commands by what a user does; a test holds that each stands once."""
_MARGIN = 6  # blanks around a name, as click's own list has them


class GroupedCommands(TyperGroup):
    """A group of commands whose help has a list for each step of the work."""

    def format_commands(self, ctx: Any, formatter: Any) -> None:
        """Writes the lists."""
        limit = formatter.width - _MARGIN - max(len(name) for name in self.commands)
        for title, names in GROUPS.items():
            with formatter.section(title):
                known = ((name, self.commands[name]) for name in names)
                formatter.write_dl([(name, one.get_short_help_str(limit)) for name, one in known])


_SILENT_S = 2.0  # before a time left is reported

Stages = Sequence[tuple[str, float]]
"""How the text of a stage begins, and its share of the time; a later text never tells less than an earlier one."""

# Shares of the time as `-v` tells it for `gyrotc simulate paper --seed 1`, two processors; a guess for other data.
FIT: Stages = (("reading", 0.5), ("training", 0.3), ("leaving out span", 0.2))
# Of a map of 512 centers; a usual one takes a tenth of a second
EMIT: Stages = (("rounding to f32", 0.2), ("rounding to q31", 0.65), ("answering the vectors", 0.15))
VERIFY: Stages = (("comparing files", 0.05), ("", 0.75), ("replaying", 0.1), ("every input", 0.1))
DIAGNOSE: Stages = (
    ("reading", 0.05), ("training", 0.02), ("leaving out span", 0.02), ("screening", 0.02),
    ("computing the signatures", 0.55), ("searching for causes", 0.07), ("comparing with the simulation", 0.06),
    ("measuring the gain", 0.08), ("drawing", 0.13),
)  # fmt: skip
BUILD: Stages = (
    ("reading", 0.11), ("training", 0.07), ("leaving out span", 0.02), ("emitting C", 0.03), ("verifying", 0.6),
    ("replaying", 0.09), ("drawing the report", 0.08),
)  # fmt: skip
COMPARE: Stages = (("reading", 0.05), ("", 0.95))
LOT: Stages = (("smoothness of the maps", 0.2), ("", 0.3), ("every unit left out", 0.4), ("without", 0.1))

_AXIS = re.compile(r"[xyz] \((\d+) of (\d+)\): ")  # of a job that does one axis after the other
_COUNTED = re.compile(r"(\d+) of (\d+)")
_FINISHED = re.compile(r"(\d+) of (\d+) gyros done")
_PERCENT = re.compile(r"(\d+) ?%")


def _words(left_s: float) -> str:
    if left_s < 120.0:
        return f"{left_s:.0f} s"
    return f"{left_s / 60.0:.0f} min" if left_s < 7200.0 else f"{left_s / 3600.0:.1f} h"


class StageLine:
    """The stage of a job that a terminal shows; its text is made anew whenever it is drawn."""

    def __init__(self, stages: Stages = ()) -> None:
        self._stages, self._begun = stages, time.monotonic()
        self._text, self._share, self._left_s, self._reported = "", 0.0, 0.0, self._begun

    def say(self, text: str) -> None:
        """Another stage, or another count within one."""
        self._text, self._reported = text, time.monotonic()
        self._share = max(self._share, self.share_of(text))
        if self._share:
            self._left_s = (self._reported - self._begun) / self._share * (1.0 - self._share)

    def share_of(self, text: str) -> float:
        """Which part of the work lies before what a text says, 0 ... 1; 0 where it says nothing of it."""
        if axis := _AXIS.match(text):
            number, of = int(axis[1]), max(int(axis[2]), 1)
            return (number - 1 + self.share_of(text[axis.end() :])) / of
        if not self._stages:
            return _within(text)
        before = 0.0
        place = max((name for name, _ in self._stages if text.startswith(name)), key=len, default=None)
        for name, share in self._stages:
            if name == place:
                return before + share * _within(text)
            before += share
        return 0.0

    def __rich__(self) -> Text:
        return Text(terminal_text(self.line(time.monotonic())))

    def line(self, now: float) -> str:
        """The text with percent and time left, or, where that is not known, with the time since the start."""
        if now - self._begun < _SILENT_S:
            return self._text
        if not self._share:
            return f"{self._text}, {now - self._begun:.0f} s"
        left = max(self._left_s - (now - self._reported), 0.0)
        return f"{self._text}, {int(100 * self._share)} %, about {_words(left)} left"


def _within(text: str) -> float:
    """The part of a stage that lies before its text: before the third of four it is a half, after it more."""
    if finished := _FINISHED.search(text):
        return int(finished[1]) / max(int(finished[2]), 1)
    if counted := _COUNTED.search(text):
        number, of = int(counted[1]), int(counted[2])
        return (number - 1) / of if 1 <= number <= of else 0.0
    percent = _PERCENT.search(text)
    return min(int(percent[1]), 100) / 100.0 if percent else 0.0


app = typer.Typer(
    name="gyrotc",
    cls=GroupedCommands,
    help="From thermal-chamber recordings of a gyro to verified C tables that compensate its bias.",
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
)


class _Loudness:
    """How much is reported, for this process."""

    quiet = False
    verbose = False


class _Console(Console):
    """Shows text of users as it is: no markup of rich, no names of emoji, nothing that a terminal would obey."""

    def render_str(self, text: str, **options: Any) -> Text:
        return super().render_str(terminal_text(text), **options | {"markup": False, "emoji": False})


_TO_COPY = re.compile(r"\w+ = \[\{.*?\}\]|\S+")

OUT = _Console(width=None if sys.stdout.isatty() else 120)
ERR = _Console(stderr=True)

DatasetArg = Annotated[Path, typer.Argument(help="Folder of recordings, with or without dataset.toml.")]
OutOption = Annotated[Path, typer.Option("--out", help="Folder for the result.")]


def written_place(path: Path | None) -> Path | None:
    """Checks, before the work begins, that gyrotc wrote what stands in the place of the result."""
    from ..results.files import check_replaceable

    if path is not None:
        check_replaceable(path)
    return path


_STANDARD_OUTPUT = Path("-")


def _json_place(path: Path | None) -> Path | None:
    """As `written_place`; with `-` the JSON alone has standard output, and all text goes to standard error."""
    if path != _STANDARD_OUTPUT:
        return written_place(path)
    OUT.stderr = True
    return path


JsonOption = Annotated[
    Path | None,
    typer.Option("--json", callback=_json_place, help="Write the machine-readable result here; -: standard output."),
]
AxisOption = Annotated[
    str | None,
    typer.Option(
        "--axis",
        help="x, y or z of a three-axis recording; build, check and diagnose do all without it.",
        autocompletion=completing((*(axis.value for axis in GyroAxis), "all")),
    ),
]


def _targets_begun(incomplete: str) -> list[str]:
    from ..verify.toolchain import all_targets

    return completing(("all", *all_targets()))(incomplete)


SeedOption = Annotated[
    int,
    typer.Option("--seed", min=0, help="Number from which everything random is drawn; the same number, the same data."),
]
NumericOption = Annotated[
    str | None,
    typer.Option(
        "--numeric",
        help="Arithmetics, e.g. f32 or f32,q31; default: all.",
        autocompletion=completing(("f32", "q31", "f32,q31")),
    ),
]
TargetOption = Annotated[
    list[str] | None,
    typer.Option(
        "--target",
        help="Name of a target, or all; may be repeated; default: Cortex-M4F and one host.",
        autocompletion=_targets_begun,
    ),
]
LotOption = Annotated[
    Path | None, typer.Option("--lot", help="What units of this type share (gyrotc lot): a unit then needs fewer runs.")
]
PriorOption = Annotated[
    Path | None,
    typer.Option("--prior", help="An earlier result of this gyro: a check run confirms it, or says where not."),
]
AgeingOption = Annotated[
    float | None, typer.Option("--ageing", help="How far the bias may have moved since --prior, 1 sigma, deg/h.")
]
AcceptOption = Annotated[
    str | None,
    typer.Option("--accept-fail", metavar="REASON", help="Release a unit whose verdict is not PASS; says why."),
]
DirArg = Annotated[Path, typer.Argument(help="Folder that build (or fit and emit) wrote.")]


@contextmanager
def progress(stages: Stages = ()) -> Iterator[Callable[[str], None]]:
    """A line on stderr that says what is being done; nothing when stderr is no terminal, or with --quiet.

    From 2 s on with percent and time left, as far as `stages` or counts ("3 of 12") in the texts tell them. With
    --verbose every stage is a line of its own with the seconds since the start, also where stderr is a file.
    """
    if _Loudness.verbose:
        start, said = time.monotonic(), [""]

        def line(text: str) -> None:
            if text != said[0]:
                print(f"{time.monotonic() - start:8.1f} s  {terminal_text(text)}", file=sys.stderr)
            said[0] = text

        yield line
        return
    if _Loudness.quiet or not ERR.is_terminal:
        yield lambda _: None
        return
    course = StageLine(stages)
    status = ERR.status(course)

    def shown(text: str) -> None:
        course.say(text)
        status.start()  # with the first stage: a question that comes before it has the terminal for itself

    try:
        yield shown
    finally:
        status.stop()


def tell(text: str, *, wrong: bool = False) -> None:
    """A line of the result on stdout, with `--json -` on stderr.

    On a terminal it is broken between words; with --quiet only what went wrong is printed.
    """
    if _Loudness.quiet and not wrong:
        return
    line = terminal_line(text)
    OUT.print(folded(line, OUT.width) if OUT.is_terminal else line, highlight=False, soft_wrap=True)


def folded(line: str, width: int) -> str:
    """A line in lines of at most so many characters, the further ones indented by two more.

    A word that is longer stays whole, and so does an entry for dataset.toml: both are there to be copied.
    """
    if len(line) <= width:
        return line
    margin = line[: len(line) - len(line.lstrip())]
    lines, at = [margin], len(margin)
    for word in _TO_COPY.findall(line):
        blank = " " if len(lines[-1]) > at else ""
        if blank and len(lines[-1]) + 1 + len(word) > width:
            at = len(margin) + 2
            lines.append(" " * at)
            blank = ""
        lines[-1] += blank + word
    return "\n".join(lines)


def show(table: Table) -> None:
    """A table of the result on stdout (stderr with `--json -`); none with --quiet."""
    if not _Loudness.quiet:
        OUT.print(table)


def write_json(path: Path | None, result: dict[str, Any]) -> None:
    from ..results.files import json_text
    from ..results.folder import write_result

    if path == _STANDARD_OUTPUT:
        print(json_text(result), end="")
    elif path is not None:
        write_result(path, json_text(result))


def numerics_of(text: str | None) -> list[str] | None:
    return None if text is None else [part.strip() for part in text.split(",")]


def _version(value: bool) -> None:
    if value:
        typer.echo(f"gyrotc {__version__}")
        raise typer.Exit


@app.callback()
def _main(
    version: Annotated[
        bool, typer.Option("--version", callback=_version, is_eager=True, help="Print the version.")
    ] = False,
    ceilings: Annotated[
        list[str] | None,
        typer.Option(
            "--max",
            metavar="NAME=VALUE",
            callback=lambda texts: set_ceilings(texts or []),
            help="Move a ceiling of inputs, before the command; may be repeated: " + ", ".join(MOVABLE) + ".",
        ),
    ] = None,
    quiet: Annotated[bool, typer.Option("--quiet", "-q", help="Print errors only; also after the command.")] = False,
    verbose: Annotated[
        bool, typer.Option("--verbose", "-v", help="Print every stage with its time on stderr; also after it.")
    ] = False,
) -> None:
    _Loudness.quiet, _Loudness.verbose = quiet, verbose
    OUT.stderr = False  # an earlier command of this process may have had `--json -`


def lot_in(path: Path | None) -> LotPrior | None:
    """The lot of `--lot` as what is known of a unit. Raises as `load_lot`."""
    if path is None:
        return None
    from ..jobs.lot import load_lot  # with what learns one: not for who has none
    from ..train.prior.use import prior_of

    return prior_of(load_lot(path))
