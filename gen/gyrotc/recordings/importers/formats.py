"""Which importer reads a file: told from its first bytes, and from the ending of its name where these say nothing."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from ...common.errors import InputError
from ...common.inputs import open_input, refuse_above
from .csv_table import open_csv
from .map_file import Map
from .tables import LoggerFile

__all__ = ["open_logger_file"]

_MAGIC = (
    (b"MATLAB 5.0", "mat"),
    (b"MATLAB 7.3", "hdf5"),
    (b"\x89HDF\r\n\x1a\n", "hdf5"),
    (b"PAR1", "parquet"),
    (b"TDSm", "tdms"),
    (b"ULog\x01\x12\x35", "ulog"),
    (b"\xa3\x95", "dataflash"),
    (b"#ROSBAG V2.0", "rosbag"),
    (b"\x89MCAP0\r\n", "rosbag"),
    (b"SQLite format 3\x00", "rosbag"),
    (b"MDF     ", "mdf"),
    (b"UnFinMF ", "mdf"),
)
_NAMED = {".mat": "mat"}
_REFUSED = (
    (b"PK\x03\x04", "a ZIP archive or a spreadsheet", "its files, unpacked; a spreadsheet saved as CSV"),
    (b"\x1f\x8b", "compressed by gzip", "the file unpacked (gunzip)"),
    (b"\x28\xb5\x2f\xfd", "compressed by zstd", "the file unpacked (unzstd)"),
    (b"\xd0\xcf\x11\xe0", "an old spreadsheet", "the sheet saved as CSV"),
)


def open_logger_file(path: Path, chosen: Map) -> LoggerFile:
    """Opens a file of any known format.

    Raises:
        InputError: It is of none, damaged, or its library is missing; the message says what goes on.
    """
    if path.is_dir():
        if (path / "metadata.yaml").is_file():
            return _opener("rosbag")(path)
        raise InputError(str(path), "is a folder", "files of a logger, or the folder of a ROS 2 bag")
    opened, _ = open_input(path, path.name, "a file of a logger")
    with opened as file:
        head = file.read(1024)
    for magic, what, instead in _REFUSED:
        if head.startswith(magic):
            raise InputError(path.name, what, instead)
    kind = next((kind for magic, kind in _MAGIC if head.startswith(magic)), _NAMED.get(path.suffix.lower()))
    if kind is None:
        return open_csv(path, chosen.csv.given())
    return _within_limits(_opener(kind)(path))


def _within_limits(file: LoggerFile) -> LoggerFile:
    """The file, where no table of it declares more rows than are read: a few bytes can declare any number."""
    try:
        for table in file.tables:
            refuse_above("rows", getattr(table, "rows", 0), f"{file.path.name} {table.name}".rstrip(), "rows")
            refuse_above("columns", len(table.columns), f"{file.path.name} {table.name}".rstrip(), "columns")
    except InputError:
        file.close()
        raise
    return file


def _opener(kind: str) -> Callable[[Path], LoggerFile]:
    """The function that opens a format; its library is imported only then."""
    if kind == "mat":
        from .matfile import open_mat as opener
    elif kind == "hdf5":
        from .hdf5 import open_hdf5 as opener
    elif kind == "parquet":
        from .parquet import open_parquet as opener
    elif kind == "tdms":
        from .tdms import open_tdms as opener
    elif kind == "ulog":
        from .ulog import open_ulog as opener
    elif kind == "dataflash":
        from .dataflash import open_dataflash as opener
    elif kind == "rosbag":
        from .rosbag import open_rosbag as opener
    else:
        from .mdf import open_mdf as opener
    return opener
