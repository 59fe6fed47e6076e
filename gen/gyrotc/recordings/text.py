"""`dataset.toml` and its like as text."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from ..common.texts import toml_key, toml_value

__all__ = ["dataset_toml"]


def dataset_toml(
    head: Mapping[str, Any], tables: Mapping[str, Any], runs: Sequence[Mapping[str, Any]] = ()
) -> str:
    """`dataset.toml` as text: keys of the head, tables of plain values (a list: one table each), then the runs."""
    lines = [*_pairs(head)]
    for name, table in tables.items():
        for one in table if isinstance(table, list | tuple) else ():
            lines += ["", f"[[{toml_key(name)}]]", *_pairs(one)]
        if isinstance(table, Mapping):
            lines += ["", f"[{toml_key(name)}]", *_pairs(table)]
    for run in runs:
        lines += ["", "[[run]]", *_pairs(run)]
    return "\n".join(lines) + "\n"


def _pairs(table: Mapping[str, Any]) -> list[str]:
    return [f"{toml_key(key)} = {toml_value(value)}" for key, value in table.items()]
