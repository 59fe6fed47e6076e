"""`gyrotc sign` and `verify --signature` against the openssl program; `gyrotc stamp`."""

from __future__ import annotations

import json
import subprocess
from pathlib import Path

import pytest
from conftest import Command
from emitted import GOLDEN, emitted, spoil
from gyrotc.common.errors import InputError
from gyrotc.model import load_model
from gyrotc.tables.emit import emit
from gyrotc.tables.record import RELEASE, SIGNATURE, load_private_key, load_public_key
from gyrotc.verify.job import verify


def _openssl(*arguments: object) -> subprocess.CompletedProcess[bytes]:
    return subprocess.run(["openssl", *map(str, arguments)], capture_output=True, check=False)


@pytest.fixture
def key(tmp_path: Path) -> Path:
    """A key pair as docs/delivery.md makes it: lab.pem, lab.pub."""
    return _pair(tmp_path, "lab", "ed25519")


def _pair(folder: Path, name: str, *algorithm: str) -> Path:
    private = folder / f"{name}.pem"
    assert _openssl("genpkey", "-algorithm", *algorithm, "-out", private).returncode == 0
    assert _openssl("pkey", "-in", private, "-pubout", "-out", private.with_suffix(".pub")).returncode == 0
    return private


def _signed(folder: Path, key: Path) -> tuple[str, int]:
    result = verify(folder, compiled=False, signature=key.with_suffix(".pub")).content()
    return result["signature"]["status"], result["failed"]


def test_gyrotc_signs_and_openssl_agrees(key: Path, tmp_path: Path, gyrotc: Command) -> None:
    folder = emitted(tmp_path / "result")
    assert gyrotc("sign", folder, "--key", key).returncode == 0
    record, signature = folder / "c" / RELEASE, folder / "c" / SIGNATURE
    check = ("pkeyutl", "-verify", "-pubin", "-inkey", key.with_suffix(".pub"), "-rawin")
    assert _openssl(*check, "-in", record, "-sigfile", signature).returncode == 0
    assert _signed(folder, key) == ("pass", 0)
    # The signature is no foreign file, and does not change what a board's log belongs to.
    assert verify(folder, compiled=False).content()["failed"] == 0
    done = gyrotc("verify", folder, "--signature", key.with_suffix(".pub"), "--target", "host-gcc-O2")
    assert done.returncode == 0 and "signature good" in done.stdout
    assert "released: no limits were given" in done.stdout


def test_openssl_signs_and_gyrotc_agrees_until_a_byte_changes(key: Path, tmp_path: Path, gyrotc: Command) -> None:
    folder = emitted(tmp_path / "result")
    done = gyrotc("sign", folder)
    assert done.returncode == 0 and "not signed" in done.stdout
    record, signature = folder / "c" / RELEASE, folder / "c" / SIGNATURE
    sign = ("pkeyutl", "-sign", "-inkey", key, "-rawin")
    assert _openssl(*sign, "-in", record, "-out", signature).returncode == 0
    assert _signed(folder, key) == ("pass", 0)
    assert _signed(folder, _pair(tmp_path, "other", "ed25519")) == ("fail", 1)
    right = signature.read_bytes()
    for wrong in (right[:-1], right + b"\0", bytes([right[0] ^ 1]) + right[1:], b""):
        signature.write_bytes(wrong)
        assert _signed(folder, key) == ("fail", 1)
    signature.unlink()
    assert _signed(folder, key) == ("fail", 1)
    # Emitted again with other options the files are gyrotc's own, but not those that were signed.
    signature.write_bytes(right)
    assert _signed(folder, key) == ("pass", 0)
    released = record.read_bytes()
    signature.unlink()
    emit(load_model(GOLDEN), folder, zero_at=20.0)
    record.write_bytes(released)
    signature.write_bytes(right)
    assert _signed(folder, key) == ("fail", 1)


def test_an_older_release_does_not_replace_a_newer_one(key: Path, tmp_path: Path, gyrotc: Command) -> None:
    """Before: a table that was replaced for a reason could be handed over again, its signature is good for ever."""

    def of(name: str, **meta: str) -> Path:
        model = load_model(GOLDEN).model_copy(update={"meta": meta})
        folder = emitted(tmp_path / name, model)
        assert gyrotc("sign", folder, "--key", key).returncode == 0
        return folder

    old, new, undated = (of("old", calibrated_on="2026-03-07"), of("new", calibrated_on="2026-09-07"), of("undated"))
    public = key.with_suffix(".pub")

    def status(result: Path, now: Path) -> str | None:
        signed = verify(result, compiled=False, signature=public, replaces=now).signature
        assert signed is not None
        return signed.reason

    assert status(new, old) is None and status(new, new) is None
    assert "of 2026-03-07 is older than that of 2026-09-07" in (status(old, new) or "")
    assert "not stated" in (status(undated, new) or "")
    done = gyrotc("verify", old, "--signature", public, "--replaces", new, "--target", "host-gcc-O2")
    assert done.returncode == 1 and "is older than that of 2026-09-07" in done.stdout
    (new / "c" / SIGNATURE).write_bytes(bytes(64))
    with pytest.raises(InputError, match="--replaces"):
        status(old, new)
    assert gyrotc("verify", old, "--replaces", new).returncode == 2


def test_what_verify_refuses_is_not_signed(key: Path, tmp_path: Path, gyrotc: Command) -> None:
    folder = emitted(tmp_path / "result")
    spoil(folder / "c" / "main.c", "return 1;", "return 0;")
    done = gyrotc("sign", folder, "--key", key)
    assert done.returncode == 1 and "main.c" in done.stderr
    assert not (folder / "c" / SIGNATURE).exists()


def test_keys_of_another_kind_and_files_that_are_none_are_refused(key: Path, tmp_path: Path) -> None:
    rsa = _pair(tmp_path, "rsa", "rsa", "-pkeyopt", "rsa_keygen_bits:2048")
    for wrong in (rsa.with_suffix(".pub"), key, tmp_path / "absent", tmp_path):
        with pytest.raises(InputError, match="Ed25519"):
            load_public_key(wrong)
    for wrong in (rsa, key.with_suffix(".pub"), tmp_path / "absent"):
        with pytest.raises(InputError, match="Ed25519"):
            load_private_key(wrong, lambda: "")


@pytest.mark.parametrize("mode", [0o666, 0o640, 0o602])
def test_a_private_key_that_others_can_reach_is_refused(key: Path, tmp_path: Path, mode: int) -> None:
    shared = tmp_path / "shared.pem"
    encrypted = ("-aes256", "-passout", "pass:right")
    assert _openssl("pkey", "-in", key, *encrypted, "-out", shared).returncode == 0
    shared.chmod(mode)

    def asked() -> str:
        pytest.fail("the passphrase was asked for before the access was checked")

    with pytest.raises(InputError, match=f"mode {mode:03o}"):
        load_private_key(shared, asked)


def test_an_encrypted_key_asks_and_says_when_the_passphrase_is_wrong(
    key: Path, tmp_path: Path, gyrotc: Command
) -> None:
    locked = tmp_path / "locked.pem"
    assert _openssl("pkey", "-in", key, "-aes256", "-passout", "pass:right", "-out", locked).returncode == 0
    assert load_private_key(locked, lambda: "right").public_key() == load_public_key(key.with_suffix(".pub"))
    with pytest.raises(InputError, match="passphrase"):
        load_private_key(locked, lambda: "wrong")
    word = tmp_path / "word"
    word.write_text("right\n")
    found = gyrotc("sign", tmp_path / "absent", "--key", locked, "--key-passphrase-file", word)
    assert found.returncode == 2 and "absent" in found.stderr, "the key was opened, the folder is missing"
    word.write_text("wrong\n")
    found = gyrotc("sign", tmp_path / "absent", "--key", locked, "--key-passphrase-file", word)
    assert found.returncode == 2 and "passphrase" in found.stderr
    word.write_text("")
    assert gyrotc("sign", tmp_path / "absent", "--key", locked, "--key-passphrase-file", word).returncode == 2


def test_a_model_changed_on_purpose_is_stamped(tmp_path: Path, gyrotc: Command) -> None:
    path = tmp_path / "model.json"
    content = json.loads(GOLDEN.read_text())
    content["hold_blocks"] += 1
    path.write_text(json.dumps(content))
    refused = gyrotc("emit", path, "--out", tmp_path / "out")
    assert refused.returncode == 2 and f"gyrotc stamp {path}" in refused.stderr
    assert gyrotc("stamp", path).returncode == 0
    assert load_model(path).hold_blocks == content["hold_blocks"]
    path.write_text("{}")
    assert gyrotc("stamp", path).returncode == 2
