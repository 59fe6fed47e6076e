"""Emitted tables before tools/check_table.py, which computes them again without gyrotc."""

from __future__ import annotations

import contextlib
import io
import runpy
import subprocess
from pathlib import Path
from unittest import mock

from conftest import ROOT
from gyrotc.model import Model
from models import bank_of, random_model, random_terms

SCRIPT = ROOT / "tools" / "check_table.py"


def checked(folder: Path, *answers: Path) -> subprocess.CompletedProcess[str]:
    """Run the tool on a folder, and the answers of its board test if given, in this process."""
    out, err = io.StringIO(), io.StringIO()
    main = runpy.run_path(str(SCRIPT))["main"]
    with (
        mock.patch("sys.argv", [str(SCRIPT), str(folder), *map(str, answers)]),
        contextlib.redirect_stdout(out),
        contextlib.redirect_stderr(err),
    ):
        status = main()
    return subprocess.CompletedProcess([], status, out.getvalue(), err.getvalue())


def extended(seed: int) -> Model:
    """A bank of three networks with terms; seeds 2 and 3 have every kind among them."""
    return bank_of(random_model(seed, terms=random_terms(seed)))
