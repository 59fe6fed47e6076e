"""The subcommands of `gyrotc`, a module for each group; importing a module registers its commands."""

from . import certificates, fleet, importing, jobs, lots, plans, recordings, release, schemas, shell, steps
from .base import app

__all__ = [
    "app", "certificates", "fleet", "importing", "jobs", "lots", "plans", "recordings", "release", "schemas", "shell",
    "steps",
]  # fmt: skip
