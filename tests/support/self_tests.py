"""Many emitted tables under flags that break the arithmetic: what the self-test says, and what the results are."""

from __future__ import annotations

import os
import shutil
import subprocess
from dataclasses import dataclass
from pathlib import Path

import gyrotc
from gyrotc.model import Model
from gyrotc.tables import emit_texts, joint_needs, needs_of, quantise_all, runtime_texts
from gyrotc.verify import Target, link, run_to_end
from models import random_model, random_terms

TABLES = 40
OK = 0  # GTC_OK
HERE = Path(__file__).resolve().parent
BARE = Path(gyrotc.__file__).parent / "verify" / "bare"
RIGHT = ("-std=c99", "-O2", "-ffp-contract=off")


@dataclass(frozen=True)
class Verdict:
    """What a build says of each table, and a digest of the results that it has with it."""

    statuses: tuple[int, ...]
    digests: tuple[str, ...]

    def differing(self, right: Verdict) -> list[int]:
        """Numbers of the tables whose results are not those of the right build."""
        return [k for k, (a, b) in enumerate(zip(self.digests, right.digests, strict=True)) if a != b]

    def missed(self, right: Verdict) -> list[int]:
        """Those among them that the self-test lets pass."""
        return [k for k in self.differing(right) if self.statuses[k] == OK]


def models(n: int = TABLES) -> list[Model]:
    """Tables with few and many centers, every other one with terms."""
    return [random_model(seed, serial=f"ST-{seed}", terms=random_terms(seed) if seed % 2 else ()) for seed in range(n)]


def write_sources(folder: Path, n: int = TABLES) -> list[Path]:
    """Runtime, float32 tables and program in `folder`; the C files."""
    includes, rows = [], []
    for name, data in runtime_texts(joint_needs(map(needs_of, models(n))), ["f32"]).items():
        (folder / name).write_bytes(data)
    for model in models(n):
        texts = emit_texts(model, quantise_all(model, ["f32"]))
        (t0, t1), r = model.envelope.temperature_c, model.envelope.slope_c_per_min[1] * model.block_s / 60.0
        for name in (f"gtc_{model.id}.h", f"gtc_{model.id}.c"):
            (folder / name).write_bytes(texts[name])
        t_span, s_low = round((t1 - t0 + 2.0) * 512), round(-1.1 * r * 16384)
        includes.append(f'#include "gtc_{model.id}.h"\n')
        rows.append(
            f"    {{&gtc_{model.symbol}_f32, {round((t0 - 1.0) * 512)}L, {t_span}L, {s_low}L, {-2 * s_low + 1}L}},"
        )
    (folder / "tables.h").write_text("".join(includes) + "#define TABLES \\\n" + " \\\n".join(rows) + "\n")
    shutil.copy(HERE / "self_test.c", folder)
    return [folder / "self_test.c", folder / "gtc_f32.c", *sorted(folder.glob("gtc_st_*.c"))]


def native(compiler: str, flags: tuple[str, ...], sources: list[Path], work: Path) -> Verdict | None:
    """The verdict of a build of this machine; None if the compiler refuses the runtime."""
    work.mkdir()
    command = [compiler, *flags, f"-I{sources[0].parent}", *map(str, sources), "-o", str(work / "program")]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    if done.returncode != 0:
        assert "needs IEEE arithmetic" in done.stderr, done.stderr[:2000]
        return None
    return _verdict(subprocess.run([str(work / "program")], capture_output=True, check=True).stdout)


def on_target(target: Target, flags: tuple[str, ...], sources: list[Path], work: Path) -> Verdict:
    """The verdict of a build for a target: runtime and program with these flags, dialect and all."""
    work.mkdir()
    objects = [work / f"{source.stem}.o" for source in sources]
    for source, out in zip(sources, objects, strict=True):
        bare = [f"-I{BARE}"] if target.bare else []
        command = [target.compiler, *target.flags, *flags, *bare, f"-I{source.parent}", "-c", str(source)]
        subprocess.run([*command, "-o", str(out)], check=True, capture_output=True)
    link(target, objects, work / "program")
    with Path(os.devnull).open("rb") as nothing:
        done = run_to_end([*target.run, str(work / "program")], work, target.name, nothing)
    assert done.returncode == 0, done.stderr[:500]
    return _verdict(done.stdout)


def _verdict(text: bytes) -> Verdict:
    rows = [line.split() for line in text.decode("ascii").splitlines()]
    return Verdict(tuple(int(row[0], 16) for row in rows), tuple(row[1] for row in rows))
