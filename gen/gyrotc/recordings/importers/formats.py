"""Which importer reads a file: known from its first bytes, and from the ending of its name where these say nothing."""

from __future__ import annotations

from pathlib import Path

from ...common.errors import InputError
from ...common.inputs import open_input
from .csv_table import open_csv
from .map_file import Map
from .parser_process import Parser, open_confined
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
_PARSERS = {
    "mat": Parser(".matfile", "open_mat", "scipy.io"),
    "hdf5": Parser(".hdf5", "open_hdf5", "h5py"),
    "parquet": Parser(".parquet", "open_parquet", "pyarrow.parquet"),
    "tdms": Parser(".tdms", "open_tdms", "nptdms"),
    "ulog": Parser(".ulog", "open_ulog", "pyulog"),
    "dataflash": Parser(".dataflash", "open_dataflash", "pymavlink.DFReader"),
    "rosbag": Parser(".rosbag", "open_rosbag", "rosbags.highlevel", unpacks=True, beside=True),
    "mdf": Parser(".mdf", "open_mdf", "asammdf", unpacks=True),
}
"""Formats that a library reads: each in a process of its own. CSV is split into lines and cells here."""
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
            return open_confined(_PARSERS["rosbag"], path)
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
    return open_confined(_PARSERS[kind], path)
