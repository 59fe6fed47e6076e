"""docs/results/summary.json: the figures that pages of docs/ quote, by campaign. Pages are made from it alone."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from ..store.files import write_atomically

__all__ = ["keep", "recorded"]

_WIDTH = 800  # a record is one line where it has room on it, so that a change of figures reads well


def _path(docs: Path) -> Path:
    return docs / "results" / "summary.json"


def recorded(docs: Path, name: str) -> Any:
    """What a campaign left; None: nothing."""
    path = _path(docs)
    return json.loads(path.read_text("utf-8")).get(name) if path.exists() else None


def keep(docs: Path, name: str, record: Any) -> None:
    """Replaces what the campaign left before; everything else stays."""
    path = _path(docs)
    before = json.loads(path.read_text("utf-8")) if path.exists() else {}
    path.parent.mkdir(parents=True, exist_ok=True)
    write_atomically(path, _text(dict(sorted({**before, name: record}.items()))) + "\n")


def _text(value: Any, indent: int = 0) -> str:
    line = json.dumps(value, ensure_ascii=False)
    if not value or not isinstance(value, (dict, list)) or (indent and len(line) + indent <= _WIDTH):
        return line
    pad = " " * (indent + 1)
    if isinstance(value, dict):
        parts = (f"{json.dumps(k, ensure_ascii=False)}: {_text(v, indent + 1)}" for k, v in value.items())
        return "{\n" + ",\n".join(pad + part for part in parts) + "\n" + pad[1:] + "}"
    return "[\n" + ",\n".join(pad + _text(v, indent + 1) for v in value) + "\n" + pad[1:] + "]"
