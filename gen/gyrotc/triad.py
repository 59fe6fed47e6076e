"""Three axes of one unit in one image: the runtime once, a table for each axis, one page for all."""

from __future__ import annotations

import shutil
import tempfile
from collections.abc import Sequence
from pathlib import Path

from .emit import emitted_tables
from .errors import CheckFailed
from .model import load_model, write_atomically
from .report import page_environment
from .stored import read_result
from .texts import c_environment
from .toolchain import all_targets, compile_c, run_program

__all__ = ["join_axes"]

_HOST = "host-gcc-O2"


def join_axes(folder: Path, axes: Sequence[str]) -> None:
    """Fills `folder/c` and `folder/report.html` from `folder/<axis>`.

    Proves that all tables link and pass their self-tests in one image.

    Raises:
        CheckFailed: The image does not link, or a table does not pass its self-test in it.
    """
    models = [load_model(folder / axis / "model.json") for axis in axes]
    numerics = list(emitted_tables(folder / axes[0] / "c", models[0]))
    c = folder / "c"
    c.mkdir()
    for axis, model in zip(axes, models, strict=True):
        source = folder / axis / "c"
        for name in ("gtc.h", "gtc.c"):
            shutil.copyfile(source / name, c / name)
        for path in [*source.glob(f"gtc_{model.id}*"), *source.glob(f"vectors_{model.id}.*")]:
            shutil.copyfile(path, c / path.name)
    main = c_environment().get_template("main_axes.c.j2").render(models=models, n=numerics[0])
    (c / "main.c").write_text(main, encoding="ascii")
    _run_together(c, [m.id for m in models])
    results = [read_result(folder / axis / "evaluate.json", "evaluate") for axis in axes]
    text = page_environment().get_template("axes.html.j2").render(models=models, results=results)
    write_atomically(folder / "report.html", text)


def _run_together(c: Path, ids: Sequence[str]) -> None:
    target = all_targets()[_HOST]
    with tempfile.TemporaryDirectory(prefix="gyrotc-") as work:
        program = Path(work) / "main"
        compile_c(
            target, [c / n for n in ("main.c", "gtc.c", *(f"gtc_{i}.c" for i in ids))], program, include=c
        )
        done = run_program(target, program)
    if done.returncode != 0:
        raise CheckFailed(f"the image of all axes ended with status {done.returncode}")
