"""What a lab does by hand and on purpose: sign an emission, stamp a model that was changed."""

from __future__ import annotations

import shutil
import sys
from pathlib import Path
from typing import Annotated

import typer

from ..common.errors import InputError
from ..store.folder import result_folder
from ..store.jsontext import json_text
from ..store.opening import write_own
from .base import AcceptOption, DirArg, app, progress, tell


@app.command()
def sign(
    folder: DirArg,
    key: Annotated[
        Path | None,
        typer.Option(
            "--key", help="Ed25519 private key (PEM); without it DIR/c/release.json is only written."
        ),
    ] = None,
    accept_fail: AcceptOption = None,
) -> None:
    """Sign verdict, limits, uncertainty, dates and DIR/c (with --axis all: of every axis, too): DIR/c/release.json and
    release.json.sig. Only what verify passes is signed, and what says FAIL only with --accept-fail.

    Example: gyrotc sign result --key lab.pem
    """
    from ..jobs.axes import check_emitted
    from ..jobs.release import release_of
    from ..tables.record import RELEASE, SIGNATURE
    from ..verify.signatures import load_private_key, sign_record

    private = load_private_key(key, lambda: _passphrase(key)) if key else None
    with progress() as say:
        check_emitted(folder, "not signed", say)
        releases = release_of(folder, accept_fail)
    old = shutil.ignore_patterns(RELEASE, SIGNATURE)
    for part, release in releases:
        with result_folder(part, "sign", entries=("c",)) as stage:
            shutil.copytree(part / "c", stage.folder / "c", ignore=old)
            write_own(stage.folder / "c" / RELEASE, json_text(release.content()))
            if private is not None:
                sign_record(stage.folder / "c", private)
        verdict = release.verdict or "no limits were given"
        written = f"{part / 'c' / SIGNATURE}: signed" if private else f"{part / 'c' / RELEASE}: not signed"
        tell(f"{written}; {verdict}{f', accepted: {accept_fail}' if release.accepted_fail else ''}")


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
