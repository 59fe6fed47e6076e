"""The list of commands in the order of the work, for `gyrotc --help`."""

from __future__ import annotations

from typing import Any

from typer.core import TyperGroup

GROUPS = {
    "Record": ("plan", "simulate", "import", "check"),
    "Calibrate": ("build", "diagnose", "compare", "fit", "emit"),
    "Judge": ("evaluate", "verify", "report"),
    "Many units": ("fleet", "catalogue", "lot"),
    "Share": ("certificate", "sign", "export", "stamp"),
    "This machine": ("completion", "cache", "schema"),
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
