"""The command `schema`: forms of the results, as JSON Schema or as tables."""

from __future__ import annotations

import functools
import json
import types
from collections.abc import Collection, Iterator
from typing import TYPE_CHECKING, Annotated, Any, Literal, Union, get_args, get_origin

import typer

from ..common.errors import InputError, quoted
from .application import app

if TYPE_CHECKING:
    from pydantic import BaseModel


@app.command()
def schema(
    name: Annotated[str | None, typer.Argument(help="A result, e.g. limits; without it all, by name.")] = None,
    table: Annotated[
        bool, typer.Option("--table", help="Fields, types and what they mean, as tables in Markdown.")
    ] = False,
) -> None:
    """Print the JSON Schema of a result, or of all of them.

    Example: gyrotc schema limits
    """
    known = kinds()
    if name is not None and name not in known:
        raise InputError("schema", quoted(name), ", ".join(known))
    if name is not None:
        typer.echo(tables(known[name]) if table else schema_text(known[name]), nl=False)
    elif table:
        typer.echo("\n".join(f"## {title}\n\n{tables(kind)}" for title, kind in known.items()), nl=False)
    else:
        whole = {title: json.loads(schema_text(kind)) for title, kind in known.items()}
        typer.echo(json.dumps(whole, indent=1))


@functools.cache
def kinds() -> dict[str, type[BaseModel]]:
    """Every file and output by the name that `gyrotc schema` knows; imported when asked for, as help needs none."""
    from ..model import Model
    from ..results.diagnosed import Diagnosed, DiagnosisSeries
    from ..results.evaluation import Changes, Comparison, Evaluation
    from ..results.fleet import FleetEntry, FleetSummary, Lot
    from ..results.recordings import Checked, ImportedFiles, SimulatedTruth
    from ..results.release import Budget, HeldLimits, JointVerification, MapOnGrid, Verification
    from ..results.training import Manifest, Training
    from ..tables.record import EmissionRecord

    return {
        "budget": Budget,
        "changes": Changes,
        "check": Checked,
        "compare": Comparison,
        "diagnose": Diagnosed,
        "diagnosis-series": DiagnosisSeries,
        "emission": EmissionRecord,
        "entry": FleetEntry,
        "evaluate": Evaluation,
        "fleet": FleetSummary,
        "import": ImportedFiles,
        "limits": HeldLimits,
        "lot": Lot,
        "manifest": Manifest,
        "map": MapOnGrid,
        "model": Model,
        "training": Training,
        "truth": SimulatedTruth,
        "verify-axes": JointVerification,
        "verify": Verification,
    }


_PLAIN = {str: "text", int: "integer", float: "number", bool: "true or false", type(None): "null", Any: "any"}


def schema_text(kind: type[BaseModel]) -> str:
    """JSON Schema of a result, as `gyrotc schema` prints it."""
    return json.dumps(kind.model_json_schema(by_alias=True), indent=1, ensure_ascii=True) + "\n"


def tables(kind: type[BaseModel], shown: Collection[type[BaseModel]] = ()) -> str:
    """A table of fields for a result, and one for each object inside it, in Markdown.

    Args:
        shown: Results whose tables stand on the same page: their objects are not reported again.
    """
    seen: dict[type[BaseModel], None] = {kind: None}
    above = {inner for one in shown for inner in _in_order({one: None})}
    parts = []
    for one in (one for one in _in_order(seen) if one not in above):
        text = (one.__doc__ or "").strip().splitlines()[0]
        head = "" if one is kind else f"`{_name(one)}`: {text[0].lower() + text[1:]}\n\n"
        rows = []
        for name, field in one.model_fields.items():
            absent = "" if field.is_required() or name == "schema_" else "; may be absent"
            meaning = (field.description or "").replace("|", "\\|")
            rows.append(f"| `{field.alias or name}` | {_type(field.annotation)}{absent} | {meaning} |")
        parts.append(head + "\n".join(["| field | type | meaning |", "| --- | --- | --- |", *rows]) + "\n")
    return "\n".join(parts)


def _in_order(seen: dict[type[BaseModel], None]) -> Iterator[type[BaseModel]]:
    """The classes of `seen`, and then those that their fields hold, each once."""
    waiting = list(seen)
    while waiting:
        one = waiting.pop(0)
        yield one
        for field in one.model_fields.values():
            for inner in _inside(field.annotation):
                if inner not in seen:
                    seen[inner] = None
                    waiting.append(inner)


def _inside(kind: Any) -> Iterator[type[BaseModel]]:
    if isinstance(kind, type) and hasattr(kind, "model_fields"):
        yield kind
    for part in get_args(kind) if get_origin(kind) is not Literal else ():
        yield from _inside(part)


def _name(kind: type[BaseModel]) -> str:
    return kind.__name__.lstrip("_")


def _type(kind: Any) -> str:
    origin, inner = get_origin(kind), get_args(kind)
    if origin is Annotated:
        return _type(inner[0])
    if origin is Literal:
        return ", ".join(f'`"{v}"`' for v in inner)
    if origin in (Union, types.UnionType):
        return " or ".join(dict.fromkeys(_type(part) for part in inner))
    if origin is dict:
        return f"object of {_type(inner[1])} by name"
    if origin is tuple:
        if inner[-1] is Ellipsis:
            return f"list of {_type(inner[0])}"
        return "[" + ", ".join(_type(part) for part in inner) + "]"
    if origin is list:
        return f"list of {_type(inner[0])}"
    if isinstance(kind, type) and hasattr(kind, "model_fields"):
        return f"`{_name(kind)}`"
    return _PLAIN.get(kind, "any")
