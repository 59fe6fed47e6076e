"""Reduce files to what is compared: their content without what may differ between two runs of the same program."""

from __future__ import annotations

import hashlib
import json
import re
from pathlib import Path
from typing import Any

#: Fields of JSON results that are left out, with the reason.
DROPPED = {
    "gyrotc_version": "changes with each release, not with a result",
    "versions": "of Python, of libraries and of compilers on this machine",
    "program": "a hash of gyrotc's source files, which every refactoring changes",
    "key": "of a unit of a fleet: a hash of all that its result depends on, gyrotc's source files among it",
    "seconds": "how long training took here",
    "train_s": "likewise",
    "compiler": "name and version of the compiler on this machine",
    "rom_bytes": "decided by the compiler",
    "ram_bytes": "decided by the compiler",
    "code_bytes": "decided by the compiler",
    "read_only_bytes": "decided by the compiler",
    "stack_bytes": "decided by the compiler",
    "step_stack_bytes": "decided by the compiler",
    "functions": "code and stack of each function, decided by the compiler",
}
#: Of these fields, which hold a hash for each file, the names of the files stay. The files themselves are compared.
NAMES_ALONE = ("files",)
#: Files of which only the name is compared.
UNREAD = {
    ".svg": "coordinates, rounded; the figures in it stand in the JSON results",
    ".png": "likewise",
}
#: What replaces parts of pages and certificates, with the reason.
OF_PAGES = (
    (re.compile(r"<svg.*?</svg>", re.DOTALL), "<svg/>"),  # as above
    (re.compile(r"data:image/[^\"')]*"), "data:image"),  # likewise
    (
        re.compile(r'(<td class="pass">pass</td>).*'),
        r"\1",
    ),  # version of the compiler, code and stack that it made
    (re.compile(r"(<td>made with</td>).*"), r"\1"),  # versions of Python and of libraries
    (
        re.compile(r'(program</th><td class="mono">|program SHA-256 )\w+'),
        r"\1",
    ),  # changes with every refactoring
)


def digest_of(data: bytes) -> str:
    """The first 12 hexadecimal digits of SHA-256: with a thousand files two are alike by chance once in 10^9."""
    return hashlib.sha256(data).hexdigest()[:12]


def content_of(path: Path) -> Any:
    """Return what is compared of a file, as JSON: a document, columns of a table, lines of a text, or a hash."""
    if path.suffix in UNREAD:
        return "not read"
    data = path.read_bytes()
    if path.suffix == ".json":
        return _of_json(data)
    if path.suffix == ".parquet" and (table := _of_parquet(path)) is not None:
        return table
    try:
        text = data.decode("utf-8")
    except UnicodeDecodeError:
        return f"{len(data)} bytes {digest_of(data)}"
    if path.suffix in (".html", ".xml"):
        for pattern, replacement in OF_PAGES:
            text = pattern.sub(replacement, text)
    return text.split("\n")


def _of_json(data: bytes) -> dict[str, Any]:
    """The document, and a hash that shows what the document does not: order of keys, and bytes where all were kept."""
    document = json.loads(data)
    kept = _kept(document)
    whole = data if kept == document else json.dumps(kept).encode()
    return {"sha256": digest_of(whole), "document": kept}


def _kept(value: Any) -> Any:
    if isinstance(value, dict):
        return {
            name: sorted(part) if name in NAMES_ALONE and isinstance(part, dict) else _kept(part)
            for name, part in value.items()
            if name not in DROPPED
        }
    return [_kept(part) for part in value] if isinstance(value, list) else value


def _of_parquet(path: Path) -> Any:
    """Columns and their values: the bytes name Arrow's release, and it compresses as it likes; None: not readable."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    try:
        table = pq.read_table(path)
    except (pa.ArrowException, OSError):
        return None
    columns = {f"{field.name} ({field.type})": table.column(field.name).to_pylist() for field in table.schema}
    return json.loads(json.dumps(columns, default=str))  # stamps of time as texts
