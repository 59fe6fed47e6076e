"""Claims about any stream of readings, for the compiled runtime and its reference in both arithmetics."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from drawn import examples
from gyrotc.mirror import Words, follow_history, replay
from gyrotc.results import Numeric
from gyrotc.tables import NUMERICS
from hypothesis import given
from hypothesis import strategies as st
from libc_build import runtime
from libc_device import Device, variant
from streams import Stream, drawn_table, streams

# A build whose claims about ranges of intermediate numbers are counted.
_COUNTED = ("gcc", ("-O2", '-DGTC_CONFIG_HEADER="libc_counted.h"'))
# Kinds of calls of libc_shim.c.
_SAMPLE, _MISSED = 0, 2


def _expected(stream: Stream) -> Any:
    return replay(stream.table, stream.readings, missed=stream.lost, samples_per_block=stream.samples_per_block)


@pytest.mark.parametrize("numeric", NUMERICS)
@examples(60)
@given(data=st.data())
def test_reference_and_c_agree_bit_for_bit_on_any_stream(numeric: Numeric, data: st.DataObject) -> None:
    """In every return value, correction, uncertainty and age; no intermediate number leaves its range."""
    stream = data.draw(streams(numeric))
    expected, c = _expected(stream), runtime(*_COUNTED)
    status, bits = c.steps(stream.table, stream.readings, stream.lost, stream.samples_per_block)
    columns = [expected.missed_status, expected.sample_status, expected.status]
    np.testing.assert_array_equal(status, np.stack(columns, axis=1))
    np.testing.assert_array_equal(bits, expected.bits)
    if expected.sigma is not None:
        status, bits = c.snapshots(stream.table, stream.readings, stream.lost, stream.samples_per_block)
        columns = [expected.sample_status, expected.status, expected.status, expected.age]
        np.testing.assert_array_equal(status, np.stack(columns, axis=1))
        np.testing.assert_array_equal(bits[:, :2], np.stack([expected.bits, expected.sigma], axis=1))
    assert c.out_of_range() == 0


@pytest.mark.parametrize("numeric", NUMERICS)
@examples(30)
@given(data=st.data())
def test_no_correction_exceeds_the_authority_of_its_table(numeric: Numeric, data: st.DataObject) -> None:
    """Also for words that are no readings of a sensor: infinities, NaN of any payload, the largest numbers."""
    stream = data.draw(streams(numeric))
    words = st.integers(0, 2**32 - 1) | st.sampled_from([0, 0x7F800000, 0xFF800001, 0x80000000, 0x7FFFFFFF])
    readings = stream.readings.copy()
    for row, word in data.draw(st.lists(st.tuples(st.integers(0, len(stream) - 1), words), max_size=20)):
        readings[row] = word
    _, bits = runtime().steps(stream.table, readings, stream.lost, stream.samples_per_block)
    low, high = stream.table.decode_bias(np.array(stream.table.authority, dtype=np.uint32))
    bias_dph = stream.table.decode_bias(bits)
    corrected = bits != 0  # 0 stands for no correction before the first one
    assert np.all((bias_dph[corrected] >= low) & (bias_dph[corrected] <= high))


@pytest.mark.parametrize("numeric", NUMERICS)
@examples(30)
@given(data=st.data())
def test_a_state_that_is_saved_and_restored_anywhere_goes_on_as_if_nothing_had_happened(
    numeric: Numeric, data: st.DataObject
) -> None:
    stream = data.draw(streams(numeric))
    cuts = sorted(data.draw(st.sets(st.integers(0, len(stream)), max_size=8)))
    device = Device(runtime(), stream.table)
    whole, cut = device.state(), device.state()
    device.init(whole, stream.samples_per_block)
    device.init(cut, stream.samples_per_block)
    for start, end in zip([0, *cuts], [*cuts, len(stream)], strict=True):
        saved = device.save(cut)
        cut = device.state()  # filled with other bytes, as memory after a start
        assert device.restore(cut, saved, stream.samples_per_block) == 0
        np.testing.assert_array_equal(device.save(cut), saved)
        part = slice(start, end)
        expected = device.steps(whole, stream.readings[part], stream.lost[part])
        for one, other in zip(device.steps(cut, stream.readings[part], stream.lost[part]), expected, strict=True):
            np.testing.assert_array_equal(one, other)


@pytest.mark.parametrize("numeric", NUMERICS)
@examples(22)
@given(data=st.data())
def test_losses_that_are_reported_in_parts_are_one_loss(numeric: Numeric, data: st.DataObject) -> None:
    """The host may report a time without readings at once or in two calls."""
    stream = data.draw(streams(numeric, uncertain=True))
    kinds: list[int] = []
    numbers: list[int] = []
    sources: list[int] = []
    for row, lost in enumerate(stream.lost.tolist()):
        first = data.draw(st.integers(0, lost)) if lost else 0
        calls = [(_MISSED, part) for part in (first, lost - first) if part] + [(_SAMPLE, 0)]
        kinds += [kind for kind, _ in calls]
        numbers += [number for _, number in calls]
        sources += [row] * len(calls)
    kind = np.array(kinds)
    status, bits = runtime().calls(
        stream.table, kind, np.array(numbers), stream.readings[sources], stream.samples_per_block
    )
    expected = _expected(stream)
    np.testing.assert_array_equal(status[kind == _SAMPLE, 0], expected.sample_status)
    np.testing.assert_array_equal(bits[kind == _SAMPLE, 0], expected.bits)


@pytest.mark.parametrize("numeric", NUMERICS)
@examples(30)
@given(data=st.data())
def test_a_history_that_is_read_in_parts_is_the_whole_history(numeric: Numeric, data: st.DataObject) -> None:
    stream = data.draw(streams(numeric))
    cuts = sorted(data.draw(st.sets(st.integers(1, max(1, len(stream) - 1)), max_size=6)))
    history = follow_history(
        stream.table, stream.readings, missed=stream.lost, samples_per_block=stream.samples_per_block
    )
    parts = [history.rows(slice(a, b)) for a, b in zip([0, *cuts], [*cuts, len(stream)], strict=True)]
    expected = _expected(stream)
    for name in ("sample_status", "status", "bits", "missed_status", "block_valid", "begun", "age"):
        joined: Words = np.concatenate([getattr(part, name) for part in parts])
        np.testing.assert_array_equal(joined, getattr(expected, name), err_msg=name)


@pytest.mark.parametrize("numeric", NUMERICS)
@examples(45)
@given(data=st.data())
def test_a_table_is_within_its_stated_bound_of_the_model(numeric: Numeric, data: st.DataObject) -> None:
    """For any input, within the envelope and beyond it, at centers of Gaussians and at edges of regions."""
    number = data.draw(st.integers(0, 200).filter(lambda k: drawn_table(numeric, k) is not None))
    table, model = drawn_table(numeric, number), variant(number)
    assert table is not None
    (t0, t1), (r0, r1) = model.envelope.temperature_c, model.envelope.slope_c_per_min
    boxes = [model.envelope, *(network.region for network in model.networks if network.region is not None)]
    marks_c = [*(end for box in boxes for end in box.temperature_c), *(c[0] for n in model.networks for c in n.centers)]
    marks_r = [
        *(end for box in boxes for end in box.slope_c_per_min),
        *(c[1] for n in model.networks for c in n.centers),
    ]
    temperature_c = st.floats(1.2 * t0 - 0.2 * t1, 1.2 * t1 - 0.2 * t0) | st.sampled_from(marks_c)
    slope_c_per_min = st.floats(1.2 * r0 - 0.2 * r1, 1.2 * r1 - 0.2 * r0) | st.sampled_from(marks_r)
    points = np.array(data.draw(st.lists(st.tuples(temperature_c, slope_c_per_min), min_size=1, max_size=50)))
    inputs = table.encode_inputs(points * [1.0, model.block_s / 60.0])
    status, bits = runtime().maps(table, inputs)
    t, slope = table.decode_inputs(inputs).T
    exact = model.map_dph(t, slope * 60.0 / model.block_s)
    assert np.all(status >= 0)
    assert np.max(np.abs(table.decode_bias(bits) - exact)) <= table.error_bound_dph
