"""A simulation is decided by its scenario, its options and its seed."""

from __future__ import annotations

from pathlib import Path
from tempfile import TemporaryDirectory

from conftest import run_gyrotc
from drawn import examples
from hypothesis import given
from hypothesis import strategies as st


def _simulated(folder: Path, *options: str) -> dict[str, bytes]:
    done = run_gyrotc("simulate", *options, "--out", folder)
    assert done.returncode == 0, done.stderr
    files = (path for path in folder.rglob("*") if path.is_file())
    return {path.relative_to(folder).as_posix(): path.read_bytes() for path in files}


@examples(3, shrink=False)
@given(
    scenario=st.sampled_from(["paper-20C", "paper-1C-min"]),
    seed=st.integers(0, 2**63 - 1000),
    kind=st.sampled_from([("--format", "csv"), ("--format", "parquet"), ("--pulses",)]),
)
def test_the_same_seed_gives_the_same_bytes_and_another_seed_another_gyro(
    scenario: str, seed: int, kind: tuple[str, ...]
) -> None:
    options = (scenario, "--raw-hz", "0.01", *kind)
    with TemporaryDirectory() as place:
        one, again, other = (
            _simulated(Path(place) / name, *options, "--seed", str(number))
            for name, number in (("one", seed), ("again", seed), ("other", seed + 1))
        )
    assert one == again
    runs = [name for name in one if name.startswith("run")]
    assert runs and all(one[name] != other[name] for name in runs)
