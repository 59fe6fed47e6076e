"""Options of a build: the same defaults and ranges for every command, for the manifest of a fleet and in Python."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest
from conftest import Command
from gyrotc.cli.main import application
from gyrotc.common.errors import InputError
from gyrotc.fleet.manifest import load_manifest
from gyrotc.recordings.load import load
from gyrotc.train.fitting import FitOptions, fit_dataset, front_end
from gyrotc.train.options import DEFAULTS
from recordings import columns, toml, write_csv
from typer.main import get_command

BAD = [
    ("average_s", "1e9"), ("average_s", "0.0"), ("average_s", "nan"), ("rho", "1.0"), ("rho", "-0.1"),
    ("block_s", "0.0"), ("block_s", "3600.1"), ("centers", "513"), ("centers", "-1"), ("seed", "-1"),
    ("method", "poly"),
]  # fmt: skip
TAKEN = {
    "fit": {"method", "seed", "centers", "rho", "block_s", "average_s", "channels"},
    "build": {"method", "seed", "centers", "rho", "block_s", "average_s", "channels"},
    "diagnose": {"method", "seed", "centers", "rho", "block_s", "average_s"},
    "compare": {"seed", "block_s", "average_s"},
    "evaluate": {"average_s"},
}


def one_run(folder: Path) -> Path:
    """An hour of a small gyro, of which spans are left out in training."""
    rows = columns(360)
    write_csv(folder / "run-01.csv", rows | {"rate_dph": rows["rate_dph"] - 20.0})
    head = 'schema = 1\nserial = "RLG-1"\nearth_rate = "none"'
    (folder / "dataset.toml").write_text(toml('file = "run-01.csv"', head=head))
    return folder


def flag(name: str) -> str:
    return "--" + name.replace("_", "-")


@pytest.mark.parametrize("command", TAKEN)
def test_a_command_refuses_a_bad_value_in_one_line_before_it_reads_anything(
    command: str, tmp_path: Path, gyrotc: Command
) -> None:
    given = ["result"] if command == "evaluate" else []
    out = [] if command == "evaluate" else ["--out", "out"]
    for name, value in BAD:
        if name in TAKEN[command]:
            done = gyrotc(command, *given, "recordings", *out, f"{flag(name)}={value}", cwd=tmp_path)
            assert done.returncode == 2, (name, value)
            assert done.stderr.startswith(f"gyrotc: {flag(name)}: ") and done.stderr.count("\n") == 1
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(("name", "value"), BAD)
def test_a_manifest_refuses_what_the_commands_refuse_and_names_the_field(name: str, value: str, tmp_path: Path) -> None:
    one_run(tmp_path / "RLG-1")
    manifest = tmp_path / "fleet.toml"
    quoted = f'"{value}"' if name == "method" else value
    manifest.write_text(f'schema = 1\ndatasets = ["RLG-*"]\n[options]\n{name} = {quoted}\n')
    with pytest.raises(InputError) as refused:
        load_manifest(manifest)
    assert refused.value.where == f"{manifest}, field options.{name}"
    assert "\n" not in str(refused.value)


@pytest.mark.parametrize("command", [name for name in TAKEN if name != "evaluate"])
def test_a_command_offers_these_options_with_the_defaults_of_the_class(command: str) -> None:
    parameters = {p.name: p for p in get_command(application()).commands[command].params}  # type: ignore[attr-defined]
    offered = {name for name in DEFAULTS.__dataclass_fields__ if name in parameters}
    assert offered == TAKEN[command]
    for name in offered:
        assert parameters[name].default == getattr(DEFAULTS, name), name


def test_a_manifest_without_options_and_one_with_all_of_them(tmp_path: Path) -> None:
    one_run(tmp_path / "RLG-1")
    manifest = tmp_path / "fleet.toml"
    manifest.write_text('schema = 1\ndatasets = ["RLG-*"]\n')
    assert load_manifest(manifest).options == FitOptions()
    manifest.write_text(
        'schema = 1\ndatasets = ["RLG-*"]\n[options]\nmethod = "rbf_ols"\nseed = 3\ncenters = 0\nrho = 0\n'
        "block_s = 3600\naverage_s = 1e6\nchannels = true\n"
    )
    assert load_manifest(manifest).options == FitOptions(
        method="rbf_ols", seed=3, centers=0, rho=0.0, block_s=3600.0, average_s=1e6, channels=True
    )


@pytest.mark.parametrize("line", ['prior = "x"', "lot = 1", "blocks = 1"])
def test_a_manifest_has_no_other_options(line: str, tmp_path: Path) -> None:
    one_run(tmp_path / "RLG-1")
    (tmp_path / "fleet.toml").write_text(f'schema = 1\ndatasets = ["RLG-*"]\n[options]\n{line}\n')
    with pytest.raises(InputError, match=r"field options\.\w+: is not known; expected one of method, "):
        load_manifest(tmp_path / "fleet.toml")


def test_means_shorter_than_a_block_are_the_blocks(tmp_path: Path) -> None:
    """However short: a billionth of a second took a word of memory for each billionth of the run."""
    recordings = load(one_run(tmp_path / "RLG-1"))
    found = [
        fit_dataset(recordings, FitOptions(method="cubic", average_s=average_s)).training for average_s in (1e-3, 1e-9)
    ]
    assert found[0].left_out is not None
    assert found[0].left_out == found[1].left_out


def test_a_block_that_whole_rows_make_too_long_is_refused(tmp_path: Path) -> None:
    """27.7 rows of 130 s are an hour, 28 are more than a model may have."""
    recordings = load(one_run(tmp_path / "RLG-1"))
    runs = [replace(run, row_period_s=130.0) for run in recordings.runs]
    assert front_end(runs, 3500.0).block_s == 3510.0
    with pytest.raises(InputError, match=r"--block-s: 3640\.0; expected"):
        front_end(runs, 3600.0)


def test_blocks_of_a_millisecond_are_held_as_often_as_a_model_may_say(tmp_path: Path) -> None:
    """300 s of them are more than it may."""
    runs = [replace(run, row_period_s=0.001) for run in load(one_run(tmp_path / "RLG-1")).runs]
    assert front_end(runs, 0.001).hold_blocks == 100_000
    assert front_end(runs, 0.01).hold_blocks == 30_000
