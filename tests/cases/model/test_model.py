"""The model file: what is written reads back equal, and whatever was tampered with is refused by name."""

from __future__ import annotations

import copy
import json
import math
import random
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from conftest import ROOT
from gyrotc.common import InputError
from gyrotc.model import Model, load_model, table_id


def test_a_saved_model_reads_back_equal_with_the_same_hash(model_dict: dict[str, Any], tmp_path: Path) -> None:
    model = Model.from_dict(model_dict)
    model.save(tmp_path / "model.json")
    again = load_model(tmp_path / "model.json")
    assert again == model
    assert again.hash == model.hash
    assert (tmp_path / "model.json").read_text().endswith("}\n")
    assert list(json.loads(model.to_json())) == [*model_dict, "checksum"]
    assert json.loads(model.to_json())["checksum"] == model.hash


def test_no_flipped_bit_makes_another_model(model_dict: dict[str, Any], tmp_path: Path) -> None:
    """Of 5000 flips 995 were taken as another model; now none, wherever the bit stands."""
    model = Model.from_dict(model_dict)
    data = model.to_json().encode("ascii")
    seed = random.SystemRandom().randrange(2**32)
    print(f"seed {seed}")
    draw = random.Random(seed)
    file = tmp_path / "model.json"
    refused = 0
    for _ in range(5000):
        damaged = bytearray(data)
        damaged[draw.randrange(len(data))] ^= 1 << draw.randrange(8)
        file.write_bytes(damaged)
        try:
            assert load_model(file) == model  # white space between the fields
        except InputError:
            refused += 1
    assert refused > 3000


@pytest.mark.parametrize("checksum", [None, "0" * 64, 7], ids=["missing", "another", "number"])
def test_a_model_changed_by_hand_is_refused(model_dict: dict[str, Any], tmp_path: Path, checksum: Any) -> None:
    file = tmp_path / "model.json"
    file.write_text(json.dumps(model_dict | ({} if checksum is None else {"checksum": checksum})))
    with pytest.raises(InputError, match=r"field checksum: is .*build it again") as caught:
        load_model(file)
    assert len(str(caught.value).splitlines()) == 1


def test_map_is_the_paper_s_equation(model_dict: dict[str, Any]) -> None:
    """Eq. (1), (2) written out with math.exp for one point."""
    z_t, z_r = (5.0 - 10.0) / 50.0, 0.3
    expected = 0.007 + 0.0003 * z_t - 0.0001 * z_r
    expected += 0.001 * math.exp(-(((z_t - (-30.0 / 50.0)) / 0.5) ** 2) - ((z_r - 0.2) / 1.0) ** 2)
    expected += -0.0005 * math.exp(-(((z_t - 20.0 / 50.0) / 0.8) ** 2))
    assert Model.from_dict(model_dict).map_dph(5.0, 0.3) == pytest.approx(expected, rel=1e-14)


def test_inputs_outside_the_envelope_give_the_value_at_its_edge(model_dict: dict[str, Any]) -> None:
    model = Model.from_dict(model_dict)
    assert model.map_dph(500.0, -9.0) == model.map_dph(60.0, -1.0)


def test_sigma_is_that_of_the_cell_and_of_no_training_where_none_was(model_dict: dict[str, Any]) -> None:
    """The coverage has four by two cells, sigma two by one: that of -15 to 10 C and rising T was not trained."""
    known = {"cells": [2, 1], "rows": [[0.001, 0.002]], "uncovered": [[0.01, 0.02]]}
    model = Model.from_dict(model_dict | {"uncertainty_dph": known})
    t, slope = np.array([-99.0, -20.0, -5.0, -5.0, 99.0]), np.array([-9.0, -0.5, -0.5, 0.5, 0.0])
    sigma = model.sigma_dph(t, slope)
    assert sigma is not None and sigma.tolist() == [0.001, 0.001, 0.001, 0.01, 0.002]
    assert Model.from_dict(model_dict).sigma_dph(t, slope) is None


def test_zeroed_at_gives_zero_there_and_shifts_nothing_else(model_dict: dict[str, Any]) -> None:
    model = Model.from_dict(model_dict)
    zeroed = model.zeroed_at(20.0)
    assert abs(float(zeroed.map_dph(20.0, 0.0))) < 1e-17
    t = np.linspace(-40, 60, 7)
    shift = zeroed.map_dph(t, 0.1) - model.map_dph(t, 0.1)
    assert np.ptp(shift) < 1e-16
    assert zeroed.fallback_dph - model.fallback_dph == pytest.approx(shift[0])


def test_a_bank_is_continuous_over_the_overlap_of_its_regions(model_dict: dict[str, Any]) -> None:
    low, high = copy.deepcopy(model_dict["networks"][0]), copy.deepcopy(model_dict["networks"][0])
    low["region"] = {"temperature_c": [-40.0, 15.0], "slope_c_per_min": [-1.0, 1.0]}
    high |= {"w0": 0.009, "region": {"temperature_c": [5.0, 60.0], "slope_c_per_min": [-1.0, 1.0]}}
    model = Model.from_dict(model_dict | {"networks": [low, high]})
    t = np.linspace(-40, 60, 20001)
    assert np.abs(np.diff(model.map_dph(t, np.zeros_like(t)))).max() < 2e-5
    assert model.map_dph(60.0, 0.0) - model.map_dph(-40.0, 0.0) > 0.001


def test_ids_follow_the_serial_and_never_collide_where_information_is_lost() -> None:
    assert table_id("RLG-0042", None) == "rlg_0042"
    assert table_id("RLG-0042", "x") == "rlg_0042_x"
    assert table_id("a.b", None) != table_id("a_b", None)
    assert len(table_id("s" * 64, "z")) == 27
    assert table_id("s" * 64, "z") != table_id("s" * 63, "z")


def test_no_serial_takes_a_name_of_the_runtime() -> None:
    """Files and macros that a table brings differ from those of the runtime, whatever the serial."""
    sources = [p for folder in ("include", "libc") for p in (ROOT / folder).glob("gtc*.[ch]")]
    files = {"gtc", "gtc_f32", "gtc_q31"}  # gtc.h, gtc_f32.c, gtc_q31.c
    macros = set(re.findall(r"# *define (GTC_\w+)", "".join(p.read_text("utf-8") for p in sources)))
    assert files <= {p.stem for p in sources}
    assert {"GTC_E_ID", "GTC_TABLE_H_INCLUDED"} <= macros
    words = {name.removeprefix("gtc_") for name in files} | {m.split("_")[1].lower() for m in macros}
    for serial in {*"abcdefghijklmnopqrstuvwxyz0123456789", *words}:
        name = table_id(serial, None)
        assert re.fullmatch("[a-z0-9_]{1,23}|[a-z0-9_]{1,18}_[0-9a-f]{8}", name)
        assert f"gtc_{name}" not in files, serial
        assert not {f"GTC_{name.upper()}_{end}" for end in ("ID", "H_INCLUDED")} & macros, serial
