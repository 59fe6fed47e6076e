"""Images and saved states of the compiled runtime: the emitted `.bin` opens to the same bits, spoiled ones do not;
a state that was saved and restored anywhere goes on as if nothing had happened."""

from __future__ import annotations

import ctypes
import re
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
import pytest
from conftest import ROOT
from gyrotc.emit import emit_texts, quantise_all
from gyrotc.model import Model
from gyrotc.quantise import NUMERICS, quantise
from gyrotc.table import Table, Words
from libc_build import Runtime, runtime
from models import random_history, random_model

E_LAYOUT, E_IMAGE, E_ID = -2, -4, -5
OPTIONS = {"GTC_MAX_SLOPE_BLOCKS": 20, "GTC_MAX_TERMS": 4}


def _save_words() -> int:
    """GTC_SAVE_WORDS with default options."""
    match = re.search(r"#define GTC_SAVE_WORDS \((.*)\)", (ROOT / "include" / "gtc.h").read_text())
    assert match is not None
    expression = match[1]
    for name, value in OPTIONS.items():
        expression = expression.replace(name, str(value))
    terms = [t.strip(" ()").split("*") for t in expression.split("+")]
    return sum(int(np.prod([int(factor) for factor in term])) for term in terms)


SAVE_WORDS = _save_words()


@dataclass
class Device:
    """A compiled runtime with one table, called function by function."""

    runtime: Runtime
    table: Table

    def __post_init__(self) -> None:
        self.struct, self._keep = self.runtime.struct(self.table)

    def function(self, name: str) -> Any:
        return getattr(self.runtime.library, f"gtc_{self.table.numeric}_{name}")

    @cached_property
    def state_size(self) -> int:
        size = getattr(self.runtime.library, f"shim_{self.table.numeric}_state_size")
        size.restype = ctypes.c_size_t
        return int(size())

    def state(self) -> ctypes.Array[ctypes.c_char]:
        return ctypes.create_string_buffer(b"\xa5" * self.state_size, self.state_size)

    def open(self, words: Words, expected_id: int | None = None) -> tuple[int, ctypes.Structure]:
        """Status, and the table; one that is refused must be as it was."""
        opened = type(self.struct)()
        ctypes.memset(ctypes.byref(opened), 0xA5, ctypes.sizeof(opened))
        before = bytes(opened)
        wanted = self.table.id if expected_id is None else expected_id
        status = self.function("open")(
            ctypes.byref(opened), _pointer(words), ctypes.c_uint32(len(words)), ctypes.c_uint32(wanted)
        )
        assert status == 0 or bytes(opened) == before
        return int(status), opened

    def init(self, state: Any, samples_per_block: int) -> None:
        assert (
            self.function("init")(state, ctypes.byref(self.struct), ctypes.c_uint32(samples_per_block)) == 0
        )

    def save(self, state: Any) -> Words:
        words = np.full(SAVE_WORDS + 1, 0x5A5A5A5A, dtype=np.uint32)
        assert self.function("save")(state, _pointer(words)) == 0
        assert words[-1] == 0x5A5A5A5A
        return words[:-1].copy()

    def restore(self, state: Any, words: Words, samples_per_block: int, off_blocks: int = 0) -> int:
        """Status; a state that is refused must be as it was."""
        before = bytes(state)
        status = self.function("restore")(
            state,
            ctypes.byref(self.struct),
            ctypes.c_uint32(samples_per_block),
            _pointer(words),
            ctypes.c_uint32(off_blocks),
        )
        assert status == 0 or bytes(state) == before
        return int(status)

    def steps(self, state: Any, channels: Words, missed: np.ndarray) -> tuple[np.ndarray, Words]:
        """Goes on with the state; as Runtime.steps(), and an angle with every row."""
        rows = len(channels)
        status, bits = np.zeros((rows, 3), np.int32), np.zeros(rows, np.uint32)
        channels, missed = np.ascontiguousarray(channels), np.ascontiguousarray(missed, dtype=np.uint32)
        getattr(self.runtime.library, f"shim_{self.table.numeric}_steps")(
            state,
            _pointer(channels),
            ctypes.c_long(channels.shape[1]),
            _pointer(missed),
            ctypes.c_long(rows),
            _pointer(status),
            _pointer(bits),
        )
        return status, bits

    def angle(self, state: Any) -> tuple[int, int]:
        """Status and bits of the angle over 7 ms."""
        dt = ctypes.c_float(0.007) if self.table.numeric == "f32" else ctypes.c_int32(7000)
        bits = ctypes.c_uint32(0)
        return int(self.function("angle")(state, dt, ctypes.byref(bits))), bits.value


def _pointer(words: np.ndarray) -> ctypes.c_void_p:
    return ctypes.c_void_p(words.ctypes.data)


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


@pytest.mark.parametrize("seed", range(8))
def test_an_emitted_image_opens_to_the_bits_of_the_compiled_table(build: Runtime, seed: int) -> None:
    model = random_model(seed)
    for numeric, (table, words) in _images(model).items():
        device = Device(build, table)
        status, opened = device.open(words)
        assert status == 0, (numeric, seed)
        assert opened.crc == table.crc and opened.serial is None
        assert device.function("check")(ctypes.byref(opened)) == 0
        x, missed = random_history(model, seed, 400, 7)
        channels = table.encode_inputs(x[:, None])
        expected, compiled = device.state(), Device(build, table)
        compiled.struct = opened
        found = compiled.state()
        device.init(expected, 7)
        compiled.init(found, 7)
        for a, b in zip(
            device.steps(expected, channels, missed), compiled.steps(found, channels, missed), strict=True
        ):
            np.testing.assert_array_equal(a, b, err_msg=f"{numeric}, seed {seed}")


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


@pytest.mark.parametrize("numeric", NUMERICS)
def test_a_restored_state_goes_on_bit_for_bit_in_any_history(build: Runtime, numeric: str) -> None:
    """Random models, faults and cuts: angles, statuses and corrections of the one that was never cut."""
    seed = int(np.random.default_rng().integers(2**31))
    print(f"seed {seed}")
    rng = np.random.default_rng(seed)
    for trial in range(30):
        model = random_model(seed + trial)
        device = Device(build, quantise(model, numeric))
        samples_per_block = int(rng.choice([1, 2, 3, 7, 10, 50]))
        x, missed = random_history(model, seed + trial, 600, samples_per_block)
        channels = device.table.encode_inputs(x[:, None])
        whole, cut = device.state(), device.state()
        device.init(whole, samples_per_block)
        device.init(cut, samples_per_block)
        ends = [*np.sort(rng.integers(0, len(x), 40)).tolist(), len(x)]
        for start, end in zip([0, *ends[:-1]], ends, strict=True):
            claim = f"seed {seed}, trial {trial}, rows {start} to {end}"
            words = device.save(cut)
            cut = device.state()
            assert device.restore(cut, words, samples_per_block) == 0, claim
            np.testing.assert_array_equal(device.save(cut), words, err_msg=claim)
            expected = device.steps(whole, channels[start:end], missed[start:end])
            for a, b in zip(expected, device.steps(cut, channels[start:end], missed[start:end]), strict=True):
                np.testing.assert_array_equal(a, b, err_msg=claim)
            assert device.angle(whole) == device.angle(cut), claim


@pytest.mark.parametrize("numeric", NUMERICS)
def test_spoiled_states_are_refused(build: Runtime, numeric: str, model_dict: dict[str, Any]) -> None:
    """Every flipped bit, every single word of a later state, a state of another table."""
    model = Model.from_dict(model_dict)
    device = Device(build, quantise(model, numeric))
    x, missed = random_history(model, 3, 300, 10)
    channels = device.table.encode_inputs(x[:, None])
    state = device.state()
    device.init(state, 10)
    device.steps(state, channels[:151], missed[:151])
    words = device.save(state)
    device.steps(state, channels[151:], missed[151:])
    device.angle(state)
    later = device.save(state)
    target = device.state()
    for i in range(SAVE_WORDS):
        spoiled = words.copy()
        for bit in range(32):
            spoiled[i] = words[i] ^ np.uint32(1 << bit)
            assert device.restore(target, spoiled, 10) == E_IMAGE, f"bit {bit} of word {i}"
        spoiled[i] = later[i]
        if spoiled[i] != words[i]:
            assert device.restore(target, spoiled, 10) == E_IMAGE, f"word {i}"
    foreign = Device(build, quantise(Model.from_dict(model_dict | {"serial": "RLG-0043"}), numeric))
    assert foreign.restore(target, words, 10) == E_ID
    assert device.restore(target, words, 10) == 0
