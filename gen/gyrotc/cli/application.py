"""Define the application: its commands in groups, and the options of the whole program."""

from __future__ import annotations

from typing import Annotated, Any

import typer
from typer.core import TyperGroup

from .. import __version__
from ..common.inputs import MOVABLE, set_ceilings
from .output import OUT, Loudness

GROUPS = {
    "Record": ("simulate", "import", "check"),
    "Calibrate": ("build", "diagnose", "compare", "fit", "emit"),
    "Judge": ("evaluate", "verify", "report"),
    "Many units": ("fleet", "lot"),
    "Share": ("certificate",),
    "Forms": ("schema",),
}
"""Names of commands by what a user does; a test holds that each stands once."""
INSTEAD = {
    "catalogue": "fleet.csv has what a register of calibrations needs",
    "export": "gyrotc emit --map writes the map as CSV or JSON",
    "plan": "gyrotc simulate makes recordings of a profile, and gyrotc diagnose says what they show",
    "recalibrate": "gyrotc build --prior confirms an earlier result by a check run",
    "sign": "any signing tool signs the hashes of a result folder",
    "stamp": "gyrotc build makes a changed model again",
}
"""What to do instead of a command that other versions have."""
_WHOLE = 1000  # characters: more than the first sentence of any command


class GroupedCommands(TyperGroup):
    """A group of commands whose help has a list for each step of the work."""

    def format_commands(self, ctx: Any, formatter: Any) -> None:
        """Write the lists, with the whole first sentence of each command."""
        for title, names in GROUPS.items():
            with formatter.section(title):
                formatter.write_dl([(name, self.commands[name].get_short_help_str(_WHOLE)) for name in names])

    def resolve_command(self, ctx: Any, args: list[str]) -> Any:
        """Find a command; name what does the work of one that there is not."""
        if args and args[0] in INSTEAD:
            ctx.fail(f"There is no command {args[0]}: {INSTEAD[args[0]]}.")
        return super().resolve_command(ctx, args)


app = typer.Typer(
    name="gyrotc",
    cls=GroupedCommands,
    help="From thermal-chamber recordings of a gyro to verified C tables that compensate its bias.",
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
)


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
            help="Move a ceiling of inputs, also after the command; may be repeated: " + ", ".join(MOVABLE) + ".",
        ),
    ] = None,
    quiet: Annotated[bool, typer.Option("--quiet", "-q", help="Print errors only; also after the command.")] = False,
    verbose: Annotated[
        bool, typer.Option("--verbose", "-v", help="Print every stage with its time on stderr; also after it.")
    ] = False,
) -> None:
    Loudness.quiet, Loudness.verbose = quiet, verbose
    OUT.stderr = False  # an earlier command of this process may have had `--json -`
