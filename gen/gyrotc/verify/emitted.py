"""The emitted files themselves: their identity, and the answers and images that must follow from the model."""

from __future__ import annotations

import hashlib
from pathlib import Path
from typing import Any

import numpy as np

from ..emit import answers_text
from .board import Job

__all__ = ["c_hash", "check_emitted"]


def c_hash(c_folder: Path) -> str:
    """SHA-256 over names and contents of the emitted files."""
    digest = hashlib.sha256()
    for path in sorted(p for p in c_folder.iterdir() if p.is_file()):
        digest.update(f"{path.name} {hashlib.sha256(path.read_bytes()).hexdigest()}\n".encode())
    return digest.hexdigest()


def check_emitted(job: Job) -> list[dict[str, Any]]:
    """The emitted answers and images against the reference and the tables: one entry for each file."""
    found = {f"vectors_{job.model.id}.txt": _wrong_answers(job)}
    for k, table in enumerate(job.tables.values()):
        suffix = "" if k == 0 else f"_{table.numeric}"
        name = f"gtc_{job.model.id}{suffix}.bin"
        found[name] = _wrong_words(job.c_folder / name, table.words)
    return [{"file": f, "status": "fail" if n else "pass", "mismatches": n} for f, n in found.items()]


def _wrong_answers(job: Job) -> int:
    path = job.c_folder / f"vectors_{job.model.id}.txt"
    data, expected = path.read_bytes() if path.is_file() else b"", answers_text(job.expected)
    if data == expected:
        return 0
    lines, right = data.splitlines(), expected.splitlines()
    differing = sum(a != b for a, b in zip(lines, right, strict=False))
    return max(1, differing + abs(len(lines) - len(right)))


def _wrong_words(path: Path, words: list[int]) -> int:
    data = path.read_bytes() if path.is_file() else b""
    got = np.frombuffer(data[: len(data) // 4 * 4], dtype="<u4")
    if len(data) != 4 * len(words):
        return max(1, abs(got.size - len(words)))
    return int(np.count_nonzero(got != np.array(words, dtype=np.uint32)))
