"""Commands about recordings: make them, check them."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer

from ..common.errors import InputError
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
    scenario: Annotated[
        str, typer.Argument(help="A built-in scenario (paper, ...), a scenario file, or lot: a lot of gyros.")
    ],
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
    units: Annotated[
        int | None, typer.Option("--units", help="Of a lot: number of gyros, a data set each.")
    ] = None,
    family: Annotated[
        float | None,
        typer.Option("--family", help="Of a lot: how much units share, 0 (nothing) ... 1; default 0.9."),
    ] = None,
    clusters: Annotated[
        int | None, typer.Option("--clusters", help="Of a lot: groups with a center each; default 1.")
    ] = None,
    strangers: Annotated[
        int | None, typer.Option("--strangers", help="Of a lot: units that belong to none; default 0.")
    ] = None,
    base: Annotated[
        str | None, typer.Option("--base", help="Of a lot: the scenario that its units run; default paper.")
    ] = None,
) -> None:
    """Make a data set from the physical simulation, and truth.json beside it; or a lot of gyros, a data set each.

    Example: gyrotc simulate paper --seed 1 --out demo-data
    Example: gyrotc simulate lot --units 60 --family 0.94 --seed 1 --out lot-data
    """
    from ..simulate.campaign import simulate as run

    of_lot = {"units": units, "family": family, "clusters": clusters, "strangers": strangers}
    given = {name: value for name, value in of_lot.items() if value is not None}
    if scenario == "lot":
        _simulate_lot(given, base or "paper", seed, out, (row_s, raw_hz, pulses, format), noise)
        return
    if given or base:
        raise InputError(f"--{next(iter(given), 'base')}", "is an option of lots", "gyrotc simulate lot")
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


def _simulate_lot(
    given: dict[str, Any],
    base: str,
    seed: int,
    out: Path,
    rows: tuple[float, float | None, bool, str],
    noise: str,
) -> None:
    """`gyrotc simulate lot`."""
    from ..simulate.campaign import RowForm
    from ..simulate.lot import LotOrder, simulate_lot

    if "units" not in given:
        raise InputError("--units", "is missing", "the number of gyros of the lot")
    order = LotOrder(**given)
    with progress() as say:
        simulate_lot(
            order,
            seed=seed,
            out=out,
            scenario=base,
            form=RowForm.of(*rows),  # type: ignore[arg-type]
            noise=noise,  # type: ignore[arg-type]
            progress=lambda share: say(f"simulating {share:.0%}"),
        )
    tell(f"{out}: {order.units} data sets of scenario {base}, family {order.family:g}, seed {seed}")


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
    from ..assess.changes import earlier_models
    from ..quality.check import check as run
    from ..quality.check import envelope_of
    from ..tables.applied import applied_of

    with progress() as say:
        result = run(
            dataset,
            axis=axis,
            envelope=envelope_of(envelope) if envelope is not None else None,
            applied=applied_of(applied) if applied else None,
            trust_units=trust_units,
            earlier=earlier_models(previous) if previous else None,
            progress=say,
        )
        if plots is not None:
            from ..pages.check_page import write_check_page

            say("drawing")
            write_check_page(plots, dataset, result)
    write_json(json_file, result.result().content())
    for line in result.lines():
        tell(line, wrong=bool(result.problems))
    if result.problems:
        raise typer.Exit(2)
