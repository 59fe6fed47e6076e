"""Where `evaluate` writes: `evaluate.json` into the result folder, traces there or elsewhere."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path

from ..common.errors import InputError
from ..store.folder import result_folder
from ..store.marker import MARKER

__all__ = ["evaluation_folders"]


@contextmanager
def evaluation_folders(
    folder: Path, trace: Path | None, recordings: Path
) -> Iterator[tuple[Path, Path | None]]:
    """Where to write `evaluate.json` and the traces, so that both take their places when the block ends well.

    Args:
        folder: The result folder, which gets `evaluate.json`.
        trace: Folder for the traces: inside it, elsewhere, or None.
        recordings: The data set; the traces are not written into it.

    Raises:
        InputError: As `result_folder`; or the traces would take the place of another part of the result.
    """
    inside = _inside(folder, trace)
    entries = ("evaluate.json", *([inside.parts[0]] if inside else []))
    with ExitStack() as stack:
        stage = stack.enter_context(result_folder(folder, "evaluate", entries=entries))
        if trace is None or inside:
            yield stage.folder, stage.folder / inside if inside else None
            return
        traces = result_folder(trace, "evaluate", kind="trace", inputs=[recordings])
        yield stage.folder, stack.enter_context(traces).folder


def _inside(folder: Path, trace: Path | None) -> Path | None:
    """The folder of traces by its path in the result folder; None where it lies elsewhere."""
    if trace is None or folder.resolve() not in (trace.resolve(), *trace.resolve().parents):
        return None
    inside = trace.resolve().relative_to(folder.resolve())
    if not inside.parts or any((folder / inside.parts[0] / name).exists() for name in ("gtc.h", MARKER)):
        raise InputError("--trace", f"{trace} is part of the result already", str(folder / "trace"))
    return inside
