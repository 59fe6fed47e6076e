"""The record that `emit` leaves in `c/` (which model, which options, the hash of every file), and a signed release.

`verify` makes the files again with the options that stand here, and then this record itself, so a changed record
does not pass either. A release, which is what is signed (docs/delivery.md), names its hash. docs/FORMAT.md, section 6.

A signature is Ed25519 over the bytes of `c/release.json`: raw 64 bytes, as `openssl pkeyutl -sign -rawin` writes them.
The release names verdict, limits, uncertainty and dates, and the hashes of what they rest on.
"""

from __future__ import annotations

import hashlib
import stat
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

from pydantic import BaseModel, ConfigDict, Field, ValidationError

from ..common.errors import InputError, install_command
from ..common.inputs import parse_json, read_input
from ..mirror.table import Numeric
from ..model import Model
from ..results.base import Axis, Numbered, checked_result
from ..results.files import json_text, write_atomically
from ..results.marker import sha256
from ..results.release import RELEASED, Release, SignatureCheck

if TYPE_CHECKING:
    from cryptography.hazmat.primitives.asymmetric.ed25519 import Ed25519PrivateKey, Ed25519PublicKey


RECORD = "emission.json"
RELEASE = "release.json"
SIGNATURE = "release.json.sig"
#: Names in `c/` that gyrotc writes but does not make from the model: what is signed, and the marker of a result.
BESIDES = frozenset({RELEASE, SIGNATURE, ".gyrotc-result.json"})


class Options(BaseModel):
    """Options of `emit`: arithmetics asked for by name (None: every one there is), where the map is shifted to 0."""

    model_config = ConfigDict(frozen=True, strict=True, extra="ignore", allow_inf_nan=False)

    numeric: Annotated[tuple[Numeric, ...], Field(min_length=1, max_length=2)] | None = None
    zero_at_c: Annotated[float, Field(ge=-200.0, le=400.0)] | None = None

    @property
    def text(self) -> str:
        """The options as they are typed, with a blank before each."""
        numeric = f" --numeric {','.join(self.numeric)}" if self.numeric is not None else ""
        return numeric + (f" --zero-at {self.zero_at_c!r}" if self.zero_at_c is not None else "")

    def shifted(self, model: Model) -> Model:
        """The model whose map the tables compute."""
        return model if self.zero_at_c is None else model.zeroed_at(self.zero_at_c)


class EmissionRecord(Numbered):
    """What `emit` wrote into `c/`, a pure function of the model and the options."""

    schema_: Annotated[Literal["gyrotc.emission/1"], Field(alias="schema")] = "gyrotc.emission/1"
    serial: str = Field(description="gyro serial")
    axis: Axis = Field(description="null where there is one axis, and where several stand in one folder")
    model_hash: str | None = Field(default=None, description="hash of the model, where it is one")
    numeric: tuple[Numeric, ...] | None = Field(
        default=None, description="arithmetics asked for by `--numeric`, in their order, or null"
    )
    zero_at_c: float | None = Field(default=None, description="`--zero-at`, C, or null")
    axes: dict[str, str] = Field(
        default={}, description="where several axes stand in one folder: hash of each axis's model"
    )
    files: dict[str, str] = Field(description="SHA-256 of every other file, by name")


def record_text(model: Model, options: Options, files: Mapping[str, bytes]) -> bytes:
    """`c/emission.json` of one table."""
    record = EmissionRecord(
        serial=model.serial,
        axis=model.axis,
        model_hash=model.hash,
        numeric=options.numeric,
        zero_at_c=options.zero_at_c,
        files=_hashes(files),
    )
    return _text(record)


def joint_record_text(models: Mapping[str, Model], files: Mapping[str, bytes]) -> bytes:
    """`c/emission.json` where the tables of several axes stand beside one runtime."""
    first = next(iter(models.values()))
    axes = {axis: model.hash for axis, model in models.items()}
    return _text(EmissionRecord(serial=first.serial, axis=None, axes=axes, files=_hashes(files)))


def _hashes(files: Mapping[str, bytes]) -> dict[str, str]:
    return {name: hashlib.sha256(files[name]).hexdigest() for name in sorted(files)}


def _text(record: EmissionRecord) -> bytes:
    return json_text(record.content()).encode("ascii")


class _Stored(Options):
    """What of a record is accepted before `verify` has made it again: the options."""

    schema_: Annotated[Literal["gyrotc.emission/1"], Field(alias="schema")]


def read_options(c_folder: Path) -> Options:
    """The options with which a folder was emitted, as its record says.

    Raises:
        InputError: There is no record, or it is damaged.
    """
    path = c_folder / RECORD
    data = read_input(path, "result_mib", "a folder that emit wrote")
    try:
        found = _Stored.model_validate_json(data)
    except ValidationError as error:
        first = error.errors()[0]
        field = ".".join(str(part) for part in first["loc"])
        where = f"{path}, field {field}" if field else str(path)
        raise InputError(where, f"is damaged ({first['msg']})", "the record that emit wrote") from error
    return Options(numeric=found.numeric, zero_at_c=found.zero_at_c)


_LARGEST_KEY = 2**16  # bytes of a PEM file
_LARGEST_RELEASE = 2**22  # bytes: a thousand limits are a tenth of it
_LENGTH = 64  # bytes of a signature


def sign_record(c_folder: Path, key: Ed25519PrivateKey) -> Path:
    """Writes `c/release.json.sig`; returns its path.

    Raises:
        InputError: There is no release.
    """
    path = c_folder / SIGNATURE
    write_atomically(path, key.sign(_bytes(c_folder / RELEASE, _LARGEST_RELEASE, "a release")))
    return path


def check_signature(c_folder: Path, key: Ed25519PublicKey, replaces: Path | None = None) -> SignatureCheck:
    """Whether the release's signature is of this key, and all that it names is as it was released.

    Args:
        replaces: A signed result that this one is to replace: it may not be of a later calibration.

    Raises:
        InputError: What it replaces is not signed by this key.
    """
    earlier = None
    if replaces is not None:
        try:
            earlier = _signed(replaces / "c", key)
        except InputError as error:
            raise InputError("--replaces", str(error), "a result that this key has signed") from error
    reason, release = None, None
    try:
        release = _signed(c_folder, key)
        reason = _departure(c_folder, release) or (_older(release, earlier) if earlier else None)
    except InputError as error:
        reason = str(error)
    signed = release if release is not None and reason is None else None
    days = [unit.valid_until for unit in signed.units if unit.valid_until] if signed else []
    return SignatureCheck(
        file=SIGNATURE,
        status="fail" if reason else "pass",
        key=hashlib.sha256(key.public_bytes_raw()).hexdigest(),
        reason=reason,
        verdict=signed.verdict if signed else None,
        accepted_fail=signed.accepted_fail if signed else None,
        valid_until=min(days, default=None),
    )


def _signed(c_folder: Path, key: Ed25519PublicKey) -> Release:
    """The release in a folder.

    Raises:
        InputError: There is none, or its signature is not of this key.
    """
    from cryptography.exceptions import InvalidSignature

    data = _bytes(c_folder / RELEASE, _LARGEST_RELEASE, "what gyrotc sign wrote")
    try:
        key.verify(_bytes(c_folder / SIGNATURE, _LENGTH, ""), data)
    except InvalidSignature:
        raise InputError(str(c_folder / SIGNATURE), "not a signature of this release by this key") from None
    return checked_result(parse_json(data, str(c_folder / RELEASE), "a release"), Release, RELEASE)


def _older(release: Release, earlier: Release) -> str | None:
    """Why a release may not replace another, whose signature is as good; None if it may."""
    if (release.serial, release.axis) != (earlier.serial, earlier.axis):
        return f"gyro {release.serial}, axis {release.axis} does not replace {earlier.serial}, axis {earlier.axis}"
    days = {unit.axis: unit.calibrated_on for unit in earlier.units}
    for unit in release.units:
        of, day, before = (f" of axis {unit.axis}" if unit.axis else "", unit.calibrated_on, days.get(unit.axis))
        if day is None or before is None:
            return f"a day of calibration{of} is not stated, so that the older release is not known"
        if day[:10] < before[:10]:
            return f"the calibration{of} of {day[:10]} is older than that of {before[:10]}, which it would replace"
    return None


def _departure(c_folder: Path, release: Release) -> str | None:
    """The first file that is not as it was released, and why; None if all are."""
    folder = c_folder.parent
    axes = [f"{unit.axis}/" if release.axis != unit.axis else "" for unit in release.units]
    known = {f"{axis}{name}": None for axis in axes for name in RELEASED} | release.files
    for name, digest in ({"c/" + RECORD: release.emission} | known).items():
        path = folder / name
        if not path.is_file():
            if digest is not None:
                return f"{name} is missing"
        elif digest is None:
            return f"{name} was not there when it was signed"
        elif sha256(path) != digest:
            return f"{name} is not what was signed"
    return None


def load_public_key(path: Path) -> Ed25519PublicKey:
    """An Ed25519 public key from a PEM file.

    Raises:
        InputError: It cannot be read, is something else, or the package `cryptography` is not installed.
    """
    serialization = _serialization()
    from cryptography.hazmat.primitives.asymmetric.ed25519 import Ed25519PublicKey

    expected = "an Ed25519 public key (PEM), as `openssl pkey -pubout` writes it"
    try:
        key = serialization.load_pem_public_key(_bytes(path, _LARGEST_KEY, expected))
    except _refusals() as error:
        raise InputError(str(path), "is no public key", expected) from error
    if not isinstance(key, Ed25519PublicKey):
        raise InputError(str(path), "is a key of another kind", expected)
    return key


def load_private_key(path: Path, passphrase: Callable[[], str]) -> Ed25519PrivateKey:
    """An Ed25519 private key from a PEM file; `passphrase` is asked for it where it is encrypted.

    Raises:
        InputError: It cannot be read or decrypted, other users can reach it, it is something else, or `cryptography`
            is not installed.
    """
    serialization = _serialization()
    from cryptography.hazmat.primitives.asymmetric.ed25519 import Ed25519PrivateKey

    expected = "an Ed25519 private key (PEM), as `openssl genpkey -algorithm ed25519` writes it"
    data = _bytes(path, _LARGEST_KEY, expected)
    if b"PRIVATE KEY" in data:  # in the first line of each kind of PEM private key (RFC 7468, 10 and 11)
        _refuse_shared(path)
    word = passphrase().encode() if b"ENCRYPTED" in data else None
    try:
        key = serialization.load_pem_private_key(data, word)
    except _refusals() as error:
        found = "cannot be decrypted with this passphrase" if word is not None else "is no private key"
        raise InputError(str(path), found, expected) from error
    if not isinstance(key, Ed25519PrivateKey):
        raise InputError(str(path), "is a key of another kind", expected)
    return key


def _refuse_shared(path: Path) -> None:
    """Refuses a private key that others can read or write, as ssh does: it signs for whoever has it."""
    mode = stat.S_IMODE(path.stat().st_mode)
    if mode & (stat.S_IRWXG | stat.S_IRWXO):
        found = f"is a private key that other users can reach (mode {mode:03o})"
        raise InputError(str(path), found, f"mode 600: chmod 600 {path.name}")


def _serialization() -> Any:
    try:
        from cryptography.hazmat.primitives import serialization
    except ImportError as error:
        raise InputError("signatures", "the package cryptography is not installed", install_command("sign")) from error
    return serialization


def _refusals() -> tuple[type[Exception], ...]:
    """What the reader of keys raises for a file that is none."""
    from cryptography.exceptions import UnsupportedAlgorithm

    return (ValueError, TypeError, UnsupportedAlgorithm)


def _bytes(path: Path, largest: int, expected: str) -> bytes:
    try:
        if not path.is_file():
            raise InputError(str(path), "is no file that is there", expected)
        with path.open("rb") as file:
            data = file.read(largest + 1)
    except OSError as error:
        raise InputError(str(path), f"cannot be read ({error.strerror})", expected) from error
    if len(data) > largest:
        raise InputError(str(path), f"is larger than {largest} bytes", expected)
    return data
