"""The command `plan`: options, words and tables."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import nullcontext
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
from rich.box import SIMPLE_HEAD
from rich.table import Table

from ..common.errors import InputError
from ..pages.display import plain, sci, with_unit
from .base import (
    PLAN,
    JsonOption,
    LotOption,
    NoiseLevel,
    SeedOption,
    app,
    progress,
    show,
    tell,
    write_json,
)

if TYPE_CHECKING:
    from ..results.recordings import Additions, DetectionLimit, Plan, Shortest, ThermometerPlace

_NEVER = 90.0  # where two causes overlap wholly d is 100 (`plan.sensitivity`: √(10 / 1e-3))
_ALONE = 3.4  # d at which nothing but detection counts: the rival mimics next to nothing


def limits_of(texts: Sequence[str]) -> dict[str, float]:
    """Reads `cause=limit` options: required detection limits by cause, in the unit of its limit as results hold it.

    Raises:
        InputError: One is not of this form, or of another quantity.
    """
    found = {}
    for text in texts:
        name, _, stated = text.partition("=")
        try:
            found[name.strip()] = float(stated)
        except ValueError:
            raise InputError("--require", repr(text), "cause=limit, e.g. hysteresis=5e-5") from None
        if not found[name.strip()] > 0.0:
            raise InputError("--require", repr(text), "a limit above 0")
    return found


def pair_of(text: str | None) -> tuple[str, str] | None:
    """Reads `cause,cause`: two causes that are to be distinguished.

    Raises:
        InputError: Not two different names.
    """
    if text is None:
        return None
    names = [part.strip() for part in text.split(",")]
    if len(set(names)) != 2 or len(names) != 2:
        raise InputError("--separate", repr(text), "two causes, e.g. hysteresis,turn_on_offset")
    return names[0], names[1]


def plan_parts(result: Plan) -> Iterator[str | Table]:
    """What the command prints, from top to bottom."""
    low, high = result.bias_range_dph
    yield (
        f"{result.scenario}: {len(result.runs)} runs, {result.hours:g} h; "
        f"noise {sci(result.noise.arw_deg_per_sqrt_h)} deg/sqrt(h); "
        f"simulated bias {sci(low)} … {sci(high)} deg/h"
    )
    yield _limits(result)
    for id, why in result.not_testable.items():
        yield f"{id} cannot be tested: {why}"
    yield _separability(result)
    for hard in result.hard_to_separate:
        a, b = hard.pair
        never = " or never" if hard.d > _NEVER else ""
        yield f"{a} and {b} are separated only from d = {hard.d:.0f}{never}; add {hard.add}"
    yield _accuracy(result)
    if result.shortest:
        yield from _shortest(result.shortest)
    if result.additions:
        yield from _additions(result.additions)
    if result.thermometers:
        yield _places(result.thermometers)


def _places(found: Sequence[ThermometerPlace]) -> Table:
    title = "Where a further thermometer would add most"
    table = _table(title, "node", "difference, C", "not seen so far, C", "shows from, deg/h/C")
    for place in found:
        limit = "never" if place.limit_dph_per_c is None else sci(place.limit_dph_per_c, 1)
        name = f"{place.node} (there is one)" if place.there else place.node
        table.add_row(name, sci(place.difference_c), sci(place.unseen_c, 1), limit)
    table.caption = (
        "difference: RMS difference to the gyro's own thermometer; not seen: by map and those that are there"
    )
    table.caption_justify = "left"
    return table


def _table(title: str, *columns: str) -> Table:
    table = Table(title=title, title_justify="left", box=SIMPLE_HEAD, padding=(0, 1, 0, 0))
    for k, name in enumerate(columns):
        table.add_column(name, justify="left" if k == 0 else "right", no_wrap=True)
    return table


def _limits(result: Plan) -> Table:
    table = _table("What these runs will find (95 % of cases)", "cause", "limit", "unit", "over its parameter")
    for entry in result.limits:
        limit = entry.detection_limit
        value = "never" if limit.value is None else sci(limit.value)
        table.add_row(entry.id, value, limit.unit, _over(entry.id, limit))
    return table


def _over(id: str, limit: DetectionLimit) -> str:
    from ..causes import CATALOGUE

    points = limit.over
    if CATALOGUE[id].kind == "input":
        return "shortest that shows in this gyro"
    if not points:
        return ""
    shown = (points[0], points[len(points) // 2], points[-1])
    return f"{limit.parameter}: " + ", ".join(f"{sci(v, 1)} at {sci(p)}" for p, v in shown)


def _separability(result: Plan) -> Table:
    from ..causes import CATALOGUE

    rows = result.separability
    others = [i for i in CATALOGUE if any(i in row.d for row in rows)]
    title = "d at which a cause (row) is separated from another (column); detection itself takes d = 6"
    table = _table(title, "cause", *(CATALOGUE[o].words.short for o in others))
    for row in rows:
        at = "" if row.value is None else f" {sci(row.value)}"
        cells = []
        for o in others:
            d = row.d.get(o)
            cells.append("" if d is None else "." if d < _ALONE else ">30" if d > 30.0 else f"{d:.1f}")
        table.add_row(CATALOGUE[row.id].words.short + at, *cells)
    table.caption = ".: the other cannot mimic it"
    table.caption_justify = "left"
    return table


def _accuracy(result: Plan) -> Table:
    title = "Predicted accuracy of the compensated bias over the whole programme"
    error = "error of the map, deg/h"
    table = _table(title, "after run", "hours", error, "RMS of 100 s means", "over the floor")
    for entry, run in zip(result.accuracy, result.runs, strict=True):
        table.add_row(
            run.profile, f"{entry.hours:g}", sci(entry.map_error_dph, 1), sci(entry.rms_dph),
            f"{entry.rms_over_floor:.3f}",
        )  # fmt: skip
    return table


def _shortest(found: Shortest) -> Iterator[str]:
    from ..causes import CATALOGUE

    wanted, reached = (
        ", ".join(f"{id} {with_unit(value, CATALOGUE[id].unit)}" for id, value in limits.items())
        for limits in (found.required, found.reached)
    )
    if found.runs is None:
        yield f"{wanted}: not reached by any number of these runs"
        return
    counted = {name: found.runs.count(name) for name in found.runs}
    runs = ", ".join(f"{n} x {name}" if n > 1 else name for name, n in counted.items())
    yield f"shortest profile for {wanted}: {found.hours:g} h: {runs} (reaches {reached})"


def _additions(found: Additions) -> Iterator[str]:
    first, *further = found.runs
    yield f"{' and '.join(found.pair)}: separated from d = {first.d:.1f} as it is; with one run more:"
    for run in further[:3]:
        yield f"  {run.profile} ({run.hours:g} h): from d = {run.d:.1f}"


@app.command()
def plan(
    profile: Annotated[str, typer.Argument(help="A built-in scenario (paper, ...) or a scenario file.")],
    noise: Annotated[
        NoiseLevel, typer.Option("--noise", help="paper, or class, where the scenario gives none.")
    ] = NoiseLevel.paper,
    seed: SeedOption = 1,
    require: Annotated[
        list[str] | None,
        typer.Option(
            "--require",
            help="A limit to reach, e.g. warm_up=1e-3 (deg/h) or 'warm_up=3e-4 mdps'; repeatable. "
            "Gives the shortest profile.",
        ),
    ] = None,
    separate: Annotated[
        str | None,
        typer.Option("--separate", help="Two causes, e.g. hysteresis,turn_on_offset: which further run parts them."),
    ] = None,
    add_thermometer: Annotated[
        bool, typer.Option("--add-thermometer", help="Where a further thermometer would add most.")
    ] = False,
    lot: LotOption = None,
    unit: Annotated[
        Path | None,
        typer.Option("--unit", help="A result of a unit: which run to record next, by what it is known to lack."),
    ] = None,
    hours: Annotated[float, typer.Option("--hours", help="With --unit: no run is proposed that is longer, h.")] = 8.0,
    price_per_hour: Annotated[
        float, typer.Option("--price-per-hour", help="With --unit: of the chamber, in any currency.")
    ] = 1.0,
    price_per_run: Annotated[
        float, typer.Option("--price-per-run", help="With --unit: of mounting and settling once, in the same.")
    ] = 1.0,
    out: Annotated[Path | None, typer.Option("--out", help="Folder for plan.json and report.html.")] = None,
    json_file: JsonOption = None,
) -> None:
    """Predict what a programmed profile can detect, before it is run; with a lot, the shortest programme.

    Example: gyrotc plan paper --require hysteresis=5e-5 --separate hysteresis,turn_on_offset
    Example: gyrotc plan paper --lot lot.json --require accuracy=2e-4 --out programme
    Example: gyrotc plan paper --unit build/RLG-0042 --price-per-hour 90 --price-per-run 150
    """
    from ..results.folder import result_folder

    if unit is not None:
        if require:
            raise InputError("--require", ", ".join(require), "with --unit: a price; it proposes one run")
        _next_run(profile, unit, lot, (price_per_hour, price_per_run, hours), out, json_file)
        return
    if lot is not None:
        _plan_with_lot(profile, lot, require or (), out, json_file)
        return
    from ..pages.short import write_plan
    from ..plan.plan import plan as run

    with result_folder(out, "plan") if out else nullcontext() as stage, progress(PLAN) as say:
        result = run(
            profile,
            noise=noise.value,
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
    from ..jobs.lot import load_lot
    from ..jobs.recalibration import unit_in
    from ..lot.planning import Price, next_run, programme_csv, programme_text
    from ..results.files import json_text, write_atomically
    from ..results.folder import result_folder

    with result_folder(out, "plan") if out else nullcontext() as stage:
        model, known, means = unit_in(unit, load_lot(lot) if lot else None)
        result = next_run(model, known, means.sigma_dph, means.mean_s, scenario, Price(*price))
        best = result.proposals[result.best].programme
        if stage:
            write_atomically(stage.folder / "plan.json", json_text(result.content()))
            write_atomically(stage.folder / "programme.csv", programme_csv(best))
            write_atomically(stage.folder / "programme.txt", programme_text(best))
    write_json(json_file, result.content())
    tell(f"{result.serial} as it is known now: {sci(result.before_dph)} deg/h (1 sigma over the envelope)")
    for k, one in enumerate(result.proposals):
        tell(
            f"{one.programme.hours:.1f} h, price {plain(one.price)}: {sci(one.programme.sigma_dph)} deg/h, "
            f"{one.removed_share:.0%} of the variance removed{', most for its price' if k == result.best else ''}"
        )
    for line in programme_text(best).splitlines():
        tell(line)
    if out is not None:
        tell(f"{out / 'programme.csv'}: set points over time")


def _plan_with_lot(scenario: str, path: Path, require: Sequence[str], out: Path | None, json_file: Path | None) -> None:
    """`gyrotc plan --lot`: the shortest chamber programme of an accuracy, as a file and in words."""
    from ..jobs.lot import load_lot
    from ..lot.planning import plan_with_lot, programme_csv, programme_text
    from ..results.files import json_text, write_atomically
    from ..results.folder import result_folder

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
    tell(f"the lot alone, before any run: {sci(result.before_dph)} deg/h (1 sigma over the envelope)")
    for name, found in (("with the lot", result.with_lot), ("without", result.without)):
        short = "" if found.reached else ", which is all that a day reaches"
        tell(
            f"{name}: {found.hours:.1f} h for {sci(found.sigma_dph)} deg/h, "
            f"RMS {found.rms_over_floor:.3f} x noise floor{short}"
        )
    for line in programme_text(result.with_lot).splitlines():
        tell(line)
    if out is not None:
        tell(f"{out / 'programme.csv'}: set points over time")
