"""Signatures of a release: Ed25519 over the bytes of `c/release.json` (docs/delivery.md).

It names verdict, limits, uncertainty and dates, and the hashes of what they rest on and of the record of the emission;
`verify` proves that the emitted files are what gyrotc makes; the signature says who released them. Raw 64 bytes, as
`openssl pkeyutl -sign -rawin` writes them.
"""

from __future__ import annotations

import hashlib
import stat
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ..common.errors import InputError, install_command
from ..common.inputs import parse_json
from ..results.base import checked_result
from ..results.release import RELEASED, Release, SignatureCheck
from ..store.files import write_atomically
from ..store.marker import sha256
from ..tables.record import RECORD, RELEASE, SIGNATURE

if TYPE_CHECKING:
    from cryptography.hazmat.primitives.asymmetric.ed25519 import Ed25519PrivateKey, Ed25519PublicKey

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
        of, day, before = (
            f" of axis {unit.axis}" if unit.axis else "",
            unit.calibrated_on,
            days.get(unit.axis),
        )
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
