"""Commands for what leaves the laboratory: certificate, export, sign, stamp."""

from __future__ import annotations

import re
import shutil
import sys
from pathlib import Path
from typing import Annotated

import typer

from ..common.errors import InputError
from ..common.inputs import read_input
from .base import AcceptOption, DirArg, OutOption, app, progress, tell, written_place
from .words import ExportFormat, GyroAxis

_MOST_POINTS = 1000  # of an axis: a table of a million is more than any control unit holds


@app.command()
def certificate(
    folder: DirArg,
    out: OutOption,
    facts: Annotated[
        Path | None, typer.Option("--facts", help="What the laboratory states (TOML, docs/delivery.md).")
    ] = None,
    number: Annotated[str | None, typer.Option("--number", help="Number of the certificate.")] = None,
    draft: Annotated[
        bool, typer.Option("--draft", help="Without what is missing: marked as a draft, and no DCC.")
    ] = False,
    accept_fail: AcceptOption = None,
) -> None:
    """Write a certificate: a page of A4, PDF where Chromium is there, and a digital calibration certificate (DCC XML).
    What is missing for one is listed before anything is written.

    Example: gyrotc certificate result --facts laboratory.toml --number 2026-0042 --out certificate
    """
    from ..deliver.certificate import certificate as run

    with progress() as say:
        say("writing")
        found = run(folder, out, facts=facts, number=number, draft=draft, accept_fail=accept_fail)
    for path in found.files:
        tell(str(path))
    if not found.pdf:
        tell("no PDF: Chromium is not installed or did not print; print certificate.html", wrong=True)


@app.command()
def export(
    folder: DirArg,
    format: Annotated[
        ExportFormat,
        typer.Option("--format", help="px4, ardupilot; csv, json, a2l, cdf: the map as a table; fmu."),
    ],
    out: Annotated[Path, typer.Option("--out", callback=written_place, help="The file.")],
    axis_as: Annotated[
        GyroAxis, typer.Option("--axis-as", help="Axis of the autopilot for a gyro of one axis.")
    ] = GyroAxis.x,
    device: Annotated[int, typer.Option("--device", min=0, help="PX4: CAL_GYRO0_ID of the vehicle.")] = 0,
    points: Annotated[str, typer.Option("--points", help="Temperatures x rates of temperature of a table.")] = "61x25",
    address: Annotated[
        str, typer.Option("--address", help="A2L: where the table begins in memory, e.g. 0x80040000.")
    ] = "0",
) -> None:
    """Write the correction in another form: parameters of PX4 (TC_G*) or ArduPilot (INS_TCAL*); a table of the map
    for a control unit (ASAP2 A2L and its values as ASAM CDF) or any program (CSV, JSON); a unit of co-simulation
    (FMU, FMI 3.0) with the same C inside.

    What the other form loses against the map is reported, and stands in the file.

    Example: gyrotc export result --format px4 --out gyro.params
    """
    from ..deliver.export import Exporting
    from ..deliver.export import export as run

    options = Exporting(axis_as.value, device, points_of(points), address_of(address))
    with progress() as say:
        say(f"writing {format.value}")
        lines = run(folder, format.value, out, options)
    for line in lines:
        tell(line)
    tell(str(out))


def points_of(text: str) -> tuple[int, int]:
    """Temperatures and rates of `--points`; raises InputError."""
    found = re.fullmatch(r"(\d{1,4})x(\d{1,4})", text)
    temperatures, rates = (int(n) for n in found.groups()) if found else (0, 0)
    if not (2 <= temperatures <= _MOST_POINTS and 2 <= rates <= _MOST_POINTS):
        raise InputError("--points", repr(text), f"two numbers from 2 to {_MOST_POINTS}, such as 61x25")
    return temperatures, rates


def address_of(text: str) -> int:
    """The number of `--address`; raises InputError."""
    try:
        found = int(text, 0)
    except ValueError:
        found = -1
    if not 0 <= found < 2**32:
        raise InputError("--address", repr(text), "an address of 32 bits, such as 0x80040000")
    return found


@app.command()
def sign(
    folder: DirArg,
    key: Annotated[
        Path | None,
        typer.Option("--key", help="Ed25519 private key (PEM); without it DIR/c/release.json is only written."),
    ] = None,
    passphrase_file: Annotated[
        Path | None,
        typer.Option("--key-passphrase-file", help="Its first line is the passphrase of an encrypted key."),
    ] = None,
    accept_fail: AcceptOption = None,
) -> None:
    """Sign verdict, limits, uncertainty, dates and DIR/c (with --axis all: of every axis, too): DIR/c/release.json and
    release.json.sig. Only what verify passes is signed, and FAIL or CONDITIONAL PASS only with --accept-fail.

    Example: gyrotc sign result --key lab.pem
    """
    from ..jobs.axes import check_emitted
    from ..jobs.release import release_of
    from ..store.files import json_text, write_own
    from ..store.folder import result_folder
    from ..tables.record import RELEASE, SIGNATURE
    from ..verify.signatures import load_private_key, sign_record

    private = load_private_key(key, lambda: _passphrase(key, passphrase_file)) if key else None
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


def _passphrase(key: Path, file: Path | None) -> str:
    if file is not None:
        lines = read_input(file, "text_mib", "a passphrase").decode("utf-8", "replace").splitlines()
        if not lines or not lines[0]:
            raise InputError(str(file), "has an empty first line", "a passphrase")
        return lines[0]
    if not sys.stdin.isatty():
        raise InputError(str(key), "is encrypted, and there is no terminal to ask", "--key-passphrase-file")
    return str(typer.prompt(f"passphrase of {key}", hide_input=True, err=True))


@app.command()
def stamp(model: Annotated[Path, typer.Argument(help="A model.json that was changed on purpose.")]) -> None:
    """Enter the checksum of a model.json that was changed by hand: from then on it is another model.

    Example: gyrotc stamp result/model.json
    """
    from ..model import load_model

    path = model / "model.json" if model.is_dir() else model
    loaded = load_model(path, stamped=False)
    loaded.save(path)
    tell(f"{path}: stamped, sha256 {loaded.hash}")
