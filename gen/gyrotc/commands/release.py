"""What a lab does by hand and on purpose: sign an emission, stamp a model that was changed."""

from __future__ import annotations

import shutil
import sys
from pathlib import Path
from typing import Annotated

import typer

from ..errors import InputError
from .base import DirArg, app, progress, tell


@app.command()
def sign(
    folder: DirArg,
    key: Annotated[Path, typer.Option("--key", help="Ed25519 private key (PEM).")],
) -> None:
    """Sign DIR/c (with --axis all: of every axis, too): DIR/c/emission.json.sig. Only what verify passes is signed.

    Example: gyrotc sign result --key lab.pem
    """
    from ..emit.record import SIGNATURE
    from ..jobs.axes import axes_in, check_emitted
    from ..outputs import result_folder
    from ..verify.signature import load_private_key, sign_record

    private = load_private_key(key, lambda: _passphrase(key))
    axes = axes_in(folder)
    parts = [folder / axis for axis in axes] or [folder]
    with progress() as say:
        check_emitted(folder, "not signed", say)
    for part in [*parts, *([folder] if axes else [])]:
        with result_folder(part, "sign", entries=("c",)) as stage:
            shutil.copytree(part / "c", stage.folder / "c", ignore=shutil.ignore_patterns(SIGNATURE))
            sign_record(stage.folder / "c", private)
        tell(f"{part / 'c' / SIGNATURE}: signed")


def _passphrase(key: Path) -> str:
    if not sys.stdin.isatty():
        raise InputError(str(key), "is encrypted, and there is no terminal to ask", "a terminal")
    return str(typer.prompt(f"passphrase of {key}", hide_input=True, err=True))


@app.command()
def stamp(
    model: Annotated[Path, typer.Argument(help="A model.json that was changed on purpose.")],
) -> None:
    """Enter the checksum of a model.json that was changed by hand: from then on it is another model.

    Example: gyrotc stamp result/model.json
    """
    from ..model import load_model

    path = model / "model.json" if model.is_dir() else model
    loaded = load_model(path, stamped=False)
    loaded.save(path)
    tell(f"{path}: stamped, sha256 {loaded.hash}")
