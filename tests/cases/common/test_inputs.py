"""Whatever is given as an input: a regular file within its ceilings is read, anything else is refused in one line."""

from __future__ import annotations

import json
import os
import re
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import gyrotc
import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from conftest import ROOT, Command
from gyrotc.assess import load_limits
from gyrotc.common import InputError, inputs, install_command, parse_json, parse_toml
from gyrotc.fleet import Cluster, connected, load_manifest
from gyrotc.model import load_model
from gyrotc.pages import report
from gyrotc.recordings import load
from gyrotc.results import EvaluatedRun, Evaluation, read_result
from gyrotc.results import cache as kept
from gyrotc.simulate import read, simulate, simulated_floor
from gyrotc.train import run_blocks
from gyrotc.verify import log_parts
from recordings import columns, csv_text, described, state, write_csv

READERS: dict[str, Callable[[Path], Any]] = {
    "model": load_model,
    "limits": load_limits,
    "manifest": load_manifest,
    "scenario": read,
    "log": log_parts,
    "result": lambda path: read_result(path, Evaluation),
    "recording": lambda path: load(path.parent),
}


def refused(act: Callable[[], Any]) -> str:
    with pytest.raises(InputError) as caught:
        act()
    assert "\n" not in str(caught.value)
    return str(caught.value)


@pytest.mark.parametrize("name", READERS)
def test_a_pipe_a_device_and_the_kernels_files_are_not_waited_for(name: str, tmp_path: Path) -> None:
    folder = tmp_path / "RLG-1"
    folder.mkdir()
    path = folder / "a.csv"
    os.mkfifo(path)
    assert "is a pipe" in refused(lambda: READERS[name](path))
    for device in ("/dev/zero", "/dev/random", "/dev/full"):
        path.unlink()
        path.symlink_to(device)
        assert "is a device" in refused(lambda: READERS[name](path))
    path.unlink()
    path.symlink_to("/proc/kmsg")
    reported = refused(lambda: READERS[name](path))
    assert "is empty" in reported or "cannot be read" in reported


def test_a_link_to_a_regular_file_is_read(tmp_path: Path) -> None:
    write_csv(tmp_path / "there.csv")
    (tmp_path / "RLG-1").mkdir()
    (tmp_path / "RLG-1" / "a.csv").symlink_to(tmp_path / "there.csv")
    assert load(tmp_path / "RLG-1").runs[0].n_rows == 120


NESTED = 5000
TOML = {
    "thousands of digits": ("a = " + "9" * 5000, "no TOML"),
    "more than 64 bits": ("a = " + "9" * 30, "100 bits"),
    "deep lists": ("a = " + "[" * NESTED + "]" * NESTED, "nested too deep"),
    "lists of 40 levels": ("a = " + "[" * 40 + "]" * 40, "nested too deep"),
    "deep tables": ("a" + ".a" * NESTED + " = 1", "a key of too many parts"),
    "a key that costs the square of its length": ("[" + "a." * 500_000 + "a]", "a key of too many parts"),
    "no UTF-8": ("a = 1\nb = \udcff", "line 2: no UTF-8"),
}
JSON = {
    "NaN": ('{"a": NaN}', "NaN is not a finite number"),
    "beyond float": ('{"a": 1e999}', "inf is not a finite number"),
    "thousands of digits": ('{"a": ' + "9" * 5000 + "}", "is not JSON"),
    "more than 64 bits": ('{"a": ' + "9" * 30 + "}", "100 bits"),
    "deep": ("[" * NESTED + "]" * NESTED, "nested too deep"),
    "40 levels": ("[" * 40 + "]" * 40, "nested too deep"),
    "half a surrogate pair": ('{"a": "\\ud800"}', "half a surrogate pair"),
}


@pytest.mark.parametrize("case", TOML)
def test_hostile_toml(case: str) -> None:
    text, reported = TOML[case]
    data = text.encode("utf-8", "surrogateescape")
    assert reported in refused(lambda: parse_toml(data, "a.toml", "a file"))


@pytest.mark.parametrize("case", JSON)
def test_hostile_json(case: str) -> None:
    text, reported = JSON[case]
    assert reported in refused(lambda: parse_json(text.encode(), "a.json", "a file"))


@pytest.mark.parametrize("number", ["1", "1.5", "1.5, 2.5"])
def test_the_deepest_json_is_the_same_for_every_number(number: str) -> None:
    assert parse_json(("[" * 33 + number + "]" * 33).encode(), "a.json", "a file")
    text = "[" * 34 + number + "]" * 34
    assert "nested too deep" in refused(lambda: parse_json(text.encode(), "a.json", "a file"))


def test_a_parquet_file_that_unpacks_to_gigabytes(tmp_path: Path) -> None:
    """150 million rows lie in a file of 1 MB; here a twentieth of that, as its metadata alone say."""
    folder = tmp_path / "RLG-1"
    folder.mkdir()
    table = pa.table({name: np.zeros(2**23) for name in ("time_s", "temperature_c", "rate_dph")})
    pq.write_table(table, folder / "a.parquet")
    assert (folder / "a.parquet").stat().st_size < 2**20
    del table
    program = (
        "import resource, sys; from gyrotc.recordings.loading import load; from pathlib import Path\n"
        "used = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss\n"
        "try: load(Path(sys.argv[1]))\nexcept Exception as error: print(error)\n"
        "print(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - used, 'KiB')\n"
    )
    done = subprocess.run([sys.executable, "-c", program, folder], capture_output=True, text=True, check=True)
    message, taken = done.stdout.splitlines()
    assert "bytes that unpack to 201326592 or more; expected at most 250 times" in message
    assert int(taken.split()[0]) < 2**16, done.stdout


def test_times_on_a_wrong_scale(tmp_path: Path) -> None:
    """Steps of 1e-11 s made one block of 10^12 rows: an array of 3.64 TiB."""
    table = columns()
    write_csv(tmp_path / "RLG-1" / "a.csv", table | {"time_s": 1e-12 * table["time_s"]})
    assert "a median step of 1e-11 s" in refused(lambda: load(tmp_path / "RLG-1"))


def test_a_block_longer_than_the_recording_takes_no_more_memory_than_it(tmp_path: Path) -> None:
    table = columns()
    write_csv(tmp_path / "RLG-1" / "a.csv", table | {"time_s": 2e-6 * table["time_s"]})
    [run] = load(state(tmp_path / "RLG-1", "trust_units = true")).runs
    settings = {"slope_blocks": 6, "max_step_c": 5.0, "max_rate_c_per_min": 1e9}
    assert len(run_blocks(run.rows(), run, np.ones(run.n_rows, dtype=bool), block_s=3600.0, **settings).valid) == 1


def test_gaps_that_make_more_samples_than_memory_is_granted_for(tmp_path: Path) -> None:
    table = columns(2000)
    time = 1e-5 * np.arange(2000) + 1e4 * (np.arange(2000) // 3)
    write_csv(tmp_path / "RLG-1" / "a.csv", table | {"time_s": np.round(time, 6)})
    [run] = load(state(tmp_path / "RLG-1", "trust_units = true")).runs
    settings = {"slope_blocks": 6, "max_step_c": 5.0, "max_rate_c_per_min": 1e9}
    reported = refused(lambda: run_blocks(run.rows(), run, np.ones(run.n_rows, dtype=bool), block_s=10.0, **settings))
    assert reported.startswith("a.csv: ") and "GiB of memory" in reported


def test_ceilings_move_by_option_and_environment(tmp_path: Path, gyrotc: Command) -> None:
    write_csv(tmp_path / "RLG-1" / "a.csv")
    assert gyrotc("check", tmp_path / "RLG-1").returncode == 0
    done = gyrotc("--max", "columns=2", "check", tmp_path / "RLG-1")
    assert done.returncode == 2 and "expected at most 2 (--max columns=...)" in done.stdout
    for wrong in ("columns=0", "columns=nan", "rows=5", "columns"):
        done = gyrotc("--max", wrong, "check", tmp_path / "RLG-1")
        assert (done.returncode, done.stderr.count("\n")) == (2, 1) and "--max or GYROTC_MAX" in done.stderr


def test_every_ceiling_is_documented() -> None:
    text = (Path(__file__).parents[3] / "docs" / "recordings.md").read_text("utf-8")
    for name, ceiling in inputs.CEILINGS.items():
        assert f"| `{name}` | {ceiling.default:g} |" in text, name


TRUTH = {
    "schema": "gyrotc.truth/1", "scenario": "a", "seed": 1, "noise": {}, "map": {}, "causes": [], "plan": {},
    "runs": [{"file": "a.csv", "noise": "a.npy", "noise_step_s": 1.0, "bias_dph": [0.0, 1.0]}],
}  # fmt: skip


@pytest.mark.parametrize(
    ("change", "reported"),
    [
        ({"runs": [{}]}, "field runs.0.file: is missing"),
        ({"runs": [TRUTH["runs"][0] | {"file": "b.csv"}]}, "no run a.csv"),  # type: ignore[index,operator]
        ({"runs": "all"}, "field runs: 'all'"),
        ({"runs": [TRUTH["runs"][0] | {"noise_step_s": 0.0}]}, "noise_step_s"),  # type: ignore[index,operator]
        ({"runs": [TRUTH["runs"][0] | {"noise": "../../etc/passwd"}]}, "a file in the folder"),  # type: ignore[index,operator]
        ({"schema": "x"}, "field schema"),
        ({}, "a.npy: does not exist"),
    ],
)
def test_a_truth_that_is_not_as_it_was_written(change: dict[str, Any], reported: str, tmp_path: Path) -> None:
    (tmp_path / "truth.json").write_text(json.dumps(TRUTH | change))
    assert reported in refused(lambda: simulated_floor(tmp_path, ["a.csv"], 10.0))


def test_the_noise_of_a_truth(tmp_path: Path) -> None:
    (tmp_path / "truth.json").write_text(json.dumps(TRUTH))
    np.save(tmp_path / "a.npy", np.full(100, 2.0, dtype=np.float32))
    assert simulated_floor(tmp_path, ["a.csv"], 10.0) == 2.0
    whole = (tmp_path / "a.npy").read_bytes()
    for wrong in (whole[:-1], whole.replace(b"(100,)", b"(10**9,)"), whole.replace(b"<f4", b"|O "), whole[:9]):
        (tmp_path / "a.npy").write_bytes(wrong)
        assert "is no whole array of numbers" in refused(lambda: simulated_floor(tmp_path, ["a.csv"], 10.0))


FAULTY = """
import json, os, pathlib, sys
import gyrotc.cli.main, gyrotc.jobs
def fail(*a, **k): raise RAISED
pathlib.Path.iterdir = fail
folder, cases = sys.argv[1:]
for number, (raised, environment) in enumerate(json.loads(cases)):
    child = os.fork()
    if child:
        print(os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]), flush=True)
        continue
    RAISED = eval(raised)
    os.environ.update(environment)
    os.dup2(os.open(f"{number}.txt", os.O_CREAT | os.O_WRONLY), 2)
    sys.argv = ["gyrotc", "check", folder]
    gyrotc.cli.main.main()
"""


def test_a_fault_of_the_program_is_one_line_and_a_report(tmp_path: Path) -> None:
    state, place = {"XDG_STATE_HOME": str(tmp_path / "state")}, tmp_path / "place"
    place.mkdir()
    (tmp_path / "file").write_text("")
    elsewhere = {"XDG_STATE_HOME": str(tmp_path / "file"), "TMPDIR": str(tmp_path)}
    raised = [
        ("KeyError('a\\nb')", state), ("KeyError('other')", state), ("KeyError()", elsewhere),
        ("KeyboardInterrupt", state), ("MemoryError", state),
    ]  # fmt: skip
    command = [sys.executable, "-c", FAULTY, tmp_path, json.dumps(raised)]
    done = subprocess.run(command, cwd=place, capture_output=True, text=True, check=True)
    first, other, moved, interrupted, out_of_memory = ((place / f"{k}.txt").read_text() for k in range(5))
    assert done.stdout.split() == ["70", "70", "70", "130", "2"], "and nothing else on standard output"
    assert first.count("\n") == 1
    kept = Path(first.split("please send ")[1].strip())
    assert kept.parent == tmp_path / "state" / "gyrotc" and kept.stat().st_mode & 0o777 == 0o600
    assert "Traceback (most recent call last)" in kept.read_text() and "KeyError" in kept.read_text()
    number = first.split("internal fault ")[1].split()[0]
    assert number in kept.name and number in other, "one fault, one id"
    assert f"please send {tmp_path}/crash-" in moved
    assert "Traceback" not in interrupted
    assert out_of_memory.startswith("gyrotc: not enough memory")


def test_what_is_kept_and_damaged_or_of_another_name_is_thrown_away(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    kept.keep("a.object", content := bytes(range(256)))
    assert kept.folder().stat().st_mode & 0o777 == 0o700
    path = kept.folder() / "a.object"
    whole = path.read_bytes()
    assert kept.kept("a.object", bytes) == content
    flipped = bytearray(whole)
    flipped[len(whole) // 2] ^= 1
    for name, damaged in (("a.object", bytes(flipped)), ("a.object", whole[:100]), ("b.object", whole)):
        (kept.folder() / name).write_bytes(damaged)
        assert kept.kept(name, bytes) is None and not (kept.folder() / name).exists(), name
    kept.keep("a.object", content)
    kept.folder().chmod(0o777)
    assert kept.kept("a.object", bytes) is None, "others may write there"


def test_nothing_is_kept_in_the_working_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(kept, "user_cache_path", lambda *_, **__: Path("~/.cache"))  # what a user without a home has
    monkeypatch.chdir(tmp_path)
    kept.keep("a.object", b"content")
    assert kept.kept("a.object", bytes) is None
    assert not list(tmp_path.iterdir())


def test_a_line_without_an_end_does_not_fill_memory(tmp_path: Path) -> None:
    folder = tmp_path / "RLG-1"
    folder.mkdir()
    (folder / "a.csv").write_text(csv_text(columns()) + "1" * 2**22)
    message = refused(lambda: load(folder))
    assert "line 122: " in message and "and no end" in message


def test_runs_of_a_data_set_have_a_ceiling(tmp_path: Path) -> None:
    described(tmp_path, *['file = "run-01.csv"'] * 2001)
    assert "2001 runs; expected at most 2000" in refused(lambda: load(tmp_path))


@pytest.mark.parametrize(
    ("steps", "minutes", "reported"),
    [
        ("[{staircase_to_c = 60.0, tread_c = 1e-9, hold_min = 1.0, c_per_min = 1.0}]", "60", "corners"),
        ("[{repeat = [{hold_min = 1e-9}]}]", "60", "corners"),
        ("[{hold_min = 1.0}]", "9e6", "GiB of memory"),
        ("[{hold_min = 1.0}]", "1e300", "record_min"),
    ],
)
def test_a_programme_that_never_ends(steps: str, minutes: str, reported: str, tmp_path: Path) -> None:
    (tmp_path / "a.toml").write_text(
        f'title = "a"\n[profile.a]\nstart_c = 20.0\nrecord_min = {minutes}\nsteps = {steps}\n'
        '[[set]]\nstarted = 2026-03-02T08:00:00Z\nprofiles = ["a"]\n'
    )
    assert reported in refused(lambda: simulate(tmp_path / "a.toml", seed=1, out=tmp_path / "out"))


@pytest.mark.parametrize("time", ["1e18", "nan", "5.0"])
def test_a_trace_whose_time_jumps(time: str, tmp_path: Path) -> None:
    rows = [f"{t},20.0,1.0,1.0,0" for t in ("0.0", "10.0", time, "30.0")]
    head = "time_s,temperature_c,rate_dph,compensated_dph,status"
    (tmp_path / "a.csv").write_text("\n".join([head, *rows]) + "\n")
    run = EvaluatedRun.model_construct(file="a.csv")
    assert "times that do not increase" in refused(lambda: report.trace_means(tmp_path, run, 100.0))
    (tmp_path / "a.csv").write_text(f"{head.removesuffix(',status')}\n0,20,1,1\n")
    assert "status" in refused(lambda: report.trace_means(tmp_path, run, 100.0))


def _without(package: str, monkeypatch: pytest.MonkeyPatch) -> None:
    for name in [n for n in sys.modules if n.split(".")[0] == package]:
        monkeypatch.delitem(sys.modules, name)
    monkeypatch.setitem(sys.modules, package, None)


def test_the_estimator_without_scikit_learn_names_the_command(monkeypatch: pytest.MonkeyPatch) -> None:
    _without("sklearn", monkeypatch)
    monkeypatch.delitem(sys.modules, "gyrotc.train.estimator", raising=False)
    with pytest.raises(ModuleNotFoundError, match=re.escape('pip install "gyrotc[sklearn]"')):
        _ = gyrotc.RBFNetworkRegressor


def test_a_scheduler_without_its_package_names_the_command(monkeypatch: pytest.MonkeyPatch) -> None:
    _without("distributed", monkeypatch)
    cluster = Cluster("tcp://127.0.0.1:1", 1.0, print)
    with pytest.raises(InputError, match=re.escape('pip install "gyrotc[dask]"')), connected(cluster):
        pass


@pytest.mark.parametrize("extra", ["sklearn", "dask", "hdf5", "tdms", "excel", "netcdf"])
def test_an_extra_that_is_named_exists(extra: str) -> None:
    assert install_command(extra) == f'pip install "gyrotc[{extra}]"'
    assert re.search(rf"(?m)^{extra} = \[", (ROOT / "gen" / "pyproject.toml").read_text("utf-8"))
