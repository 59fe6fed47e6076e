"""What leaves the laboratory with a unit: its certificate."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from .base import DirArg, OutOption, app, progress, tell


@app.command()
def certificate(
    folder: DirArg,
    out: OutOption,
    facts: Annotated[
        Path | None, typer.Option("--facts", help="What the laboratory states (TOML, docs/certificate.md).")
    ] = None,
    number: Annotated[str | None, typer.Option("--number", help="Number of the certificate.")] = None,
    draft: Annotated[
        bool, typer.Option("--draft", help="Without what is missing: marked as a draft, and no DCC.")
    ] = False,
) -> None:
    """Write a certificate: a page of A4, PDF where Chromium is there, and a digital calibration certificate (DCC XML).
    What is missing for one is listed before anything is written.

    Example: gyrotc certificate result --facts laboratory.toml --number 2026-0042 --out certificate
    """
    from ..jobs.certificate import certificate as run

    with progress() as say:
        say("writing")
        found = run(folder, out, facts=facts, number=number, draft=draft)
    for path in found.files:
        tell(str(path))
    if not found.pdf:
        tell("no PDF: Chromium is not installed or did not print; print certificate.html", wrong=True)
