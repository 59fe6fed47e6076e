"""Guards from a product file: down to the words of the table, and refused where they are wrong."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from gyrotc.assess.limits import load_limits
from gyrotc.assess.product_guards import guarded
from gyrotc.common.errors import InputError
from gyrotc.model import Guard, Model, Term
from gyrotc.tables.emit import emit_texts, quantise_all
from gyrotc.tables.quantise import quantise
from gyrotc.target.history import replay
from gyrotc.target.status import CHANNEL_LOST, CLAMPED, FALLBACK, HELD
from models import random_model

_TERM = Term(id="auxiliary", parameters={"slope_dph_per_unit": 0.01, "reference": 28.0}, channel="supply_v")
_TRAINED = Guard(
    low=27.0, high=29.0, max_step=2.0, max_rate_per_min=0.5, agree_s=1.0, stuck_s=0.0, missing_s=300.0,
    fallback=28.0,
)  # fmt: skip
_WHOLE = """schema = 1
[guards.temperature_c]
range = [-80.0, 150.0]
step = 0.25
rate_per_min = 12.0
agree_s = 3.0
stuck_s = 600.0
missing_s = 120.0
[guards.supply_v]
range = [26.0, 30.5]
step = 0.125
rate_per_min = 6.0
agree_s = 2.0
stuck_s = 900.0
missing_s = 40.0
fallback = 27.5
"""


@pytest.fixture
def trained() -> Model:
    return random_model(4, terms=(_TERM,), guards={"supply_v": _TRAINED}, slope_blocks=4)


def product(folder: Path, text: str, model: Model) -> Model:
    path = folder / "product.toml"
    path.write_text(text)
    limits = load_limits(path)
    return guarded(model, limits.guards, limits.file, ("supply_v", "pressure_hpa"))


@pytest.mark.parametrize("numeric", ["f32", "q31"])
def test_every_field_reaches_the_words_of_the_table(numeric: str, tmp_path: Path, trained: Model) -> None:
    table = quantise(product(tmp_path, _WHOLE, trained), numeric)
    unit = 1.0 if numeric == "f32" else 2.0**-16
    rate = 1.0 if numeric == "f32" else 2.0**-40
    records = table.guards.reshape(2, 8)
    numbers = table.numbers(table.guards).reshape(2, 8)
    np.testing.assert_allclose(numbers[:, :3] * unit, [[-80.0, 150.0, 0.25], [26.0, 30.5, 0.125]])
    np.testing.assert_allclose(numbers[:, 3] * rate * 60e6, [12.0, 6.0], rtol=1e-4)
    np.testing.assert_array_equal(records[:, 4], [3_000_000, 2_000_000])
    np.testing.assert_array_equal(records[:, 5], [600_000_000, 900_000_000])
    np.testing.assert_array_equal(records[:, 6], [12, 4])  # blocks of 10 s
    assert numbers[1, 7] * unit == 27.5


def test_the_emitted_source_shows_them(tmp_path: Path, trained: Model) -> None:
    model = product(tmp_path, _WHOLE, trained)
    text = emit_texts(model, quantise_all(model, ("f32",)))[f"gtc_{model.id}.c"].decode()
    assert "V(-80.0F), V(150.0F), V(0.25F), " in text
    assert "V(26.0F), V(30.5F), V(0.125F), " in text
    assert Model.from_dict(model.to_dict()).hash == model.hash != trained.hash


def test_what_is_left_out_stays_as_training_showed_it(tmp_path: Path, trained: Model) -> None:
    assert product(tmp_path, "schema = 1\n", trained) == trained
    found = product(tmp_path, "schema = 1\n[guards.supply_v]\nstuck_s = 60.0\n", trained)
    assert found.guards["supply_v"] == _TRAINED.model_copy(update={"stuck_s": 60.0})
    assert quantise(found, "f32").guards[:8].tolist() == quantise(trained, "f32").guards[:8].tolist()
    # recorded, and not in the table
    assert product(tmp_path, "schema = 1\n[guards.pressure_hpa]\nstuck_s = 60.0\n", trained) == trained


def test_the_runtime_believes_what_the_product_file_says(tmp_path: Path, trained: Model) -> None:
    """Outside of the product's range a temperature is held, then lost; a channel is clamped, then lost."""
    model = product(tmp_path, _WHOLE, trained)
    table = quantise(model, "f32")
    middle = sum(model.envelope.temperature_c) / 2.0
    rng = np.random.default_rng(1)
    channels = np.column_stack([np.full(400, middle), np.full(400, 28.0)]) + rng.uniform(0.0, 0.01, (400, 2))
    channels[100:, 1] = 31.0 + rng.uniform(0.0, 0.01, 300)
    channels[200:300, 1] = np.nan
    channels[300:, 0] = 160.0 + rng.uniform(0.0, 0.01, 100)
    found = replay(table, table.encode_inputs(channels), missed=np.zeros(400, np.int64), samples_per_block=5)
    assert not found.status[99] & (CLAMPED | HELD)
    assert found.status[150] & CLAMPED
    assert found.status[250] & CHANNEL_LOST
    assert found.status[399] & FALLBACK


@pytest.mark.parametrize(
    ("text", "field", "expected"),
    [
        ("[guards.temperature_c]\nrange = [60.0, -40.0]\n", "guards.temperature_c.range", "lower end first"),
        ("[guards.temperature_c]\nrange = [-120.0, 150.0]\n", "guards.temperature_c.range", "-90 to 200"),
        ("[guards.temperature_c]\nrange = [0.0, 0.1]\n", "guards.temperature_c.range", "of the recordings"),
        ("[guards.temperature_c]\nstep = 0.0\n", "guards.temperature_c.step", "greater than 0"),
        ("[guards.temperature_c]\nstep = \"1 C\"\n", "guards.temperature_c.step", "valid number"),
        ("[guards.temperature_c]\nstuck_samples = 100\n", "guards.temperature_c.stuck_samples", "docs/limits.md"),
        ("[guards.temperature_c]\nfallback = 1.0\n", "guards.temperature_c.fallback", "from training"),
        ("[guards.supply_v]\nstuck_s = -1.0\n", "guards.supply_v.stuck_s", "greater than or equal to 0"),
        ("[guards.supply_v]\nmissing_s = nan\n", "guards.supply_v.missing_s", "finite"),
        ("[guards.supply_v]\nfallback = 40.0\n", "guards.supply_v.fallback", "within the range"),
        ("[guards.supply_v]\nrange = [28.5, 29.0]\n", "guards.supply_v.fallback", "within the range"),
        ("[guards.supply_w]\nstep = 1.0\n", "guards.supply_w", "supply_v"),
        ('file = "x"\n', "file", "docs/limits.md"),
    ],
)  # fmt: skip
def test_a_wrong_guard_is_refused_with_file_and_field(
    text: str, field: str, expected: str, tmp_path: Path, trained: Model
) -> None:
    with pytest.raises(InputError) as refused:
        product(tmp_path, "schema = 1\n" + text, trained)
    assert f"product.toml, field {field}" in str(refused.value)
    assert expected in str(refused.value)
