"""What emitted C says in words beside its numbers: comments are read back and compared with the model."""

from __future__ import annotations

import re

import pytest
from gyrotc.model import Model
from gyrotc.tables import emit_texts, quantise_all
from models import random_model, random_terms, random_uncertainty

NUMBER = r"[-+]?\d+(?:\.\d+)?(?:e[-+]\d+)?"
CENTER = re.compile(
    rf"/\* ({NUMBER}) C, ({NUMBER}) C/min; widths ({NUMBER}|infinite), ({NUMBER}|infinite); ({NUMBER}) deg/h \*/"
)


def text_of(model: Model) -> str:
    return emit_texts(model, quantise_all(model, None))[f"gtc_{model.id}.c"].decode("ascii")


def width(value: float | None) -> float | str:
    return "infinite" if value is None else pytest.approx(value, abs=5.1e-4)


@pytest.mark.parametrize("seed", [3, 8, 14])
def test_the_comment_of_each_center_says_its_place_its_widths_and_its_weight(seed: int) -> None:
    """In both arithmetics; T comes before dT/dt, and a width without end is named so."""
    model = random_model(seed)
    (network,) = model.networks
    expected = [
        (pytest.approx(t, abs=5.1e-3), pytest.approx(r, abs=5.1e-4), width(wt), width(wr), pytest.approx(w, rel=6e-4))
        for (t, r), (wt, wr), w in zip(network.centers, network.widths, network.weights, strict=True)
    ]
    found = [tuple(x if x == "infinite" else float(x) for x in row) for row in CENTER.findall(text_of(model))]
    assert found == expected * 2


@pytest.mark.parametrize("seed", [2, 5])
def test_each_row_of_terms_and_of_guards_has_the_name_of_what_it_holds(seed: int) -> None:
    terms = random_terms(seed)
    model = random_model(seed, terms=terms, uncertainty_dph=random_uncertainty(seed, len(terms)))
    text = text_of(model)
    channels = list(dict.fromkeys(term.channel for term in terms if term.channel))
    for numeric in ("f32", "q31"):
        for array, names in (("terms", [term.id for term in terms]), ("guards", ["temperature_c", *channels])):
            body = re.search(rf"{numeric}_{array}\[\d+\] =\n?\s*{{(.*?)}};", text, re.DOTALL)
            assert body is not None, array
            assert re.findall(r"/\* (\w+) \*/", body[1]) == names
