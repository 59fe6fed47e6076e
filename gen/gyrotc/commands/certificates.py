"""What leaves the laboratory with a unit: its certificate, and its correction in other forms."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, cast, get_args

import typer

from ..errors import InputError
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


@app.command()
def export(
    folder: DirArg,
    format: Annotated[str, typer.Option("--format", help="px4, ardupilot, or csv: the map as a table.")],
    out: Annotated[Path, typer.Option("--out", help="The file.")],
    axis_as: Annotated[
        str, typer.Option("--axis-as", help="Axis of the autopilot for a gyro of one axis.")
    ] = "x",
    device: Annotated[int, typer.Option("--device", min=0, help="PX4: CAL_GYRO0_ID of the vehicle.")] = 0,
) -> None:
    """Write the correction in another form: parameters of PX4 (TC_G*) or ArduPilot (INS_TCAL*), or a table.

    Autopilots know a cubic over temperature only: what it loses against the map is told, and stands in the file.

    Example: gyrotc export result --format px4 --out gyro.params
    """
    from ..jobs.export import Format
    from ..jobs.export import export as run

    if format not in get_args(Format):
        raise InputError("--format", repr(format), ", ".join(get_args(Format)))
    for line in run(folder, cast(Format, format), out, axis_as=axis_as, device=device):
        tell(line)
    tell(str(out))
