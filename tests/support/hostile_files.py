"""Hostile files of every format through `gyrotc import`, in one process: statuses, times, memory, files that it opens.

`python tests/support/hostile_files.py FOLDER COUNT SEED` writes a line of JSON for each; its number makes a file again.
"""

from __future__ import annotations

import gzip
import json
import os
import resource
import sys
import time
import zipfile
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import scipy.io
from conftest import run_gyrotc
from logger_binaries import BINARY_CASES
from logger_files import CSV_CASES, truth
from mutation import mutated

SECRET = "years-of-work"  # beside the input: no import opens it
_GIANT = 2**22  # numbers of a packed file: 32 MiB once unpacked


def _h5(path: Path, fill: Callable[..., None]) -> None:
    import h5py

    with h5py.File(path, "w") as file:
        file["time_s"], file["temperature_c"] = np.arange(500.0), np.linspace(20.0, 40.0, 500)
        fill(h5py, file)


def _declares_rows(h5py: object, file: object) -> None:
    file.create_dataset("rate_dph", (10**15,), "f8", chunks=(1024,))  # type: ignore[attr-defined]


def _packed_chunks(h5py: object, file: object) -> None:
    zeros = np.zeros(_GIANT)
    file.create_dataset("rate_dph", data=zeros, chunks=(2**20,), compression="gzip")  # type: ignore[attr-defined]


def h5_declared(path: Path) -> None:
    _h5(path, _declares_rows)


def h5_packed(path: Path) -> None:
    _h5(path, _packed_chunks)


def h5_external(path: Path) -> None:
    secret = str(path.parent / SECRET)
    _h5(path, lambda _, file: file.create_dataset("rate_dph", (500,), "f8", external=[(secret, 0, 4000)]))


def h5_pipe(path: Path) -> None:
    if not (path.parent / "pipe").exists():
        os.mkfifo(path.parent / "pipe")
    pipe = str(path.parent / "pipe")
    _h5(path, lambda _, file: file.create_dataset("rate_dph", (500,), "f8", external=[(pipe, 0, 4000)]))


def h5_link(path: Path) -> None:
    def fill(h5py: object, file: object) -> None:
        link = h5py.ExternalLink(str(path.parent / SECRET), "/rate")  # type: ignore[attr-defined]
        file["rate_dph"] = link  # type: ignore[index]

    _h5(path, fill)


def mat_packed(path: Path) -> None:
    scipy.io.savemat(path, {"rate_dph": np.zeros(_GIANT), "time_s": np.zeros(_GIANT)}, do_compression=True)


def parquet_packed(path: Path) -> None:
    zeros = np.zeros(_GIANT)
    pq.write_table(pa.table({"time_s": zeros, "temperature_c": zeros, "rate_dph": zeros}), path, compression="zstd")


def csv_long_name(path: Path) -> None:
    path.write_text("time_s,temperature_c," + " " * 100_000 + "\n1,2,3\n" * 50, encoding="ascii")


def csv_deep(path: Path) -> None:
    path.write_text('"' * 50_000 + "\n" + ",".join(["1"] * 5000) + "\n", encoding="ascii")


def gzip_bomb(path: Path) -> None:
    with gzip.open(path, "wb", compresslevel=9) as file:
        for _ in range(64):
            file.write(b"0" * 2**20)


def zip_bomb(path: Path) -> None:
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as file:
        file.writestr("[Content_Types].xml", "<Types/>")
        file.writestr("xl/workbook.xml", "<a>" * 2**20)
        file.writestr("xl/worksheets/sheet1.xml", "<row/>" * 2**22)


MADE: dict[str, Callable[[Path], None]] = {
    "declared.h5": h5_declared, "packed.h5": h5_packed, "external.h5": h5_external, "pipe.h5": h5_pipe,
    "link.h5": h5_link, "packed.mat": mat_packed, "packed.parquet": parquet_packed, "name.csv": csv_long_name,
    "deep.csv": csv_deep, "bomb.csv.gz": gzip_bomb, "bomb.xlsx": zip_bomb,
}  # fmt: skip


def seeds(folder: Path) -> list[tuple[str, bytes]]:
    """Whole files of every format that can be written here: names and contents."""
    found = []
    for case in [*BINARY_CASES, *CSV_CASES]:
        path = folder / "seed" / case.file
        path.parent.mkdir(exist_ok=True)
        case.write(path, truth())
        found.append((case.file, path.read_bytes()))
    return found


def hostile(folder: Path, number: int, seed: int, whole: list[tuple[str, bytes]]) -> Path:
    """The file of a number: the made ones first, then damaged ones, binary formats twice as often as text."""
    made = list(MADE)
    if number < len(made):
        path = folder / made[number]
        MADE[made[number]](path)
        return path
    rng = np.random.default_rng([seed, number])
    binary = [one for one in whole if not one[0].endswith((".csv", ".txt", ".log"))]
    name, data = (binary if number % 3 else whole)[int(rng.integers(len(binary if number % 3 else whole)))]
    path = folder / f"{number}-{Path(name).name}"
    path.write_bytes(mutated(data, "bytes", rng))
    return path


def main(folder: Path, count: int, seed: int) -> None:
    (folder / "in").mkdir()
    (folder / "in" / SECRET).write_bytes(bytes(range(256)) * 32)
    whole = seeds(folder)
    for number in range(count):
        path = hostile(folder / "in", number, seed, whole)
        begun = time.monotonic()
        print(f"file {path.name}", file=sys.stderr, flush=True)
        done = run_gyrotc("import", path, "--out", folder / "out" / str(number))
        line = {
            "name": path.name,
            "status": done.returncode,
            "seconds": time.monotonic() - begun,
            "own_mib": resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024,
            "message": done.stderr[-300:],
        }
        print(json.dumps(line), flush=True)
        path.unlink()


if __name__ == "__main__":
    main(Path(sys.argv[1]), int(sys.argv[2]), int(sys.argv[3]))
