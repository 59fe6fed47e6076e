"""The command that works before anything is recorded: `plan`."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import nullcontext
from pathlib import Path
from typing import Annotated

import typer

from ..common.errors import InputError
from ..store.files import write_atomically
from ..store.folder import result_folder
from ..store.jsontext import json_text
from .base import JsonOption, LotOption, SeedOption, app, progress, show, tell, write_json
from .plan_lines import limits_of, pair_of, plan_parts
from .stages import PLAN


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
    lot: LotOption = None,
    unit: Annotated[
        Path | None,
        typer.Option(
            "--unit", help="A result of a unit: which run to record next, by what it is known to lack."
        ),
    ] = None,
    hours: Annotated[
        float, typer.Option("--hours", help="With --unit: no run is proposed that is longer, h.")
    ] = 8.0,
    price_per_hour: Annotated[
        float, typer.Option("--price-per-hour", help="With --unit: of the chamber, in any currency.")
    ] = 1.0,
    price_per_run: Annotated[
        float,
        typer.Option("--price-per-run", help="With --unit: of mounting and settling once, in the same."),
    ] = 1.0,
    out: Annotated[Path | None, typer.Option("--out", help="Folder for plan.json and report.html.")] = None,
    json_file: JsonOption = None,
) -> None:
    """Say what a programmed profile will be able to tell, before it is run; with a lot, the shortest programme.

    Example: gyrotc plan paper --require hysteresis=5e-5 --separate hysteresis,turn_on_offset
    Example: gyrotc plan paper --lot lot.json --require accuracy=2e-4 --out programme
    Example: gyrotc plan paper --unit build/RLG-0042 --price-per-hour 90 --price-per-run 150
    """
    if unit is not None:
        if require:
            raise InputError("--require", ", ".join(require), "with --unit: a price; it proposes one run")
        _next_run(profile, unit, lot, (price_per_hour, price_per_run, hours), out, json_file)
        return
    if lot is not None:
        _plan_with_lot(profile, lot, require or (), out, json_file)
        return
    from ..pages.plan_page import write_plan
    from ..plan.plan import plan as run

    with result_folder(out, "plan") if out else nullcontext() as stage, progress(PLAN) as say:
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


def _next_run(
    scenario: str,
    unit: Path,
    lot: Path | None,
    price: tuple[float, float, float],
    out: Path | None,
    json_file: Path | None,
) -> None:
    """`gyrotc plan --unit`: the run that tells most of a unit for its price, as a file and in words."""
    from ..jobs.recalibration import unit_in
    from ..lot.job import load_lot
    from ..lot.next_run import Price, next_run
    from ..lot.with_lot import programme_csv, programme_text

    with result_folder(out, "plan") if out else nullcontext() as stage:
        model, known, means = unit_in(unit, load_lot(lot) if lot else None)
        result = next_run(model, known, means.sigma_dph, means.mean_s, scenario, Price(*price))
        best = result.proposals[result.best].programme
        if stage:
            write_atomically(stage.folder / "plan.json", json_text(result.content()))
            write_atomically(stage.folder / "programme.csv", programme_csv(best))
            write_atomically(stage.folder / "programme.txt", programme_text(best))
    write_json(json_file, result.content())
    tell(f"{result.serial} as it is known now: {result.before_dph:.3g} deg/h (1 sigma over the envelope)")
    for k, one in enumerate(result.proposals):
        tell(
            f"{one.programme.hours:.1f} h, price {one.price:.4g}: {one.programme.sigma_dph:.3g} deg/h, "
            f"{one.removed_share:.0%} of the variance removed{', most for its price' if k == result.best else ''}"
        )
    for line in programme_text(best).splitlines():
        tell(line)
    if out is not None:
        tell(f"{out / 'programme.csv'}: set points over time")


def _plan_with_lot(
    scenario: str, path: Path, require: Sequence[str], out: Path | None, json_file: Path | None
) -> None:
    """`gyrotc plan --lot`: the shortest chamber programme of an accuracy, as a file and in words."""
    from ..lot.job import load_lot
    from ..lot.with_lot import plan_with_lot, programme_csv, programme_text

    required = limits_of(require)
    if set(required) != {"accuracy"}:
        raise InputError("--require", ", ".join(required) or "nothing", "with --lot: accuracy=... in deg/h")
    with result_folder(out, "plan") if out else nullcontext() as stage:
        result = plan_with_lot(load_lot(path), scenario, required["accuracy"])
        if stage:
            write_atomically(stage.folder / "plan.json", json_text(result.content()))
            write_atomically(stage.folder / "programme.csv", programme_csv(result.with_lot))
            write_atomically(stage.folder / "programme.txt", programme_text(result.with_lot))
    write_json(json_file, result.content())
    tell(f"the lot alone, before any run: {result.before_dph:.3g} deg/h (1 sigma over the envelope)")
    for name, found in (("with the lot", result.with_lot), ("without", result.without)):
        short = "" if found.reached else ", which is all that a day reaches"
        tell(
            f"{name}: {found.hours:.1f} h for {found.sigma_dph:.3g} deg/h, RMS {found.rms_over_floor:.3f} x noise "
            f"floor{short}"
        )
    for line in programme_text(result.with_lot).splitlines():
        tell(line)
    if out is not None:
        tell(f"{out / 'programme.csv'}: set points over time")
