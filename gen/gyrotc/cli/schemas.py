"""Forms of the results: `gyrotc schema`."""

from __future__ import annotations

import json
from importlib import resources
from typing import Annotated

import typer

from ..common.errors import InputError
from .base import app


@app.command()
def schema(
    name: Annotated[
        str | None, typer.Argument(help="A result, e.g. limits; without it all, by name.")
    ] = None,
) -> None:
    """Print the JSON Schema of a result, or of all of them.

    Example: gyrotc schema limits
    """
    shipped = resources.files("gyrotc.results") / "schemas"
    texts = {
        file.name.removesuffix(".json"): file.read_text("utf-8")
        for file in sorted(shipped.iterdir(), key=lambda file: file.name)
        if file.name.endswith(".json")
    }
    if name is None:
        whole = {known: json.loads(text) for known, text in texts.items()}
        typer.echo(json.dumps(whole, indent=1))
    elif name in texts:
        typer.echo(texts[name], nl=False)
    else:
        raise InputError("schema", repr(name), ", ".join(texts))
