"""The command that works before anything is recorded: `plan`."""

from __future__ import annotations

from contextlib import nullcontext
from pathlib import Path
from typing import Annotated

import typer

from ..outputs import result_folder
from .base import JsonOption, SeedOption, app, progress, show, tell, write_json
from .plan_lines import limits_of, pair_of, plan_parts


@app.command()
def plan(
    profile: Annotated[str, typer.Argument(help="A built-in scenario (paper, ...) or a scenario file.")],
    noise: Annotated[
        str, typer.Option("--noise", help="paper, or class, where the scenario gives none.")
    ] = "paper",
    seed: SeedOption = 1,
    require: Annotated[
        list[str] | None,
        typer.Option(
            "--require",
            help="A limit to reach, e.g. hysteresis=5e-5; repeatable. Gives the shortest profile.",
        ),
    ] = None,
    separate: Annotated[
        str | None,
        typer.Option(
            "--separate", help="Two causes, e.g. hysteresis,turn_on_offset: which further run parts them."
        ),
    ] = None,
    add_thermometer: Annotated[
        bool, typer.Option("--add-thermometer", help="Where a further thermometer would tell most.")
    ] = False,
    out: Annotated[Path | None, typer.Option("--out", help="Folder for plan.json and report.html.")] = None,
    json_file: JsonOption = None,
) -> None:
    """Say what a programmed profile will be able to tell, before it is run.

    Example: gyrotc plan paper --require hysteresis=5e-5 --separate hysteresis,turn_on_offset
    """
    from ..pages.plan_page import write_plan
    from ..plan import plan as run

    with result_folder(out, "plan") if out else nullcontext() as stage, progress() as say:
        result = run(
            profile,
            noise=noise,  # type: ignore[arg-type]
            seed=seed,
            required=limits_of(require or ()),
            pair=pair_of(separate),
            add_thermometer=add_thermometer,
            progress=say,
        )
        if stage:
            write_plan(stage.folder, result)
    write_json(json_file, result.content())
    for part in plan_parts(result):
        if isinstance(part, str):
            tell(part)
        else:
            show(part)
    if out is not None:
        tell(f"report: {out / 'report.html'}")
