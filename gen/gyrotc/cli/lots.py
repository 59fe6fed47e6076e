"""`gyrotc lot`: what units of one type share."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from ..store.folder import write_result
from ..store.jsontext import json_text
from .base import app, progress, tell, written_place
from .stages import LOT


@app.command()
def lot(
    fleet: Annotated[
        Path, typer.Argument(help="The folder that gyrotc fleet wrote: fully calibrated units.")
    ],
    out: Annotated[Path, typer.Option("--out", callback=written_place, help="File for the lot.")],
    axis: Annotated[
        str | None,
        typer.Option("--axis", help="x, y or z of three-axis gyros: each axis is a lot of its own."),
    ] = None,
) -> None:
    """Learn what units of one type share, so that the next ones need fewer runs (build --lot).

    Example: gyrotc lot fleet --out lot.json
    """
    from ..lot.job import lot_of

    with progress(LOT) as say:
        found = lot_of(fleet, axis=axis, progress=say)
    write_result(out, json_text(found.content()))
    checked = found.cross_validation
    tell(f"{out}: {found.told}")
    tell(
        f"a new unit, before any run: {checked.left_rms_dph:.3g} deg/h about the lot's map, "
        f"{checked.constant_rms_dph:.3g} about its own mean"
    )
