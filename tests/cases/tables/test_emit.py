"""Emission is a pure function of the model; what the rounding costs is bounded, reported and refused."""

from __future__ import annotations

import hashlib
import re
import subprocess
import sys
import zlib
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from conftest import EXAMPLE, GOLDEN, ROOT, Command
from gyrotc.common import CheckFailed, InputError
from gyrotc.mirror import MAGIC, Table, evaluate_map, gauss
from gyrotc.model import Guard, Model, Term, load_model
from gyrotc.tables import (
    NUMERICS,
    board_test_sources,
    emit,
    emit_texts,
    expected_answers,
    joint_needs,
    needs_of,
    quantise,
    quantise_all,
    rms_growth,
    runtime_texts,
)
from models import random_model

# The runtime beside the tables is a copy of libc/, which its own tests hold.
RUNTIME = {"gtc.h", "gtc_f32.c", "gtc_q31.c", "emission.json"}  # the record has the hashes of the others


def _golden_texts() -> dict[str, bytes]:
    model = load_model(EXAMPLE / "model.json")
    emission = quantise_all(model, None)
    return emit_texts(model, emission) | board_test_sources(model, emission)


def test_emitted_files_are_the_golden_ones() -> None:
    """Long files by their SHA-256, the table itself in full, so that a change shows in review."""
    sums = dict(reversed(line.split()) for line in (GOLDEN / "SHA256SUMS").read_text().splitlines())
    texts = _golden_texts()
    assert set(texts) - RUNTIME == set(sums)
    for name in ("gtc_rlg_0042.c", "gtc_rlg_0042.h", "main.c"):
        assert texts[name].decode() == (EXAMPLE / name).read_text()
    found = {name: hashlib.sha256(texts[name]).hexdigest() for name in sums}
    assert found == sums


def test_emitted_text_names_no_time_path_or_version() -> None:
    from gyrotc import __version__

    for name, data in _golden_texts().items():
        text = data.decode("latin-1")
        if name in RUNTIME or not name.endswith((".c", ".h")):
            continue
        assert __version__ not in text
        assert str(Path.home()) not in text and "/tmp" not in text


def test_emit_replaces_the_folder_whole(tmp_path: Path) -> None:
    model = load_model(EXAMPLE / "model.json")
    emit(model, tmp_path)
    assert list((tmp_path / "c").glob("*_q31.bin"))
    emit(model, tmp_path, numerics=["f32"])
    assert not list((tmp_path / "c").glob("*_q31.bin"))
    assert sorted(p.name for p in tmp_path.iterdir()) == ["SHA256SUMS", "c", "model.json"]


def test_emit_deletes_no_folder_of_somebody_else(tmp_path: Path) -> None:
    (tmp_path / "c").mkdir()
    (tmp_path / "c" / "firmware.c").write_text("years of work")
    with pytest.raises(InputError, match="was not written by gyrotc"):
        emit(load_model(EXAMPLE / "model.json"), tmp_path)
    assert [p.relative_to(tmp_path).as_posix() for p in tmp_path.rglob("*")] == ["c", "c/firmware.c"]


def test_main_compiles_as_it_stands_and_prints_the_bias_of_the_model(tmp_path: Path) -> None:
    model = load_model(EXAMPLE / "model.json")
    emit(model, tmp_path)
    c = tmp_path / "c"
    program = tmp_path / "main"
    sources = [c / "main.c", c / "gtc_f32.c", c / f"gtc_{model.id}.c"]
    flags = ["-std=c99", "-ffp-contract=off", "-Wall", "-Wextra", "-Werror"]
    subprocess.run(["gcc", *flags, "-o", program, *sources], check=True)
    printed = subprocess.run([program], capture_output=True, text=True, check=True).stdout
    temperature, bias = float(printed.split()[2]), float(printed.split()[4])
    assert bias == pytest.approx(float(model.map_dph(temperature, 0.0)), abs=2e-6)


#: Readings of a supply of 27 ... 29 V, accepted in that range, 28.4 V where it is lost; what its term then adds, deg/h.
READINGS = {
    "28.40000F": 0.004,
    "0.0F": -0.01,
    "(float)4095": 0.01,
    "1e20F": 0.01,
    "(0.0F / (float)argc - 1e38F * 1e38F)": 0.004,
}


@pytest.mark.parametrize("reading", READINGS)
def test_main_prints_no_wild_correction_whatever_a_channel_reads(reading: str, tmp_path: Path) -> None:
    """It fed 0 V to a supply that trained at 28 V, and printed -0.28 deg/h for a true 0.0073.

    As emitted it feeds what is used where the channel is lost.
    """
    term = Term(id="auxiliary", parameters={"slope_dph_per_unit": 0.01, "reference": 28.0}, channel="supply_v")
    guard = Guard(
        low=27.0, high=29.0, max_step=2.0, max_rate_per_min=0.0, agree_s=1.0, stuck_s=0.0,
        missing_s=300.0, fallback=28.4,
    )  # fmt: skip
    model = random_model(4, terms=(term,), guards={"supply_v": guard})
    emit(model, tmp_path)
    c = tmp_path / "c"
    emitted = (c / "main.c").read_text("ascii")
    assert emitted.count("28.40000F") == 1
    fed = emitted.replace("28.40000F", reading).replace("main(void)", "main(int argc, char **argv)")
    longer, turns = re.subn(r"k < \d+;", "k < 2100;", fed)  # two blocks of 10 s
    assert turns == 1
    (c / "main.c").write_text(longer, "ascii")
    sources = [c / "main.c", c / "gtc_f32.c", c / f"gtc_{model.id}.c"]
    subprocess.run(["gcc", "-std=c99", "-ffp-contract=off", "-w", "-o", tmp_path / "main", *sources], check=True)
    printed = subprocess.run([tmp_path / "main"], capture_output=True, text=True, check=True).stdout
    temperature, bias = float(printed.split()[2]), float(printed.split()[4])
    expected = float(model.map_dph(temperature, 0.0)) + READINGS[reading]
    assert bias == pytest.approx(expected, abs=2e-6)


def test_intel_hex_holds_the_image() -> None:
    texts = _golden_texts()
    data = bytearray()
    for line in texts["gtc_rlg_0042.hex"].decode().split():
        raw = bytes.fromhex(line[1:])
        assert sum(raw) % 256 == 0
        if raw[3] == 0:
            assert int.from_bytes(raw[1:3], "big") == len(data) % 65536
            data += raw[4:-1]
    assert bytes(data) == texts["gtc_rlg_0042.bin"]


def test_zero_at_emits_a_table_that_is_zero_there_and_verifies(tmp_path: Path, gyrotc: Command) -> None:
    done = gyrotc("emit", EXAMPLE / "model.json", "--out", tmp_path, "--zero-at", "20")
    assert done.returncode == 0, done.stderr
    assert "--zero-at 20" in (tmp_path / "c" / "gtc_rlg_0042.h").read_text()
    verified = gyrotc("verify", tmp_path, "--target", "host-gcc-O2")
    assert verified.returncode == 0, verified.stdout + verified.stderr


LEFT_OUT = ("uncertainty", "rezero", "coverage", "known_answers", "image", "saved_state", "time")


def test_what_a_product_does_not_need_is_in_neither_table_nor_runtime(tmp_path: Path, gyrotc: Command) -> None:
    """The map stays, bit for bit; the header names what is missing, and the small runtime passes every vector."""
    whole = load_model(ROOT / "examples" / "nav_loop" / "filter_model.json")
    assert whole.coverage is not None and whole.uncertainty_dph is not None
    model = whole.model_copy(update={"left_out": LEFT_OUT})
    tables = quantise_all(model, None).tables
    for numeric, table in quantise_all(whole, None).tables.items():
        small = tables[numeric]
        assert (small.coverage.size, small.sigma.size, small.probes.size, small.rezero) == (0, 0, 0, 0)
        assert np.array_equal(small.centers, table.centers) and small.authority != ()
    model.save(tmp_path / "model.json")
    out = tmp_path / "result"
    assert gyrotc("emit", tmp_path / "model.json", "--out", out).returncode == 0
    runtime = "".join((out / "c" / name).read_text() for name in ("gtc.h", "gtc_f32.c", "gtc_q31.c"))
    code = re.sub(r"/\*.*?\*/", "", runtime, flags=re.DOTALL)
    for absent in ("_snapshot(", "_rezero(", "_open(", "_save(", "_restore(", "UNCOVERED;", "probes_agree"):
        assert absent not in code, absent
    assert f"#define GTC_MAX_SLOPE_BLOCKS {model.slope_blocks}\n" in runtime
    header = (out / "c" / "gtc_sim_0003.h").read_text()
    assert " * Left out:    uncertainty, rezero, coverage, known answers, image, saved state, time" in header
    done = gyrotc("verify", out, "--target", "host-gcc-O2")
    assert done.returncode == 0, done.stdout + done.stderr
    checked = subprocess.run(
        [sys.executable, str(ROOT / "tools" / "check_table.py"), str(out)], capture_output=True, check=False
    )
    assert checked.returncode == 0, checked.stdout


def test_the_board_test_is_written_where_it_is_asked_for(tmp_path: Path, gyrotc: Command) -> None:
    """It is not beside the files that firmware compiles, and its answers are larger than all of these."""
    out, board = tmp_path / "result", tmp_path / "board"
    for _ in range(2):  # a second call replaces what the first one wrote
        assert gyrotc("emit", EXAMPLE / "model.json", "--out", out, "--board", board).returncode == 0
    names = {"board_test.c", "vectors_rlg_0042.h", "answers.txt"}
    assert {path.name for path in board.iterdir()} - {"SHA256SUMS"} == names
    assert not names & {path.name for path in (out / "c").iterdir()}
    model = load_model(EXAMPLE / "model.json")
    rows = expected_answers(model, quantise_all(model, None))
    lines = [f"{status:08x} {bits:08x}" for numeric in rows for status, bits in rows[numeric].tolist()]
    assert [line for line in (board / "answers.txt").read_text("ascii").splitlines() if line[0] != "b"] == lines
    assert sum((board / name).stat().st_size for name in names - {"answers.txt"}) < 100_000


def test_nothing_is_emitted_if_the_board_test_cannot_be_written(tmp_path: Path, gyrotc: Command) -> None:
    out, foreign = tmp_path / "result", tmp_path / "foreign"
    foreign.mkdir()
    (foreign / "notes.txt").write_text("of somebody else\n")
    for place in (foreign, foreign / "notes.txt", out, out / "c"):
        done = gyrotc("emit", EXAMPLE / "model.json", "--out", out, "--board", place)
        assert done.returncode == 2 and len(done.stderr.splitlines()) == 1
        assert not out.exists()
    assert (foreign / "notes.txt").read_text() == "of somebody else\n"


def test_the_runtime_of_several_tables_has_what_each_needs() -> None:
    one, other = random_model(3), random_model(4).model_copy(update={"left_out": ("image", "time")})
    both = runtime_texts(joint_needs([needs_of(one), needs_of(other)]), NUMERICS)
    assert b"gtc_f32_open(" in both["gtc.h"] and b"gtc_q31_open(" in both["gtc_q31.c"]
    assert f"#define GTC_MAX_SLOPE_BLOCKS {max(one.slope_blocks, other.slope_blocks)}\n".encode() in both["gtc.h"]
    assert b"gtc_f32_open(" not in runtime_texts(needs_of(other), NUMERICS)["gtc.h"]


def test_a_serial_cannot_break_out_of_its_comment(model_dict: dict[str, Any]) -> None:
    model = Model.from_dict(model_dict | {"meta": {"operator": "x */ int hidden; /*", "note": "a\nb\tc é"}})
    text = emit_texts(model, quantise_all(model, None))["gtc_rlg_0042.h"].decode("ascii")
    assert "*/ int hidden" not in text
    assert text.count("/*") == text.count("*/")


def test_the_example_builds_from_the_library_s_folders_by_its_one_command(tmp_path: Path) -> None:
    """Copying include/ and libc/ is the installation; the example's README gives the command."""
    line = next(t for t in (EXAMPLE / "README.md").read_text().splitlines() if " && cc " in t)
    command = line.replace("build", str(tmp_path / "build"))
    done = subprocess.run(["sh", "-c", command], cwd=EXAMPLE, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert "deg/h" in done.stdout and not done.stderr
    assert (
        (ROOT / "libc" / "README.md").read_text().startswith("libc = the C library of gyrotc that runs on the target")
    )


C_TESTS = Path(__file__).resolve().parents[2] / "c"


def worst_error(model: Model, table: Table, seed: int) -> float:
    """Largest |map - model| over random inputs of the envelope, deg/h."""
    (t0, t1), (r0, r1) = model.envelope.temperature_c, model.envelope.slope_c_per_min
    rng = np.random.default_rng(seed)
    points = rng.uniform([t0, r0 / 6.0], [t1, r1 / 6.0], (20000, 2))
    inputs = table.encode_inputs(points)
    _, bits = evaluate_map(table, inputs)
    t, slope = table.decode_inputs(inputs).T
    return float(np.max(np.abs(table.decode_bias(bits) - model.map_dph(t, 6.0 * slope))))


@pytest.mark.parametrize("numeric", NUMERICS)
@pytest.mark.parametrize("seed", range(12))
def test_the_bound_is_above_the_worst_error_found_and_not_far(numeric: str, seed: int) -> None:
    model = random_model(seed)
    table = quantise(model, numeric)
    worst = worst_error(model, table, seed)
    assert worst <= table.error_bound_dph
    assert table.error_bound_dph < 100.0 * worst
    assert sum(table.bound_parts_dph.values()) == pytest.approx(table.error_bound_dph)


@pytest.mark.parametrize("numeric", NUMERICS)
def test_the_cost_of_rounding_is_stated_beside_the_noise(numeric: str) -> None:
    """A bound of 3/4 of the noise floor raises the RMS by a quarter; the table is made nevertheless."""
    table = quantise(random_model(1), numeric)
    assert rms_growth(random_model(1, noise_floor_dph=None), table) is None
    noisy = random_model(1, noise_floor_dph=4.0 / 3.0 * table.error_bound_dph, noise_floor_source="estimated")
    assert quantise(noisy, numeric).words[:-1] == table.words[:-1]
    assert rms_growth(noisy, table) == pytest.approx(0.25)


def test_an_unknown_arithmetic_is_refused() -> None:
    with pytest.raises(InputError, match="f32"):
        quantise(random_model(0), "q15")


@pytest.mark.parametrize("numeric", NUMERICS)
def test_the_words_are_those_of_layout_3(numeric: str) -> None:
    model = random_model(4)
    table = quantise(model, numeric)
    words = table.words
    assert words[0] == MAGIC
    assert words[1] == 3 + 65536 * {"f32": 1, "q31": 2}[numeric]
    assert words[2] == len(words)
    assert words[5] == table.id == zlib.crc32(b"rlg_4")
    assert words[-1] == zlib.crc32(np.array(words[1:-1], dtype="<u4").tobytes())
    assert table.parameter_bytes == 24 + 20 * model.n_centers


def test_the_same_model_gives_the_same_words() -> None:
    assert quantise(random_model(7), "f32").words == quantise(random_model(7), "f32").words


def _scaled(model_dict: dict[str, Any], factor: float, **fields: Any) -> Model:
    """The model with all biases multiplied."""
    networks = [
        network
        | {"w0": factor * network["w0"]}
        | {name: [factor * x for x in network[name]] for name in ("linear", "weights")}
        for network in model_dict["networks"]
    ]
    fallback = factor * model_dict["fallback_dph"]
    return Model.from_dict(model_dict | {"networks": networks, "fallback_dph": fallback} | fields)


def test_the_unit_of_fixed_point_does_not_follow_the_weights(model_dict: dict[str, Any]) -> None:
    """Every calibration of a product has the unit of the one before, or none that another firmware would take."""
    found = [quantise(_scaled(model_dict, k), "q31").bias_frac_bits for k in (0.4, 1.0, 1.33, 20.0)]
    assert found == [24] * 4
    with pytest.raises(CheckFailed, match="state a smaller q31_bias_frac_bits"):
        quantise(_scaled(model_dict, 1e4), "q31")


def test_there_is_room_for_a_re_zero_in_fixed_point(model_dict: dict[str, Any]) -> None:
    table = quantise(_scaled(model_dict, 1.0, rezero_dph=0.9), "q31")
    assert table.decode_bias([table.rezero])[0] == pytest.approx(0.9, abs=1e-7)
    with pytest.raises(CheckFailed, match="re-zero"):
        quantise(_scaled(model_dict, 1.0, rezero_dph=64.0), "q31")


def test_the_unit_that_a_product_states_is_the_table_s(model_dict: dict[str, Any]) -> None:
    model = _scaled(model_dict, 1.0, q31_bias_frac_bits=30)
    assert Model.from_dict(model.to_dict()) == model
    assert quantise(model, "q31").bias_frac_bits == 30
    with pytest.raises(CheckFailed, match="in the product's unit of 2\\^-40 deg/h"):
        quantise(_scaled(model_dict, 1.0, q31_bias_frac_bits=40), "q31")


def test_the_gaussian_is_as_good_as_the_bound_says() -> None:
    u = np.linspace(0.0, 2047.4, 300001).astype(np.float32)
    relative = gauss(u) / np.exp2(-u.astype(np.float64) / 64.0) - 1.0
    assert np.max(np.abs(relative)) < 4.3 * 2.0**-24
    assert gauss(np.array([2048.0, 1e30, np.inf], dtype=np.float32)).tolist() == [0.0, 0.0, 0.0]


@pytest.mark.parametrize("numeric", NUMERICS)
def test_the_table_of_the_c_tests_is_the_one_that_its_model_gives(numeric: str) -> None:
    table = quantise(load_model(C_TESTS / "model.json"), numeric)
    text = (C_TESTS / "table" / "gtc_test_1.c").read_text(encoding="ascii")
    start = text.index(f"gtc_{numeric}_table_t gtc_test_1_{numeric} =")
    found = re.search(r"\.crc = (0x[0-9a-f]+)UL", text[start:])
    assert found is not None
    assert int(found[1], 16) == table.crc, "run tests/c/make_table.py"
