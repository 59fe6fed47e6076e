"""The subcommands of `gyrotc`, a module for each group; importing a module registers its commands."""

from . import deliver, fleet, jobs, plan, recordings, shell, steps
from .base import app

__all__ = [
    "app",
    "deliver",
    "fleet",
    "jobs",
    "plan",
    "recordings",
    "shell",
    "steps",
]  # fmt: skip
