"""Tables of the map and parameters of autopilots: what a reader of the format finds, and what it loses."""

from __future__ import annotations

import csv
import json
import re
import shutil
import subprocess
from collections.abc import Iterator
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
import pytest
from conftest import ROOT, Command
from gyrotc.cli.fleet import address_of, points_of
from gyrotc.common.errors import CheckFailed, InputError
from gyrotc.deliver.export import Autopilot, Cubic, Exporting, Format, best_cubic, export
from gyrotc.deliver.grid import csv_text, grid_of
from gyrotc.model import Model, load_model
from numpy.typing import NDArray

Floats = NDArray[np.float64]
SMALL = Exporting(points=(7, 5), address=0x80040000)
TABLES: tuple[Format, ...] = ("csv", "json", "a2l", "cdf")


@pytest.fixture(scope="module")
def model() -> Model:
    return load_model(ROOT / "tests" / "c" / "model.json")


@pytest.fixture(scope="module")
def one(model: Model, tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("one")
    model.save(folder / "model.json")
    return folder


@pytest.fixture(scope="module")
def three(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("three")
    for axis in "xyz":
        (folder / axis).mkdir()
        shutil.copy(ROOT / "examples" / "triad" / f"model_{axis}.json", folder / axis / "model.json")
    return folder


def text_of(folder: Path, format: Format, tmp_path: Path, options: Exporting = SMALL) -> str:
    export(folder, format, tmp_path / "file", options)
    return (tmp_path / "file").read_text("utf-8")


# ---- the grid ----


def test_the_grid_holds_the_envelope_its_edges_and_rest(model: Model) -> None:
    for points in ((61, 25), (8, 4), (2, 2)):
        grid = grid_of(model, points)
        assert grid.bias_dph.shape == points
        for axis, span in (
            (grid.temperature_c, model.envelope.temperature_c),
            (grid.slope_c_per_min, model.envelope.slope_c_per_min),
        ):
            assert np.all(np.diff(axis) > 0) and np.allclose(axis[[0, -1]], span, rtol=1e-7)
            assert np.array_equal(axis, axis.astype(np.float32))
        assert 0.0 in grid.slope_c_per_min or points[1] == 2


def test_an_envelope_without_width_has_one_point(model: Model) -> None:
    still = model.model_copy(update={"envelope": model.envelope.model_copy(update={"slope_c_per_min": (0.0, 0.0)})})
    grid = grid_of(still)
    assert grid.bias_dph.shape == (61, 1) and np.isfinite(grid.largest_dph)


def test_what_is_lost_between_the_points_is_what_is_reported(model: Model) -> None:
    from scipy.interpolate import RegularGridInterpolator

    losses = []
    for points in ((9, 5), (61, 25)):
        grid = grid_of(model, points)
        between = RegularGridInterpolator((grid.temperature_c, grid.slope_c_per_min), grid.bias_dph)
        draw = np.random.default_rng(7)
        t, r = (draw.uniform(*span, 4000) for span in (model.envelope.temperature_c, model.envelope.slope_c_per_min))
        lost = between(np.stack([t, r], axis=1)) - model.map_dph(t, r)
        assert 0.7 < np.sqrt(np.mean(lost**2)) / grid.rms_dph < 1.4
        assert np.abs(lost).max() < 1.1 * grid.largest_dph
        losses.append(grid.rms_dph)
    assert losses[1] < losses[0] / 5.0


# ---- JSON ----


def test_json_is_the_map_with_its_units(three: Path, tmp_path: Path) -> None:
    reported = json.loads(text_of(three, "json", tmp_path, Exporting(points=(9, 5))))
    assert reported["schema"] == "gyrotc.map/1" and reported["units"]["bias_dph"] == "deg/h"
    assert [part["axis"] for part in reported["maps"]] == ["x", "y", "z"]
    for part in reported["maps"]:
        model = load_model(three / part["axis"] / "model.json")
        t, r = np.meshgrid(part["temperature_c"], part["slope_c_per_min"], indexing="ij")
        assert np.array_equal(np.array(part["bias_dph"]), model.map_dph(t, r))
        assert part["model_hash"] == model.hash


def test_the_map_is_that_of_the_emitted_table(one: Path, model: Model, tmp_path: Path, gyrotc: Command) -> None:
    shutil.copytree(one, tmp_path / "r")
    gyrotc("emit", tmp_path / "r" / "model.json", "--out", tmp_path / "r", "--zero-at", "20")
    shifted = json.loads(text_of(tmp_path / "r", "json", tmp_path))["maps"][0]
    plain = json.loads(text_of(one, "json", tmp_path))["maps"][0]
    moved = np.array(plain["bias_dph"]) - np.array(shifted["bias_dph"])
    assert np.allclose(moved, float(model.map_dph(20.0, 0.0)), atol=1e-12) and abs(moved[0, 0]) > 0.1


# ---- A2L ----

_TOKEN = re.compile(r'/\*.*?\*/|"[^"\n]*"|/begin|/end|[^\s"]+', re.DOTALL)
_NAME, _NUMBER, _TEXT = r"[A-Za-z_]\w{0,127}", r"[-+0-9.e]+|0x[0-9A-F]+", r'"[^"]*"'
#: What follows each keyword, of ASAP2 1.6.1 what the file uses; then the keywords that may stand inside a block.
_BLOCKS: dict[str, tuple[tuple[str, ...], tuple[str, ...]]] = {
    "PROJECT": ((_NAME, _TEXT), ("MODULE",)),
    "MODULE": (
        (_NAME, _TEXT),
        ("MOD_COMMON", "MOD_PAR", "COMPU_METHOD", "RECORD_LAYOUT", "AXIS_PTS", "CHARACTERISTIC"),
    ),
    "MOD_COMMON": ((_TEXT,), ("BYTE_ORDER", "ALIGNMENT_FLOAT32_IEEE")),
    "MOD_PAR": ((_TEXT,), ("VERSION",)),
    "COMPU_METHOD": ((_NAME, _TEXT, "IDENTICAL", r'"%\d+\.\d+"', _TEXT), ()),
    "RECORD_LAYOUT": ((_NAME,), ("AXIS_PTS_X", "FNC_VALUES")),
    "AXIS_PTS": ((_NAME, _TEXT, _NUMBER, "NO_INPUT_QUANTITY", _NAME, _NUMBER, _NAME, _NUMBER, _NUMBER, _NUMBER), ()),
    "CHARACTERISTIC": ((_NAME, _TEXT, "CURVE|MAP", _NUMBER, _NAME, _NUMBER, _NAME, _NUMBER, _NUMBER), ("AXIS_DESCR",)),
    "AXIS_DESCR": (("COM_AXIS", "NO_INPUT_QUANTITY", _NAME, _NUMBER, _NUMBER, _NUMBER), ("AXIS_PTS_REF",)),
}  # fmt: skip
_LINES: dict[str, tuple[str, ...]] = {
    "ASAP2_VERSION": ("1", "61"),
    "BYTE_ORDER": ("MSB_LAST",),
    "ALIGNMENT_FLOAT32_IEEE": ("4",),
    "VERSION": (_TEXT,),
    "AXIS_PTS_X": ("1", "FLOAT32_IEEE", "INDEX_INCR", "DIRECT"),
    "FNC_VALUES": ("1", "FLOAT32_IEEE", "ROW_DIR", "DIRECT"),
    "AXIS_PTS_REF": (_NAME,),
}


def blocks(text: str) -> list[tuple[str, list[str], list[Any]]]:
    """Keywords with what follows them, nested; what the grammar does not know is an error."""
    tokens = iter([token for token in _TOKEN.findall(text) if not token.startswith("/*")])

    def taken(keyword: str, forms: tuple[str, ...]) -> list[str]:
        found = [next(tokens) for _ in forms]
        wrong = [t for t, form in zip(found, forms, strict=True) if not re.fullmatch(form, t)]
        assert not wrong, f"{keyword}: {wrong}"
        return found

    def inside(allowed: tuple[str, ...], end: str | None) -> Iterator[tuple[str, list[str], list[Any]]]:
        for token in tokens:
            if token == "/end":
                assert next(tokens) == end
                return
            keyword = next(tokens) if token == "/begin" else token
            assert keyword in allowed, f"{keyword} in {end}"
            if token == "/begin":
                forms, within = _BLOCKS[keyword]
                given = taken(keyword, forms)
                yield keyword, given, list(inside(within, keyword))
            else:
                yield keyword, taken(keyword, _LINES[keyword]), []
        assert end is None, f"{end} does not end"

    return list(inside(("ASAP2_VERSION", "PROJECT"), None))


def _module(text: str) -> dict[str, list[tuple[list[str], list[Any]]]]:
    [(_, _, [(_, _, content)])] = [block for block in blocks(text) if block[0] == "PROJECT"]
    found: dict[str, list[tuple[list[str], list[Any]]]] = {}
    for keyword, given, inner in content:
        found.setdefault(keyword, []).append((given, inner))
    return found


def test_a2l_keeps_to_the_grammar_and_every_name_is_there(three: Path, one: Path, tmp_path: Path) -> None:
    for folder, axes in ((one, 1), (three, 3)):
        module = _module(text_of(folder, "a2l", tmp_path))
        points = {given[0]: given for given, _ in module["AXIS_PTS"]}
        units = {given[0] for given, _ in module["COMPU_METHOD"]}
        layouts = {given[0] for given, _ in module["RECORD_LAYOUT"]}
        assert len(points) == 2 * axes and len(module["CHARACTERISTIC"]) == 2 * axes
        assert all(given[4] in layouts and given[6] in units for given in points.values())
        for given, inner in module["CHARACTERISTIC"]:
            assert given[4] in layouts and given[6] in units
            assert len(inner) == {"CURVE": 1, "MAP": 2}[given[2]]
            for _, axis, [(_, [reference], _)] in inner:
                assert axis[2:] == points[reference][6:], "an axis says what its points say"


def test_the_grammar_of_the_test_can_fail() -> None:
    for wrong in ('/begin PROJECT p "t" /end MODULE', '/begin PROJECT p "t"', "/begin PROJECT 1 p", "FOO 1"):
        with pytest.raises((AssertionError, StopIteration, KeyError)):
            blocks(wrong)


def test_what_the_a2l_describes_lies_in_memory_without_gaps(three: Path, tmp_path: Path) -> None:
    module = _module(text_of(three, "a2l", tmp_path))
    points = {given[0]: int(given[7]) for given, _ in module["AXIS_PTS"]}
    places = [(int(given[2], 16), int(given[7])) for given, _ in module["AXIS_PTS"]]
    for given, inner in module["CHARACTERISTIC"]:
        places.append((int(given[3], 16), int(np.prod([points[axis[2][0][1][0]] for axis in inner]))))
    at = 0x80040000
    for address, count in sorted(places):
        assert address == at
        at += 4 * count
    assert at == 0x80040000 + 3 * 4 * (7 + 5 + 7 + 35)


def test_a_reader_of_a2l_that_others_keep_reads_the_same(three: Path, tmp_path: Path) -> None:
    parser = pytest.importorskip("pya2l.parser", reason="pya2l is not installed")
    text = text_of(three, "a2l", tmp_path)
    with parser.A2lParser() as reader:
        tree = reader.tree_from_a2l(text.encode("ascii"))
    module = tree.PROJECT.MODULE[0]
    own = _module(text)
    for keyword in ("AXIS_PTS", "CHARACTERISTIC"):
        theirs = [(one.Name.Value, one.Address.Value) for one in getattr(module, keyword)]
        place = {"AXIS_PTS": 2, "CHARACTERISTIC": 3}[keyword]
        assert sorted(theirs) == sorted((given[0], int(given[place], 16)) for given, _ in own[keyword])
    kinds = {one.Name.Value: one.Type for one in module.CHARACTERISTIC}
    assert sorted(kinds.values()) == ["CURVE"] * 3 + ["MAP"] * 3


# ---- CDF ----

#: Children of each element in their order, of the DTD of CDF 2.0 what the file uses; `*` several, `?` none or one.
_CHILDREN = {
    "MSRSW": "SHORT-NAME CATEGORY SW-SYSTEMS",
    "SW-SYSTEMS": "SW-SYSTEM",
    "SW-SYSTEM": "SHORT-NAME SW-INSTANCE-SPEC",
    "SW-INSTANCE-SPEC": "SW-INSTANCE-TREE",
    "SW-INSTANCE-TREE": "SHORT-NAME CATEGORY SW-INSTANCE*",
    "SW-INSTANCE": "SHORT-NAME CATEGORY SW-VALUE-CONT SW-AXIS-CONTS?",
    "SW-VALUE-CONT": "UNIT-DISPLAY-NAME SW-VALUES-PHYS",
    "SW-AXIS-CONTS": "SW-AXIS-CONT*",
    "SW-AXIS-CONT": "CATEGORY SW-INSTANCE-REF",
    "SW-VALUES-PHYS": "V* VG*",
    "VG": "LABEL V*",
}


def _in_order(element: ElementTree.Element) -> None:
    form = _CHILDREN.get(element.tag)
    if form is None:
        assert len(element) == 0 and element.text
        return
    parts = [re.fullmatch(r"([A-Z-]+)([*?]?)", part) for part in form.split()]
    pattern = "".join(f"(?:{part[1]} ){part[2]}" for part in parts if part)
    assert re.fullmatch(pattern, "".join(f"{child.tag} " for child in element)), element.tag
    for child in element:
        _in_order(child)


def _numbers(instance: ElementTree.Element) -> Floats:
    groups = instance.findall("SW-VALUE-CONT/SW-VALUES-PHYS/VG") or instance.findall("SW-VALUE-CONT/SW-VALUES-PHYS")
    return np.array([[float(v.text or "") for v in group.findall("V")] for group in groups]).squeeze()


def test_cdf_holds_the_values_of_what_the_a2l_names(three: Path, tmp_path: Path) -> None:
    module = _module(text_of(three, "a2l", tmp_path / "a"))
    root = ElementTree.fromstring(text_of(three, "cdf", tmp_path / "c"))
    _in_order(root)
    found = {one.findtext("SHORT-NAME") or "": one for one in root.iter("SW-INSTANCE")}
    described = {given[0]: given for keyword in ("AXIS_PTS", "CHARACTERISTIC") for given, _ in module[keyword]}
    assert set(found) == set(described)
    for axis in "xyz":
        model = load_model(three / axis / "model.json")
        t, r, rest, whole = (
            _numbers(found[f"gtc_{model.symbol}_{what}"]) for what in ("temperature", "slope", "rest", "map")
        )
        assert whole.shape == (5, 7), "a group for each rate of temperature"
        with np.errstate(under="ignore"):
            expected = model.map_dph(*np.meshgrid(t, r)).astype(np.float32)
        assert np.array_equal(whole.astype(np.float32), expected)
        assert np.array_equal(rest.astype(np.float32), model.map_dph(t, 0.0).astype(np.float32))
        labels = [float(v.text or "") for v in found[f"gtc_{model.symbol}_map"].iter("LABEL")]
        assert np.array_equal(labels, r)
        axes = [ref.text for ref in found[f"gtc_{model.symbol}_map"].iter("SW-INSTANCE-REF")]
        assert axes == [f"gtc_{model.symbol}_temperature", f"gtc_{model.symbol}_slope"]
        low, high = (np.float32(limit) for limit in described[f"gtc_{model.symbol}_map"][7:])
        assert low <= np.float32(whole.min()) and np.float32(whole.max()) <= high


# ---- the command ----


def test_a_table_is_replaced_and_what_is_not_ours_stays(one: Path, tmp_path: Path) -> None:
    for format in TABLES:
        for _ in range(2):
            reported = export(one, format, tmp_path / f"map.{format}", SMALL)
        assert reported[0].startswith("7 x 5 points; linear between them it is ")
        (tmp_path / f"notes.{format}").write_text("mine")
        with pytest.raises(InputError, match="not written by gyrotc"):
            export(one, format, tmp_path / f"notes.{format}", SMALL)
        assert (tmp_path / f"notes.{format}").read_text() == "mine"


def test_what_no_table_can_be_is_refused(one: Path, tmp_path: Path, gyrotc: Command) -> None:
    with pytest.raises(InputError, match="beyond 0xFFFFFFFF"):
        export(one, "a2l", tmp_path / "a", Exporting(address=0xFFFFFFF0))
    for text in ("61", "1x5", "61x1", "61x25x2", "x", "9999x9"):
        with pytest.raises(InputError, match="--points"):
            points_of(text)
    for text in ("here", "-4", "0x100000000", ""):
        with pytest.raises(InputError, match="--address"):
            address_of(text)
    assert points_of("61x25") == (61, 25) and address_of("0x80040000") == 0x80040000
    done = gyrotc("export", one, "--out", tmp_path / "a", "--format", "dcm")
    assert done.returncode == 2 and "--format" in done.stderr and "a2l" in done.stderr
    assert not (tmp_path / "a").exists()


# The operations of the firmware, written down from its documentation of the parameters.
FIRMWARE = """
#include <stdio.h>
#include <string.h>
static float px4(const float *p, float t)   /* x0 x1 x2 x3 tref tmin tmax */
{
    float d, d2, d3;
    if (t > p[6]) { d = p[6] - p[4]; } else if (t < p[5]) { d = p[5] - p[4]; } else { d = t - p[4]; }
    d2 = d * d;
    d3 = d2 * d;
    return p[0] + p[1] * d + p[2] * d2 + p[3] * d3;
}
static float ardupilot(const float *p, float t)   /* offset c0 c1 c2 caltemp tmin tmax */
{
    float mid = (p[6] + p[5]) * 0.5f, d, e, v = 0.0f, u;
    t = t < p[5] ? p[5] : t > p[6] ? p[6] : t;
    if (mid <= 0.0f) { return p[0]; }
    d = t - mid;
    e = p[4] - mid;
    u = (p[1] + (p[2] + p[3] * d) * d) * d * 1.0e-6f;
    v -= u;
    v += (p[1] + (p[2] + p[3] * e) * e) * e * 1.0e-6f;
    return p[0] - v;
}
int main(int argc, char **argv)
{
    float p[7], t;
    (void)argc;
    if (fread(p, sizeof p[0], 7, stdin) != 7) { return 1; }
    while (fread(&t, sizeof t, 1, stdin) == 1) {
        float y = strcmp(argv[1], "px4") == 0 ? px4(p, t) : ardupilot(p, t);
        fwrite(&y, sizeof y, 1, stdout);
    }
    return 0;
}
"""
TEMPERATURES = np.random.default_rng(5).uniform(-60.0, 90.0, 20000).astype(np.float32)


@pytest.fixture(scope="module")
def firmware(tmp_path_factory: pytest.TempPathFactory) -> Path:
    if shutil.which("gcc") is None:
        pytest.skip("gcc is not installed")
    folder = tmp_path_factory.mktemp("firmware")
    (folder / "firmware.c").write_text(FIRMWARE)
    command = ["gcc", "-std=c99", "-O2", "-ffp-contract=off", "-o", folder / "firmware", folder / "firmware.c"]
    subprocess.run(command, check=True)
    return folder / "firmware"


def read(path: Path) -> dict[str, np.float32]:
    """Names and values of a parameter file, as a ground station reads them."""
    lines = [line for line in path.read_text().splitlines() if not line.startswith("#")]
    cells = [line.split("\t")[2:4] if "\t" in line else line.split(",") for line in lines]
    return {name: np.float32(value) for name, value in cells}


NAMES: dict[Autopilot, list[str]] = {
    "px4": [*(f"TC_G0_X{k}_1" for k in range(4)), "TC_G0_TREF", "TC_G0_TMIN", "TC_G0_TMAX"],
    "ardupilot": [
        "INS_GYROFFS_Y", *(f"INS_TCAL1_GYR{k}_Y" for k in (1, 2, 3)), "INS_GYR1_CALTEMP", "INS_TCAL1_TMIN",
        "INS_TCAL1_TMAX",
    ],
}  # fmt: skip


@pytest.mark.parametrize("autopilot", ["px4", "ardupilot"])
def test_the_file_gives_the_firmwares_bits(autopilot: Autopilot, model: Model, firmware: Path, tmp_path: Path) -> None:
    model.save(tmp_path / "model.json")
    export(tmp_path, autopilot, tmp_path / "gyro.params", Exporting(axis_as="z"))
    reported = export(
        tmp_path, autopilot, tmp_path / "gyro.params", Exporting(axis_as="y")
    )  # an earlier export is replaced
    values = read(tmp_path / "gyro.params")
    words = np.array([values[name] for name in NAMES[autopilot]], dtype=np.float32)
    stream = words.tobytes() + TEMPERATURES.tobytes()
    done = subprocess.run([firmware, autopilot], input=stream, capture_output=True, check=True)
    answers = np.frombuffer(done.stdout, dtype=np.float32)
    assert np.array_equal(answers, best_cubic(model, autopilot).offset(TEMPERATURES))
    assert reported[0] in (tmp_path / "gyro.params").read_text()
    assert all(values[name.replace("_1", "_0").replace("_Y", "_X")] == 0 for name in NAMES[autopilot][1:4])


def lost(cubic: Cubic, model: Model) -> float:
    t = np.linspace(*model.envelope.temperature_c, 200)
    offset = cubic.offset(t).astype(np.float64) * 3600.0 * 180.0 / np.pi
    return float(np.sqrt(np.mean((offset - model.map_dph(t, np.zeros_like(t))) ** 2)))


@pytest.mark.parametrize("autopilot", ["px4", "ardupilot"])
def test_no_other_cubic_is_closer_and_the_loss_is_reported(autopilot: Autopilot, model: Model) -> None:
    found = best_cubic(model, autopilot)
    assert lost(found, model) <= 2.0 * found.rms_dph + 1e-9
    assert found.rms_dph < found.flat_dph
    for order in range(4):
        worse = list(found.x)
        worse[order] = np.float32(worse[order] * 1.2)
        other = Cubic(autopilot, found.reference_c, found.lowest_c, found.highest_c, tuple(worse), 0.0, 0.0, 0.0)
        assert lost(other, model) >= 0.9 * lost(found, model)


def test_what_ardupilot_would_not_correct_is_refused(model: Model) -> None:
    cold = model.envelope.model_copy(update={"temperature_c": (-40.0, 20.0)})
    with pytest.raises(CheckFailed, match="not above 0 C"):
        best_cubic(model.model_copy(update={"envelope": cold}), "ardupilot")


def test_the_table_is_the_map(model: Model, tmp_path: Path) -> None:
    rows = list(csv.DictReader(csv_text([grid_of(model)]).splitlines()))
    assert len(rows) == 61 * 25
    for row in rows[:: 61 * 5]:
        bias = model.map_dph(float(row["temperature_c"]), float(row["slope_c_per_min"]))
        assert float(row["bias_dph"]) == float(bias)
    model.save(tmp_path / "model.json")
    for _ in range(2):
        export(tmp_path, "csv", tmp_path / "map.csv")
    (tmp_path / "notes.csv").write_text("mine")
    with pytest.raises(InputError, match="not written by gyrotc"):
        export(tmp_path, "csv", tmp_path / "notes.csv")
    with pytest.raises(InputError, match="--axis-as"):
        export(tmp_path, "px4", tmp_path / "a", Exporting(axis_as="w"))
