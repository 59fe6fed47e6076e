"""Learning in service beside a table: what is emitted is proven on targets; limits files say what is learned."""

from __future__ import annotations

import json
import subprocess
from pathlib import Path

import numpy as np
import pytest
from conftest import run_here
from gyrotc.assess.limits import load_limits
from gyrotc.assess.product_guards import BuiltUnit
from gyrotc.common.errors import InputError
from gyrotc.mirror.learning import E_ID, E_IMAGE, KEPT_WORDS, OK, REFUSED, Learner
from gyrotc.model import BiasSpread, Learning, Model, load_model
from gyrotc.tables.emit import data_sheet_spread, emit, prior_of
from gyrotc.verify.job import verify
from gyrotc.verify.replay import drawn_calls, expected_words

GOLDEN = Path(__file__).resolve().parents[2] / "c" / "model.json"
FIRMWARE = "cortex-m4f"


def learning_model() -> Model:
    known = Learning(
        spread=data_sheet_spread(2e-4, 1e-4, 2e-4), reference_c=20.0, authority_dph=0.03, noise_deg_per_sqrt_h=5e-4
    )
    return load_model(GOLDEN).model_copy(update={"learning": known})


@pytest.mark.parametrize("numerics", [None, ("q31",)])
def test_targets_learn_save_and_restore_as_the_mirror_does(numerics: tuple[str, ...] | None, tmp_path: Path) -> None:
    """Also beside a table in fixed point alone on a processor without floating point; a write is cut off everywhere."""
    model = learning_model()
    model.save(tmp_path / "model.json")
    assert load_model(tmp_path / "model.json").learning == model.learning
    emit(model, tmp_path, numerics=numerics)
    targets = ("host-gcc-O2", "cortex-m0" if numerics else FIRMWARE)
    found = verify(tmp_path, targets=targets)
    assert found.failed == 0
    learned = [entry.learned for entry in found.targets if entry.learned is not None]
    assert len(learned) == len({entry.name for entry in found.targets if entry.status != "missing"})
    assert all(one.calls > 100 and one.mismatches == 0 for one in learned)


@pytest.mark.parametrize("numeric", ["f32", "q31"])
def test_the_emitted_example_learns_and_its_words_come_back(numeric: str, tmp_path: Path) -> None:
    """main.c as it stands: a rest, the shift, the kept words, which recalibrate reads."""
    learning_model().save(tmp_path / "model.json")
    run_here("emit", tmp_path / "model.json", "--numeric", numeric, "--out", tmp_path)
    c = tmp_path / "c"
    sources = [c / "main.c", c / "gtc.c", c / f"gtc_{learning_model().id}.c"]
    strict = ("-std=c99", "-Wall", "-Wextra", "-Werror", "-pedantic")
    subprocess.run(["gcc", *strict, f"-I{c}", *sources, "-o", tmp_path / "main"], check=True)
    lines = subprocess.run([tmp_path / "main"], check=True, capture_output=True, text=True).stdout.splitlines()
    assert lines[0].startswith("bias") and lines[1].startswith("shift: 0.000000 +- 0.000")
    (tmp_path / "words.txt").write_text("\n".join(lines[2:]))
    told = run_here("recalibrate", tmp_path, "--learned", tmp_path / "words.txt")
    assert "after 1 power-ons" in told and "the table holds" in told


def test_a_fixed_point_build_says_that_learning_is_float32(tmp_path: Path) -> None:
    model = learning_model()
    model.save(tmp_path / "model.json")
    for numeric, said in (("q31", True), ("f32", False)):
        told = run_here("emit", tmp_path / "model.json", "--numeric", numeric, "--out", tmp_path / numeric)
        assert ("learning in service is float32" in told) == said


def test_the_calls_reach_what_they_are_for(tmp_path: Path) -> None:
    model = learning_model()
    tables = emit(model, tmp_path).tables
    prior = prior_of(model, tables)
    assert prior is not None
    calls = drawn_calls(prior)
    rows = expected_words(prior, calls)
    statuses = rows[:, 0].view(np.int32)
    kinds = np.array([call.kind for call in calls])
    assert {OK, REFUSED} <= set(statuses[kinds == 2].tolist())
    torn = statuses[kinds == 5]
    assert torn[0] == OK and torn[-1] == OK and (torn[3:KEPT_WORDS] == E_IMAGE).all()
    assert len(np.unique(rows[:, 1 : 1 + 104], axis=0)) > 40  # states


def test_words_of_an_older_table_are_refused(tmp_path: Path) -> None:
    """Of the same gyro, too: a shift on top of one table does not come on top of the next."""
    model = learning_model()
    newer = model.model_copy(update={"fallback_dph": model.fallback_dph + 1e-3})
    priors = [prior_of(one, emit(one, tmp_path / name).tables) for one, name in ((model, "a"), (newer, "b"))]
    assert priors[0] is not None and priors[1] is not None
    words = Learner(priors[0]).save()
    assert [Learner(prior).restore(words) for prior in priors if prior] == [OK, E_ID]


def test_a_changed_prior_is_found(tmp_path: Path) -> None:
    model = learning_model()
    model.save(tmp_path / "model.json")
    emit(model, tmp_path)
    source = tmp_path / "c" / f"gtc_{model.id}.c"
    text = source.read_text()
    assert ".authority_dph = 0.0299999993F," in text
    source.write_text(text.replace(".authority_dph = 0.0299999993F,", ".authority_dph = 0.299999993F,"))
    assert [f.file for f in verify(tmp_path, compiled=False).emitted if f.status == "fail"] == [source.name]
    found = verify(tmp_path, targets=("host-gcc-O2",), trust_code=True)
    assert found.targets[0].learned is not None and found.targets[0].status == "pass"  # no call comes near it
    source.write_text(text.replace(".span_c = 1.5F,", ".span_c = 15.0F,"))
    found = verify(tmp_path, targets=("host-gcc-O2",), trust_code=True)
    assert found.targets[0].learned is not None and found.targets[0].learned.mismatches > 0


def test_a_limits_file_says_what_may_be_learned(tmp_path: Path) -> None:
    path = tmp_path / "limits.toml"
    path.write_text(
        "schema = 1\n[learning]\nauthority_dph = 0.03\ntable_dph = 2e-4\nturn_on_dph = 1e-4\n"
        "ageing_dph_per_sqrt_month = 2e-4\nnoise_deg_per_sqrt_h = 5e-4\nreference_c = 20.0\n"
    )
    limits = load_limits(path)
    model = load_model(GOLDEN)
    assert limits.learning is not None
    assert limits.learning.of(model, BuiltUnit(), str(path)) == learning_model().learning
    spread = data_sheet_spread(1.0, 2.0, 3.0)
    numbers = "\n".join(f"{name} = {value!r}" for name, value in json.loads(spread.model_dump_json()).items())
    path.write_text(
        f"schema = 1\n[learning]\nauthority_dph = 9.0\nnoise_deg_per_sqrt_h = 0.1\n[learning.spread]\n{numbers}\n"
    )
    stated = load_limits(path).learning
    assert stated is not None and stated.of(model, BuiltUnit(), str(path)).spread == BiasSpread(**dict(spread))
    path.write_text("schema = 1\n[learning]\nauthority_dph = 0.03\n")
    bare = load_limits(path).learning
    assert bare is not None
    with pytest.raises(InputError, match=r"limits.toml, field learning.noise_deg_per_sqrt_h: is missing"):
        bare.of(model.model_copy(update={"uncertainty_dph": None}), BuiltUnit(), str(path))
    path.write_text("schema = 1\n[learning]\nauthority_dph = 9.0\ntable_dph = 3.0\nnoise_deg_per_sqrt_h = 1e-4\n")
    few = load_limits(path).learning
    assert few is not None and model.between_dph < 3.0
    agreeing = few.of(model, BuiltUnit(), str(path)).spread
    assert agreeing.turn_on == 3.0  # runs that agree show no less than the table's sigma
    path.write_text("schema = 1\n[learning]\ntable_dph = 1e-4\n")
    with pytest.raises(InputError, match="authority_dph"):
        load_limits(path)
