"""tools/check_table.py: agrees with what is emitted, and sees every seeded fault of quantisation.

The faulty tables are emitted whole (checksums, known answers, images follow the fault), so that nothing
but the model can tell.
"""

from __future__ import annotations

import ast
import subprocess
import sys
from pathlib import Path

import pytest
from checked_tables import SCRIPT, checked, extended
from emitted import GOLDEN, board_folder, emitted
from gyrotc.model import load_model
from models import random_model


def _check_alone(folder: Path, board: Path) -> subprocess.CompletedProcess[str]:
    """Without site packages, so that nothing of gyrotc can be imported."""
    command = [sys.executable, "-I", "-S", str(SCRIPT), str(folder), str(board)]
    return subprocess.run(command, capture_output=True, text=True, check=False)


def test_it_imports_the_standard_library_only() -> None:
    tree = ast.parse(SCRIPT.read_text())
    names = {a.name for n in ast.walk(tree) if isinstance(n, ast.Import) for a in n.names}
    names |= {str(n.module) for n in ast.walk(tree) if isinstance(n, ast.ImportFrom)}
    assert {name.split(".")[0] for name in names} <= sys.stdlib_module_names


@pytest.mark.parametrize("seed", [None, 64])
def test_emitted_tables_are_the_model(seed: int | None, tmp_path: Path) -> None:
    model = load_model(GOLDEN) if seed is None else random_model(seed)
    emitted(tmp_path, model)
    done = _check_alone(tmp_path, board_folder(tmp_path / "board", model))
    assert done.returncode == 0, done.stdout + done.stderr


def test_a_limit_of_rezero_below_1_deg_h_is_in_the_table(tmp_path: Path) -> None:
    """As of a laser gyro: an integer of it is 0."""
    emitted(tmp_path, load_model(GOLDEN).model_copy(update={"rezero_dph": 2.5e-4}))
    done = checked(tmp_path)
    assert done.returncode == 0, done.stdout + done.stderr


@pytest.mark.parametrize("seed", [1])
def test_tables_with_terms_and_banks_are_the_model(seed: int, tmp_path: Path, few_vectors: None) -> None:
    emitted(tmp_path, extended(seed))
    done = checked(tmp_path, board_folder(tmp_path / "board", extended(seed)))
    assert done.returncode == 0, done.stdout + done.stderr


def test_what_cannot_be_read_exits_2(tmp_path: Path) -> None:
    assert checked(tmp_path).returncode == 2
    folder = emitted(tmp_path / "x")
    (folder / "c" / "gtc_rlg_0042.bin").write_bytes(b"\x31CTG" * 50)
    assert checked(folder).returncode == 2
