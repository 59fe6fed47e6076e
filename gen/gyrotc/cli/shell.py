"""What concerns the user's own machine: completion of a shell, the cache, forms of the results."""

from __future__ import annotations

import json
from typing import Annotated

import typer

from ..common.errors import InputError
from .base import app, tell
from .words import Shell


@app.command()
def schema(
    name: Annotated[str | None, typer.Argument(help="A result, e.g. limits; without it all, by name.")] = None,
    table: Annotated[
        bool, typer.Option("--table", help="Fields, types and what they mean, as tables in Markdown.")
    ] = False,
) -> None:
    """Print the JSON Schema of a result, or of all of them.

    Example: gyrotc schema limits
    """
    from .schemas import KINDS, schema_text, tables

    if name is not None and name not in KINDS:
        raise InputError("schema", repr(name), ", ".join(KINDS))
    if name is not None:
        typer.echo(tables(KINDS[name]) if table else schema_text(KINDS[name]), nl=False)
    elif table:
        typer.echo("\n".join(f"## {known}\n\n{tables(kind)}" for known, kind in KINDS.items()), nl=False)
    else:
        whole = {known: json.loads(schema_text(kind)) for known, kind in KINDS.items()}
        typer.echo(json.dumps(whole, indent=1))


@app.command()
def completion(shell: Annotated[Shell, typer.Argument(help="The shell.")]) -> None:
    """A script that completes commands and options in a shell, on stdout.

    Example: gyrotc completion bash > ~/.local/share/bash-completion/completions/gyrotc
    """
    from typer._completion_shared import get_completion_script

    typer.echo(get_completion_script(prog_name="gyrotc", complete_var="_GYROTC_COMPLETE", shell=shell.value))


@app.command()
def cache(
    clear: Annotated[bool, typer.Option("--clear", help="Remove all of it.")] = False,
    limit_gb: Annotated[
        float | None,
        typer.Option("--limit", min=0.0, max=1e6, help="Most GB that it may take, from now on; default 2."),
    ] = None,
) -> None:
    """What gyrotc keeps between calls (diagnoses, compiled runtimes): where, how much, and how much it may be.

    Example: gyrotc cache --limit 0.5
    """
    from ..store import cache as kept

    if limit_gb is not None:
        kept.set_limit(round(limit_gb * 1e9))
    if clear:
        kept.clear()
    (banks, _), (diagnoses, _), (objects, _) = (kept.held(kind) for kind in ("bank", "diagnosis", "object"))
    counted = f"{banks} banks of signatures, {diagnoses} diagnoses, {objects} objects of compilers"
    _, size = kept.held()
    tell(f"{kept.folder()}: {counted}, {size / 1e9:.3f} GB of at most {kept.limit() / 1e9:g} GB")
