"""The whole matrix of builds that break float32: every one whose results differ is refused by the self-test."""

from __future__ import annotations

import platform
from itertools import product
from pathlib import Path

import pytest
from emitted import with_flags
from results import Results
from self_tests import OK, RIGHT, Verdict, native, on_target, write_sources

FLAGS = (
    ("-mfma",),
    ("-mfma", "-ffp-contract=fast"),
    ("-ffast-math", "-U__FAST_MATH__"),
    ("-mfma", "-ffast-math", "-U__FAST_MATH__"),
    ("-funsafe-math-optimizations",),
    ("-m32", "-march=i686", "-mfpmath=387"),
)
HOST = [(c, (o, *f)) for c, o, f in product(("gcc", "clang"), ("-O1", "-O2", "-O3", "-Os"), FLAGS)]
TARGETS = ("cortex-m4f", "aarch64", "s390x", "rv32imafc")
FUSED = ("-std=gnu99", "-ffp-contract=fast")
TARGET_FLAGS = (
    FUSED,
    ("-ffast-math", "-U__FAST_MATH__"),
    ("-funsafe-math-optimizations",),
)


@pytest.fixture(scope="module")
def sources(tmp_path_factory: pytest.TempPathFactory) -> list[Path]:
    return write_sources(tmp_path_factory.mktemp("tables"))


@pytest.fixture(scope="module")
def right(sources: list[Path], tmp_path_factory: pytest.TempPathFactory) -> Verdict:
    verdict = native("gcc", RIGHT, sources, tmp_path_factory.mktemp("right") / "build")
    assert verdict is not None and set(verdict.statuses) == {OK}
    return verdict


def _reported(results: Results, build: str, flags: tuple[str, ...], right: Verdict, verdict: Verdict | None) -> None:
    """A row of docs/results.md; None: it does not compile."""
    row: dict[str, object] = {"build": build, "flags": " ".join(flags), "differ": None}
    if verdict is not None:
        differing = verdict.differing(right)
        refused = [k for k, status in enumerate(verdict.statuses) if status != OK]
        row |= {
            "differ": len(differing),
            "refused": len(set(refused) & set(differing)),
            "refused_besides": len(set(refused) - set(differing)),
        }
    results.add("self_test", row)


@pytest.mark.parametrize(("compiler", "flags"), HOST, ids=lambda v: v if isinstance(v, str) else " ".join(v))
def test_builds_of_this_machine(
    compiler: str,
    flags: tuple[str, ...],
    sources: list[Path],
    right: Verdict,
    tmp_path: Path,
    results: Results,
) -> None:
    verdict = native(compiler, flags, sources, tmp_path / "build")
    assert verdict is not None
    _reported(results, f"{platform.machine()}, {compiler}", flags, right, verdict)
    assert verdict.missed(right) == []


@pytest.mark.parametrize("flags", [("-ffast-math",), ("-Ofast",)], ids=" ".join)
@pytest.mark.parametrize("compiler", ["gcc", "clang"])
def test_fast_math_by_name_does_not_compile(
    compiler: str,
    flags: tuple[str, ...],
    sources: list[Path],
    right: Verdict,
    tmp_path: Path,
    results: Results,
) -> None:
    verdict = native(compiler, flags, sources, tmp_path / "build")
    _reported(results, f"{platform.machine()}, {compiler}", flags, right, verdict)
    assert verdict is None


@pytest.mark.parametrize("flags", TARGET_FLAGS, ids=" ".join)
@pytest.mark.parametrize("name", TARGETS)
def test_builds_of_targets(
    name: str, flags: tuple[str, ...], sources: list[Path], right: Verdict, tmp_path: Path, results: Results
) -> None:
    verdict = on_target(with_flags(name), ("-std=c99", "-ffp-contract=off", *flags), sources, tmp_path / "build")
    _reported(results, name, flags, right, verdict)
    assert verdict.differing(right), "the control changes no result"
    assert verdict.missed(right) == []


@pytest.mark.parametrize("name", TARGETS)
def test_right_builds_of_targets_pass(name: str, sources: list[Path], right: Verdict, tmp_path: Path) -> None:
    verdict = on_target(with_flags(name), ("-std=c99", "-ffp-contract=off"), sources, tmp_path / "build")
    assert set(verdict.statuses) == {OK} and verdict.differing(right) == []
