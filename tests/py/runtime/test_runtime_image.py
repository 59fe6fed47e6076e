"""The emitted `.bin` opens to the bits of the compiled table; spoiled ones do not open."""

from __future__ import annotations

import ctypes
from typing import Any

import numpy as np
import pytest
from gyrotc.model import Model
from gyrotc.tables.emit import emit_texts, quantise_all
from gyrotc.tables.quantise import NUMERICS
from gyrotc.target.status import E_ID, E_IMAGE, E_LAYOUT
from gyrotc.target.table import SERIAL_WORDS, Table, Words
from libc_build import Runtime, runtime
from libc_device import Device, history, variant
from models import random_model

MINIMAL = ("-UGTC_WITH_BANK", "-UGTC_OPEN_TERMS")


def _images(model: Model) -> dict[str, tuple[Table, Words]]:
    """Tables by arithmetic, each with the image that emit writes of it."""
    emission = quantise_all(model, None)
    texts = emit_texts(model, emission)
    names = [f"gtc_{model.id}{suffix}.bin" for suffix in ("", *(f"_{n}" for n in list(emission.tables)[1:]))]
    images = (np.frombuffer(texts[name], dtype="<u4").astype(np.uint32) for name in names)
    return {n: (t, w) for (n, t), w in zip(emission.tables.items(), images, strict=True)}


@pytest.fixture(scope="module")
def build() -> Runtime:
    return runtime("gcc", ("-O2",))


@pytest.mark.parametrize("seed", range(12))
def test_an_emitted_image_opens_to_the_bits_of_the_compiled_table(build: Runtime, seed: int) -> None:
    model = variant(seed)
    for numeric, (table, words) in _images(model).items():
        device = Device(build, table)
        status, opened = device.open(words)
        assert status == 0, numeric
        assert opened.crc == table.crc and opened.calibrated == table.calibrated
        assert device.function("check")(ctypes.byref(opened)) == 0
        channels, missed = history(model, table, seed, 400, 7)
        compiled, image = device.state(), device.state()
        device.init(compiled, 7)
        expected = device.steps(compiled, channels, missed)
        device.struct = opened
        device.init(image, 7)
        for a, b in zip(expected, device.steps(image, channels, missed), strict=True):
            np.testing.assert_array_equal(a, b, err_msg=numeric)


@pytest.mark.parametrize("serial", ["RLG-0042", "S" * 64])
def test_an_opened_image_has_the_serial_and_the_date_of_its_model(build: Runtime, serial: str) -> None:
    """It had none: a firmware could not say whose correction it had."""
    model = random_model(3, serial=serial, meta={"calibrated_on": "2026-11-21"})
    for table, words in _images(model).values():
        status, opened = Device(build, table).open(words)
        text = ctypes.string_at(opened.serial, 4 * SERIAL_WORDS)
        assert status == 0 and text.rstrip(b"\0").decode("ascii") == serial
        assert opened.calibrated == 20261121


@pytest.mark.parametrize("seed", [1, 2])
def test_what_was_not_compiled_in_is_refused(seed: int) -> None:
    for table, words in _images(variant(seed)).values():
        device = Device(runtime("gcc", ("-O2", *MINIMAL)), table)
        assert device.open(words)[0] == E_LAYOUT


@pytest.mark.parametrize("numeric", NUMERICS)
def test_every_flipped_bit_of_an_emitted_image_is_refused(
    build: Runtime, numeric: str, model_dict: dict[str, Any]
) -> None:
    table, words = _images(Model.from_dict(model_dict))[numeric]
    device = Device(build, table)
    spoiled = words.copy()
    for i in range(32 * len(words)):
        spoiled[i // 32] ^= np.uint32(1 << i % 32)
        assert device.open(spoiled)[0] == E_IMAGE, f"bit {i % 32} of word {i // 32}"
        spoiled[i // 32] = words[i // 32]
    for n in range(len(words)):
        assert device.open(words[:n].copy())[0] == E_IMAGE, f"{n} words"
    assert device.open(words.byteswap())[0] == E_IMAGE
    assert device.open(words, expected_id=table.id ^ 1)[0] == E_ID
    assert device.open(words)[0] == 0


def test_an_image_of_the_other_arithmetic_is_refused(build: Runtime, model_dict: dict[str, Any]) -> None:
    images = _images(Model.from_dict(model_dict))
    (f32, f32_words), (q31, q31_words) = images["f32"], images["q31"]
    assert Device(build, f32).open(q31_words)[0] == E_LAYOUT
    assert Device(build, q31).open(f32_words)[0] == E_LAYOUT


def test_damaged_images_never_open(build: Runtime) -> None:
    """Several words at once: exchanged, overwritten, parts of another image."""
    seed = int(np.random.default_rng().integers(2**31))
    print(f"seed {seed}")
    rng = np.random.default_rng(seed)
    for numeric, (table, words) in _images(random_model(seed)).items():
        device = Device(build, table)
        other = _images(random_model(seed, fallback_dph=0.5))[numeric][1]
        for _ in range(2000):
            spoiled = words.copy()
            at, n = int(rng.integers(0, len(words))), int(rng.integers(1, 9))
            kind = rng.integers(0, 3)
            if kind == 0:
                spoiled[at : at + n] = rng.integers(0, 2**32, len(spoiled[at : at + n]), dtype=np.uint32)
            elif kind == 1:
                spoiled[at : at + n] = rng.choice([0, 0xFFFFFFFF])
            else:
                spoiled[at:] = other[at:]
            if (spoiled != words).any() and (spoiled != other).any():
                assert device.open(spoiled)[0] == E_IMAGE, (numeric, at, n, kind)
