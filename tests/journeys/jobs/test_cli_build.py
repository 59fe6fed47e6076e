"""The main job as typed or called from Python: verified C and a report out; failed ones leave nothing half."""

from __future__ import annotations

import hashlib
import json
import os
import re
import shutil
import subprocess
import sys
from pathlib import Path
from types import SimpleNamespace

import gyrotc
import numpy as np
import pandas as pd
import pytest
from conftest import EXAMPLE, HOST, MEASURED, ROOT, Command, run_gyrotc
from gyrotc.assess import evaluate
from gyrotc.common import InputError
from gyrotc.jobs import diagnose
from gyrotc.model import load_model
from gyrotc.pages import write_report
from gyrotc.recordings import load
from gyrotc.results import MapError, Training, failed_checks, read_result
from recordings import columns, state, write_csv


def _json(path: Path) -> dict:
    return json.loads(path.read_text())


def test_demo_reaches_the_noise_floor_and_verifies(demo: Path) -> None:
    result = demo / "result"
    evaluation, verification = _json(result / "evaluate.json"), _json(result / "verify.json")
    assert evaluation["mismatches"] == 0
    assert verification["failed"] == 0 and verification["passed"] >= 3
    assert all(t["vectors"] >= 20000 for t in verification["targets"] if t["status"] == "pass")
    floor, exam = evaluation["noise_floor_dph"], evaluation["exam"]
    assert evaluation["noise_floor_source"] == "simulated"
    assert exam["after"]["rms_dph"] <= 1.03 * floor
    assert exam["improvement"] >= 0.97 * exam["constant"]["rms_dph"] / floor
    assert evaluation["model"]["table_bytes"] <= 1200
    assert [r["samples"] for r in evaluation["runs"]] == [288] * 12


def test_build_leaves_every_promised_file(demo: Path) -> None:
    result = demo / "result"
    names = {p.name for p in result.iterdir()}
    assert names == {
        "model.json", "training.json", "c", "verify.json", "evaluate.json", "trace", "report.html",
        "manifest.json", "budget.json", "SHA256SUMS",
    }  # fmt: skip
    assert len(list((result / "trace").glob("run-*.csv"))) == 12
    assert not [p for p in demo.iterdir() if p.name.startswith(".out") or "gyrotc-part" in p.name]


def test_trace_has_the_promised_columns_and_a_row_for_every_input_row(demo: Path) -> None:
    text = (demo / "result" / "trace" / "run-07.csv").read_text().splitlines()
    assert text[0] == "time_s,temperature_c,rate_dph,bias_dph,compensated_dph,status"
    trace = np.genfromtxt(text, delimiter=",", names=True)
    rows = np.genfromtxt(demo / "data" / "run-07.csv", delimiter=",", names=True)
    np.testing.assert_array_equal(trace["time_s"], rows["time_s"])
    np.testing.assert_allclose(trace["compensated_dph"], trace["rate_dph"] - trace["bias_dph"], atol=1e-12)
    assert (trace["status"][:2] == 8).all() and not trace["bias_dph"][:2].any()  # two readings alone are not believed
    assert trace["status"][2] == 1 and trace["status"][-1] in (0, 4)


def test_figures_follow_from_the_trace(demo: Path) -> None:
    """The RMS that a correction leaves on a run, computed here from its trace alone."""
    evaluation = _json(demo / "result" / "evaluate.json")
    trace = np.genfromtxt(demo / "result" / "trace" / "run-09.csv", delimiter=",", names=True)
    believed = np.where(trace["status"] == 8, np.nan, trace["compensated_dph"])  # nothing is corrected before
    means = np.nanmean(believed.reshape(-1, 10), axis=1)
    entry = next(r for r in evaluation["runs"] if r["file"] == "run-09.csv")
    assert entry["after"]["rms_dph"] == pytest.approx(float(np.sqrt(np.mean(means**2))), rel=1e-9)
    assert entry["after"]["std_dph"] == pytest.approx(float(np.std(means)), rel=1e-9)


def test_a_longer_trace_is_means_of_as_few_rows_as_it_takes(demo: Path, tmp_path: Path) -> None:
    dataset = load(demo / "data")
    evaluate(demo / "result", dataset, trace=tmp_path, trace_rows=700, compiled=False)
    whole = np.genfromtxt(demo / "result" / "trace" / "run-07.csv", delimiter=",", names=True)
    thin = np.genfromtxt(tmp_path / "run-07.csv", delimiter=",", names=True)
    assert len(whole) == 2880 and len(thin) == 576
    for name in ("time_s", "temperature_c", "rate_dph", "bias_dph", "compensated_dph"):
        np.testing.assert_allclose(thin[name], whole[name].reshape(-1, 5).mean(axis=1), rtol=1e-9, atol=1e-12)
    assert thin["status"][0] == 8 | 1


def test_the_simulated_floor_is_the_noise_that_was_added(demo: Path) -> None:
    evaluation = _json(demo / "result" / "evaluate.json")
    declared = 7e-4
    assert evaluation["noise_floor_dph"] == pytest.approx(declared, rel=0.06)


def test_fit_twice_gives_the_same_model_and_build_the_same_c(demo: Path, tmp_path: Path, gyrotc: Command) -> None:
    for out in ("a", "b"):
        done = gyrotc("fit", demo / "data", "--out", tmp_path / out)
        assert done.returncode == 0
        assert "predicted RMS over it: 1.00" in done.stdout
    first = (tmp_path / "a" / "model.json").read_bytes()
    assert first == (tmp_path / "b" / "model.json").read_bytes()
    assert first == (demo / "result" / "model.json").read_bytes()


def test_report_is_one_self_contained_page(demo: Path) -> None:
    page = (demo / "result" / "report.html").read_text()
    assert page.count("<svg") >= 3
    assert "SIM-0001" in page and "host-gcc-O2" in page
    outside = re.findall(r'(?:src|href)="(?!#)([^"]+)"', page)
    assert not [link for link in outside if not link.startswith("data:")], outside


def test_targets_that_are_not_installed_are_one_line_under_the_proof(demo: Path, tmp_path: Path) -> None:
    """Neither rows of the table nor counted as a pass."""
    folder = Path(shutil.copytree(demo / "result", tmp_path / "result"))
    record = json.loads((folder / "verify.json").read_text())
    absent = [
        {"name": name, "numeric": numeric, "status": "missing", "package": "no-compiler no-emulator"}
        for name in ("pdp-11", "vax")
        for numeric in ("f32", "q31")
    ]
    record["targets"] += absent
    (folder / "verify.json").write_text(json.dumps(record))
    page = write_report(folder).read_text("utf-8")
    line = next(line for line in page.splitlines() if "pdp-11" in line)
    assert "pdp-11, vax" in line and "apt-get install no-compiler no-emulator" in line
    assert page.count("pdp-11") == 1 and "pdp-11" not in (demo / "result" / "report.html").read_text("utf-8")


def test_report_alone_gives_the_same_page(demo: Path, gyrotc: Command) -> None:
    before = (demo / "result" / "report.html").read_bytes()
    assert gyrotc("report", demo / "result").returncode == 0
    assert (demo / "result" / "report.html").read_bytes() == before


@pytest.mark.measured("mpu6000-chamber-cycle")
def test_a_real_chamber_cycle_builds_a_constant_and_says_why(tmp_path: Path, gyrotc: Command) -> None:
    done = gyrotc("build", MEASURED / "mpu6000-chamber-cycle", "--axis", "z", *HOST, "--out", tmp_path / "r")
    assert done.returncode == 0, done.stderr
    evaluation = _json(tmp_path / "r" / "evaluate.json")
    assert evaluation["exam"] is None
    assert evaluation["model"]["method"] == "constant" and evaluation["generalises"] is False
    assert "does_not_generalise" in [f["id"] for f in evaluation["findings"]]
    page = (tmp_path / "r" / "report.html").read_text("utf-8")
    assert "record the same cycle at least twice more" in page and "Beside simpler corrections" in page


def test_an_existing_folder_of_somebody_else_is_not_replaced(demo: Path, tmp_path: Path, gyrotc: Command) -> None:
    (tmp_path / "thesis").mkdir()
    (tmp_path / "thesis" / "chapter1.tex").write_text("years of work")
    done = gyrotc("build", demo / "data", "--out", tmp_path / "thesis")
    assert done.returncode == 2
    assert "was not written by gyrotc" in done.stderr
    assert [p.name for p in (tmp_path / "thesis").iterdir()] == ["chapter1.tex"]


def test_usage_errors_exit_2_and_help_shows_an_example(gyrotc: Command, tmp_path: Path) -> None:
    assert gyrotc("build").returncode == 2
    assert gyrotc("build", tmp_path / "nothing", "--out", tmp_path / "o").returncode == 2
    assert not (tmp_path / "o").exists()
    for command in ("simulate", "check", "fit", "emit", "verify", "evaluate", "build", "compare", "diagnose", "report"):
        done = gyrotc(command, "--help")
        assert done.returncode == 0
        assert "Example: gyrotc" in done.stdout


def _three_axes(source: Path, folder: Path) -> None:
    """Two training runs of the demo as three-axis recordings whose axes differ by a constant."""
    folder.mkdir()
    for name in ("run-04.csv", "run-05.csv", "run-06.csv"):
        rows = np.genfromtxt(source / name, delimiter=",", names=True)
        columns = [rows["time_s"], rows["temperature_c"], *(rows["rate_dph"] + k for k in (0.0, 1.0, 2.0))]
        header = "time_s,temperature_c,rate_x_dph,rate_y_dph,rate_z_dph"
        np.savetxt(folder / name, np.stack(columns, axis=1), fmt="%.9g", delimiter=",", header=header, comments="")


def test_all_axes_share_one_runtime_and_run_in_one_image(demo: Path, tmp_path: Path, gyrotc: Command) -> None:
    _three_axes(demo / "data", tmp_path / "triad")
    done = gyrotc("build", tmp_path / "triad", *HOST, "--out", tmp_path / "r")
    assert done.returncode == 0, done.stderr
    assert {p.name for p in (tmp_path / "r").iterdir()} == {
        "x", "y", "z", "c", "report.html", "SHA256SUMS",
    }  # fmt: skip
    c = tmp_path / "r" / "c"
    assert {f"gtc_triad_{axis}.c" for axis in "xyz"} <= {p.name for p in c.iterdir()}
    w0 = [load_model(tmp_path / "r" / axis / "model.json").map_dph(10.0, 0.0) for axis in "xyz"]
    np.testing.assert_allclose(np.diff(w0), 1.0, atol=1e-5)
    program = tmp_path / "main"
    sources = [c / "main.c", *c.glob("gtc_???.c"), *(c / f"gtc_triad_{axis}.c" for axis in "xyz")]
    subprocess.run(["gcc", "-std=c99", "-ffp-contract=off", "-o", program, *sources], check=True)
    printed = subprocess.run([program], capture_output=True, text=True, check=True).stdout
    assert printed.count("deg/h") == 3


def test_a_correction_applied_while_recording_is_added_back_or_refused(
    demo: Path, tmp_path: Path, gyrotc: Command
) -> None:
    """Recordings from which the demo's own correction was subtracted give the demo's figures again."""
    corrected = tmp_path / "corrected"
    corrected.mkdir()
    model = load_model(demo / "result" / "model.json")
    text = (demo / "data" / "dataset.toml").read_text()
    text = text.replace("schema = 1\n", f'schema = 1\napplied_table = "{model.hash}"\n')
    (corrected / "dataset.toml").write_text(text)
    for path in (demo / "result" / "trace").glob("*.csv"):
        trace = np.genfromtxt(path, delimiter=",", names=True)
        rows = np.stack([trace["time_s"], trace["temperature_c"], trace["compensated_dph"]], axis=1)
        header = "time_s,temperature_c,rate_dph"
        np.savetxt(corrected / path.name, rows, fmt="%.12g", delimiter=",", header=header, comments="")
    refused = gyrotc("fit", corrected, "--out", tmp_path / "no")
    assert refused.returncode == 2 and "applied" in refused.stderr and not (tmp_path / "no").exists()
    state(corrected, f"applied_model = '{demo / 'result' / 'model.json'}'")
    done = gyrotc("fit", corrected, "--out", tmp_path / "again")
    assert done.returncode == 0, done.stderr
    again = load_model(tmp_path / "again" / "model.json")
    t = np.linspace(-30, 60, 40)
    np.testing.assert_allclose(again.map_dph(t, 0.0), model.map_dph(t, 0.0), atol=2e-6)


def test_traces_of_files_with_one_stem_do_not_meet() -> None:
    from types import SimpleNamespace

    from gyrotc.assess import trace_name

    runs = [
        SimpleNamespace(file=f, from_s=s)
        for f, s in (("a.csv", None), ("b/a.csv", None), ("c.csv", 5.0), ("c.csv", 9.0))
    ]
    names = [trace_name(run, runs) for run in runs]
    assert names[2:] == ["c@5.csv", "c@9.csv"]
    assert len(set(names)) == 4


def test_a_proven_bound_that_is_exceeded_fails_a_build() -> None:
    """`verify` counted it as failed, `build` went on with exit status 0."""
    exceeded = MapError(numeric="q31", status="fail", bound_dph=1e-7, worst_dph=2e-7, inputs_visited=1)
    verification = SimpleNamespace(targets=(), emitted=(), errors=(exceeded,))
    [failure] = failed_checks(verification, SimpleNamespace(mismatches=0))
    assert "q31" in failure and "2e-07" in failure and "1e-07" in failure


def start(folder: Path, out: Path) -> subprocess.Popen[bytes]:
    """The installed command in a process group of its own, so that its compilers end with it."""
    program = Path(sys.executable).with_name("gyrotc")
    command = [str(program), "build", str(folder), "--out", str(out), "--numeric", "f32"]
    return subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, start_new_session=True)


def whole(out: Path) -> bool:
    """Every file that the manifest names is there with its hash."""
    files = json.loads((out / "manifest.json").read_text())["files"]
    return len(files) > 10 and all(
        hashlib.sha256((out / name).read_bytes()).hexdigest() == digest for name, digest in files.items()
    )


DAMAGE = {
    "not json": lambda text: text[: len(text) // 2],
    "nan": lambda text: text.replace('"w0": ', '"w0": NaN, "was": ', 1),
    "infinite": lambda text: text.replace('"block_s": 10.0', '"block_s": 1e999', 1),
    "text for a number": lambda text: text.replace('"block_s": 10.0', '"block_s": "10"', 1),
    "another schema": lambda text: text.replace("gyrotc.model/1", "gyrotc.model/9", 1),
    "illegal serial": lambda text: text.replace('"RLG-0042"', '"../../RLG"', 1),
    "code as serial": lambda text: text.replace('"RLG-0042"', '"x\\"; system(\\"rm\\"); \\""', 1),
    "absurd size": lambda text: text.replace('"slope_blocks": 10', '"slope_blocks": 1000000', 1),
}


@pytest.mark.parametrize("damage", DAMAGE)
def test_emit_refuses(damage: str, tmp_path: Path, gyrotc: Command) -> None:
    text = (EXAMPLE / "model.json").read_text()
    spoilt = DAMAGE[damage](text)
    assert spoilt != text
    (tmp_path / "model.json").write_text(spoilt)
    done = gyrotc("emit", tmp_path / "model.json", "--out", tmp_path / "out")
    assert done.returncode == 2
    assert str(tmp_path / "model.json") in done.stderr and "Traceback" not in done.stderr
    assert len(done.stderr.strip().splitlines()) == 1
    assert not (tmp_path / "out").exists()


def test_every_other_command_that_reads_a_model_refuses(demo: Path, tmp_path: Path, gyrotc: Command) -> None:
    result = tmp_path / "result"
    shutil.copytree(demo / "result", result)
    content = json.loads((result / "model.json").read_text())
    content["networks"][0]["weights"] = content["networks"][0]["weights"][:-1]
    (result / "model.json").write_text(json.dumps(content))
    before = {p: p.read_bytes() for p in result.rglob("*") if p.is_file()}
    data, corrected = demo / "data", Path(shutil.copytree(demo / "data", tmp_path / "corrected"))
    state(corrected, f"applied_model = '{result / 'model.json'}'")
    for command in (
        ("verify", result),
        ("evaluate", result, data),
        ("report", result),
        ("fit", corrected, "--out", tmp_path / "o"),
        ("build", corrected, "--out", tmp_path / "o"),
        ("check", corrected),
        ("compare", corrected),
    ):
        done = gyrotc(*command)
        assert done.returncode == 2, (command, done.stdout, done.stderr)
        assert "networks" in done.stderr and "Traceback" not in done.stderr
    assert not (tmp_path / "o").exists()
    assert before == {p: p.read_bytes() for p in result.rglob("*") if p.is_file()}


def frame(seed: int) -> pd.DataFrame:
    rows = columns(720, seed=seed)
    return pd.DataFrame(
        {"t [s]": rows["time_s"], "T [K]": rows["temperature_c"] + 273.15, "gyro": (rows["rate_dph"] - 20.0) / 3600.0}
    )


def test_a_frame_gives_the_rows_that_it_holds() -> None:
    runs = {"warm": frame(1), "cold": frame(2)}
    data = gyrotc.Dataset.from_pandas(runs, rate_unit="deg/s", serial="RLG-1", exam="warm")
    assert [(run.file, run.role) for run in data.runs] == [("cold.parquet", "train"), ("warm.parquet", "exam")]
    np.testing.assert_allclose(data.runs[0].rows().rate_dph, runs["cold"]["gyro"] * 3600.0, rtol=1e-12)
    np.testing.assert_allclose(data.runs[0].rows().temperature_c, runs["cold"]["T [K]"] - 273.15, atol=1e-9)
    assert repr(data) == "Dataset(RLG-1: 1 training runs, 1 test runs, 1440 rows)"
    assert data._repr_html_().count("<tr>") == 3
    folder = data.folder
    del data
    assert not folder.exists(), "a data set of memory leaves nothing behind"


def test_names_of_runs_are_no_paths(tmp_path: Path) -> None:
    runs = {"../../evil": frame(1), "b": frame(2)}
    data = gyrotc.Dataset.from_pandas(runs, rate_unit="deg/s", folder=tmp_path / "in" / "R")
    assert len(data.runs) == 2 and [p.name for p in tmp_path.iterdir()] == ["in"]


def test_an_index_of_times_is_the_time(tmp_path: Path) -> None:
    stamped = frame(1)
    stamped.index = pd.Timestamp("2026-03-01T08:00Z") + pd.to_timedelta(stamped.pop("t [s]"), unit="s")
    data = gyrotc.Dataset.from_pandas(stamped, rate_unit="deg/s", folder=tmp_path / "RLG-1")
    assert str(data.runs[0].started) == "2026-03-01 08:00:00+00:00" and data.runs[0].n_rows == 720
    assert (tmp_path / "RLG-1" / "dataset.toml").is_file()


def test_units_and_columns_are_not_guessed() -> None:
    with pytest.raises(InputError, match="temperature"):
        gyrotc.Dataset.from_pandas(frame(1).rename(columns={"T [K]": "x"}), rate_unit="deg/s")
    with pytest.raises(InputError, match="exam"):
        gyrotc.Dataset.from_pandas({"a": frame(1)}, rate_unit="deg/s", exam="a")
    with pytest.raises(InputError, match="unit"):
        gyrotc.Dataset.from_pandas(frame(1), rate_unit="furlong")


def test_build_gives_what_the_command_gives(tmp_path: Path) -> None:
    rows = columns(720)
    write_csv(tmp_path / "RLG-1" / "run-01.csv", rows | {"rate_dph": rows["rate_dph"] - 20.0})
    run_gyrotc("build", *HOST, tmp_path / "RLG-1", "--out", tmp_path / "command")
    data = gyrotc.load(tmp_path / "RLG-1")
    result = gyrotc.build(data, numerics=["f32"], targets=["host-gcc-O2"])
    assert result.model == load_model(tmp_path / "command" / "model.json")
    assert (result.folder / "report.html").is_file() and len(repr(result)) < 300
    found = result.to_xarray((5, 3))
    assert found.bias.shape == (5, 3) and found.bias.attrs["units"] == "deg/h"
    t, r = float(found.temperature[1]), float(found.slope[2])
    np.testing.assert_allclose(float(found.bias[1, 2]), result.model.map_dph(t, r))
    assert result.plot()._repr_html_().count("<svg") >= 3
    folder = result.folder
    del result
    assert not folder.exists()


def test_fit_diagnose_and_check_give_what_the_commands_give(tmp_path: Path) -> None:
    rows = columns(720)
    write_csv(tmp_path / "RLG-1" / "run-01.csv", rows | {"rate_dph": rows["rate_dph"] - 20.0})
    for command, option, place in (("fit", "--out", "fit"), ("diagnose", "--out", "found"), ("check", "--json", "c")):
        run_gyrotc(command, tmp_path / "RLG-1", option, tmp_path / place)
    fitted = gyrotc.fit(tmp_path / "RLG-1", tmp_path / "fitted")
    without_times = {"curves": None}  # they hold the seconds that a search took
    assert fitted.training.content() | without_times == _json(tmp_path / "fit" / "training.json") | without_times
    assert load_model(tmp_path / "fitted") == fitted.model
    found = _json(tmp_path / "found" / "diagnose.json")
    files = ("pictures", "series")  # those of the folder
    again = diagnose(tmp_path / "RLG-1")[""].content()
    assert {k: v for k, v in again.items() if k not in files} == {k: v for k, v in found.items() if k not in files}
    assert gyrotc.check(tmp_path / "RLG-1").result().content() == _json(tmp_path / "c")
    with pytest.raises(InputError, match="block_s"):
        gyrotc.fit(tmp_path / "RLG-1", block_s=0.0)


_THREADS = """
import sys
import gyrotc, scipy.linalg
from threadpoolctl import threadpool_info, threadpool_limits

def threads():
    return {one["num_threads"] for one in threadpool_info()}

threadpool_limits(2)
seen = set()
gyrotc.fit(sys.argv[1], progress=lambda *_: seen.update(threads()))
print(sorted(seen), sorted(threads()))
"""


@pytest.mark.parametrize(("stated", "inside"), [(None, [1]), ("2", [2])])
def test_a_job_has_one_thread_from_python_too_unless_the_user_says_otherwise(
    stated: str | None, inside: list[int], tmp_path: Path
) -> None:
    """The caller's own number of threads is what it was, once the job is done."""
    rows = columns(720)
    write_csv(tmp_path / "RLG-1" / "run-01.csv", rows | {"rate_dph": rows["rate_dph"] - 20.0})
    environment = {name: value for name, value in os.environ.items() if not name.endswith("_NUM_THREADS")}
    environment |= {} if stated is None else {"OMP_NUM_THREADS": stated}
    done = subprocess.run(
        [sys.executable, "-c", _THREADS, str(tmp_path / "RLG-1")],
        env=environment, capture_output=True, text=True, check=True,
    )  # fmt: skip
    assert done.stdout == f"{inside} [2]\n"


def test_a_result_of_another_program_is_refused_by_its_name(tmp_path: Path) -> None:
    """A field that this program does not find is not called missing where another program wrote the file."""
    training, manifest = tmp_path / "training.json", tmp_path / "manifest.json"
    training.write_text(json.dumps({"schema": "gyrotc.fit/1", "gyrotc_version": "0.1.0", "serial": "A"}))
    manifest.write_text(json.dumps({"gyrotc_version": "0.1.0", "program": "5" * 64}))
    with pytest.raises(InputError) as refused:
        read_result(training, Training)
    told = str(refused.value)
    assert told.startswith(f"{training}: was written by gyrotc 0.1.0 (program {'5' * 12}), and this is gyrotc")
    assert told.endswith("; expected a result of this gyrotc: give the command that made it again")
    manifest.write_text(json.dumps({"gyrotc_version": "", "program": "5" * 64}))
    with pytest.raises(InputError, match=f"was written by gyrotc \\(program {'5' * 12}\\), and"):
        read_result(training, Training)
    manifest.unlink()
    with pytest.raises(InputError, match="is missing") as refused:
        read_result(training, Training)
    assert "was written by" not in str(refused.value)


def test_the_names_come_on_first_use_and_a_missing_library_is_named() -> None:
    script = (
        "import sys; sys.modules['sklearn'] = None\n"
        "import gyrotc; assert 'numpy' not in sys.modules; print(sorted(gyrotc.__all__))\n"
        "try: gyrotc.RBFNetworkRegressor\n"
        "except ModuleNotFoundError as error: print(error)\n"
    )
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True)
    assert 'pip install "gyrotc[sklearn]"' in done.stdout


def test_the_demo_keeps_the_first_limits_of_the_documents_and_a_constant_does_not(demo: Path, tmp_path: Path) -> None:
    text = (ROOT / "docs" / "limits.md").read_text("utf-8").split("```toml")[1].split("```")[0]
    limits = tmp_path / "product.toml"
    limits.write_text(text.replace('"cortex-m4f"', '"host-gcc-O2"'))
    done = run_gyrotc("build", demo / "data", *HOST, "--limits", limits, "--out", tmp_path / "out")
    assert done.returncode == 0, done.stderr
    held = _json(tmp_path / "out" / "limits.json")
    assert held["verdict"] == "PASS"
    assert not any(one.get("constant_passes") for one in held["limits"])
