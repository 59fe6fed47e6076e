"""The command `certificate`, for what leaves the laboratory."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from .application import app
from .options import AcceptOption, DirArg, OutOption
from .output import tell
from .progress import progress


@app.command()
def certificate(
    folder: DirArg,
    out: OutOption,
    facts: Annotated[
        Path | None,
        typer.Option(
            "--facts", help="Facts of the laboratory (TOML, docs/delivery.md); default: [meta] of the data set."
        ),
    ] = None,
    number: Annotated[
        str | None, typer.Option("--number", help="Number of the certificate; default: that of the facts.")
    ] = None,
    draft: Annotated[
        bool, typer.Option("--draft", help="Write a draft without the missing facts and without a DCC.")
    ] = False,
    accept_fail: AcceptOption = None,
) -> None:
    """Write a certificate: a page of A4, PDF and DCC XML.

    The PDF needs Chromium. What is missing for a certificate is listed before anything is written.

    Example: gyrotc certificate result --facts lab.toml --number 7 --out DIR
    """
    from ..jobs.certification import certificate as run

    with progress() as say:
        say("writing")
        found = run(folder, out, facts=facts, number=number, draft=draft, accept_fail=accept_fail)
    for path in found.files:
        tell(str(path))
    if not found.pdf:
        tell("no PDF: Chromium is not installed or did not print; print certificate.html", wrong=True)
