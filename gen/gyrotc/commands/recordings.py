"""Commands about recordings: make them, check them."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from .base import (
    AppliedOption,
    AxisOption,
    DatasetArg,
    JsonOption,
    OutOption,
    SeedOption,
    TrustUnitsOption,
    app,
    progress,
    tell,
    write_json,
    written_place,
)


@app.command()
def simulate(
    scenario: Annotated[str, typer.Argument(help="A built-in scenario (paper, ...) or a scenario file.")],
    out: OutOption,
    seed: SeedOption = 1,
    row_s: Annotated[float, typer.Option("--row-s", help="Length of a row, s.")] = 10.0,
    raw_hz: Annotated[
        float | None, typer.Option("--raw-hz", help="Write rows at this rate instead, Hz.")
    ] = None,
    pulses: Annotated[bool, typer.Option("--pulses", help="Write integer pulses instead of a rate.")] = False,
    format: Annotated[str, typer.Option("--format", help="Format of the files: csv or parquet.")] = "csv",
    noise: Annotated[
        str, typer.Option("--noise", help="paper, or class (a typical 0.008 deg/h unit).")
    ] = "paper",
) -> None:
    """Make a data set from the physical simulation, and truth.json beside it.

    Example: gyrotc simulate paper --seed 1 --out demo-data
    """
    from ..simulate import simulate as run

    with progress() as say:
        run(
            scenario,
            seed=seed,
            out=out,
            row_s=row_s,
            raw_hz=raw_hz,
            pulses=pulses,
            format=format,  # type: ignore[arg-type]
            noise=noise,  # type: ignore[arg-type]
            progress=lambda share: say(f"simulating {share:.0%}"),
        )
    tell(f"{out}: data set of scenario {scenario}, seed {seed}")


@app.command()
def check(
    dataset: DatasetArg,
    axis: AxisOption = None,
    envelope: Annotated[
        str | None,
        typer.Option("--envelope", help="What training should cover, C and C/min, e.g. -40:60,-5:5."),
    ] = None,
    applied: AppliedOption = None,
    trust_units: TrustUnitsOption = False,
    previous: Annotated[
        Path | None,
        typer.Option("--previous", help="An earlier result of this gyro: are sign and axes as they were?"),
    ] = None,
    plots: Annotated[
        Path | None,
        typer.Option(
            "--plots", callback=written_place, help="Write a page with a picture of every finding here."
        ),
    ] = None,
    json_file: JsonOption = None,
) -> None:
    """Tell everything that is wrong or doubtful about recordings, at once; also while they still grow.

    Example: gyrotc check recordings --plots check.html
    """
    from ..judge.changes import earlier_models
    from ..judge.check import check as run
    from ..judge.check import envelope_of
    from ..quantise.applied import applied_of

    result = run(
        dataset,
        axis=axis,
        envelope=envelope_of(envelope) if envelope is not None else None,
        applied=applied_of(applied) if applied else None,
        trust_units=trust_units,
        earlier=earlier_models(previous) if previous else None,
    )
    if plots is not None:
        from ..pages.check_page import write_check_page

        write_check_page(plots, dataset, result)
    write_json(json_file, result.result().content())
    for line in result.lines():
        tell(line, wrong=bool(result.problems))
    if result.problems:
        raise typer.Exit(2)
