"""Which importer reads a file: known from its first bytes, and from the ending of its name where these say nothing."""

from __future__ import annotations

import gzip
import zlib
from contextlib import ExitStack, closing
from dataclasses import replace
from pathlib import Path

from ...common.errors import InputError
from ...common.inputs import open_input, refuse_above
from ...store.folder import scratch_folder
from ..parser_process import Parser, open_confined
from ..tables import LoggerFile
from .csv_table import open_csv
from .map_file import Map

_MAGIC = (
    (b"MATLAB 5.0", "mat"),
    (b"MATLAB 7.3", "hdf5"),
    (b"\x89HDF\r\n\x1a\n", "hdf5"),
    (b"PAR1", "parquet"),
    (b"ARROW1", "feather"),
    (b"FEA1", "feather"),
    (b"\x93NUMPY", "numpy"),
    (b"CDF\x01", "netcdf"),
    (b"CDF\x02", "netcdf"),
    (b"CDF\x05", "netcdf"),
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
_SHEETS = (b"[Content_Types].xml", b"_rels/", b"docProps/", b"xl/")
"""How the name of the first file in a spreadsheet begins."""
_PARSERS = {
    "mat": Parser(".importers.matfile", "open_mat", "scipy.io"),
    "hdf5": Parser(".importers.hdf5", "open_hdf5", "h5py"),
    "parquet": Parser(".importers.parquet", "open_parquet", "pyarrow.parquet"),
    "feather": Parser(".importers.parquet", "open_feather", "pyarrow.feather"),
    "numpy": Parser(".importers.numpy_file", "open_numpy", "numpy"),
    "spreadsheet": Parser(".importers.spreadsheet", "open_spreadsheet", "openpyxl", unpacks=True),
    "netcdf": Parser(".importers.netcdf", "open_netcdf", "xarray"),
    "tdms": Parser(".importers.tdms", "open_tdms", "nptdms"),
    "ulog": Parser(".importers.ulog", "open_ulog", "pyulog"),
    "dataflash": Parser(".importers.dataflash", "open_dataflash", "pymavlink.DFReader"),
    "rosbag": Parser(".importers.rosbag", "open_rosbag", "rosbags.highlevel", unpacks=True, beside=True),
    "mdf": Parser(".importers.mdf", "open_mdf", "asammdf", unpacks=True),
}
"""Formats that a library reads: each in a process of its own. CSV is split into lines and cells here."""
_GZIP, _ZIP, _ZIP_NAME = b"\x1f\x8b", b"PK\x03\x04", 30  # 30: where a name begins (APPNOTE.TXT, 4.3.7)
_BLOCK_BYTES = 2**22  # of a read: bounds memory
_REFUSED = (
    (b"PK\x03\x04", "a ZIP archive", "its files, unpacked"),
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
    if head.startswith(_GZIP):
        return _unpacked(path, chosen)
    kind = _kind(path, head)
    for magic, what, instead in _REFUSED if kind is None else ():
        if head.startswith(magic):
            raise InputError(path.name, what, instead)
    return open_csv(path, chosen.csv.given()) if kind is None else open_confined(_PARSERS[kind], path)


def _kind(path: Path, head: bytes) -> str | None:
    """The parser of a file by its first bytes, then by its name; None: text."""
    if head.startswith(_ZIP):
        first = head[_ZIP_NAME : _ZIP_NAME + int.from_bytes(head[26:28], "little")]
        return "spreadsheet" if first.startswith(_SHEETS) else "numpy" if first.endswith(b".npy") else None
    kind = next((kind for magic, kind in _MAGIC if head.startswith(magic)), _NAMED.get(path.suffix.lower()))
    return "netcdf" if kind == "hdf5" and path.suffix.lower() in (".nc", ".nc4", ".cdf") else kind


def _unpacked(path: Path, chosen: Map) -> LoggerFile:
    """A file that gzip packed, by way of a scratch folder that is gone when the file is closed.

    Raises:
        InputError: It is damaged, packed twice, or larger than is allowed once unpacked.
    """
    if path.stem.lower().endswith(".gz"):
        raise InputError(path.name, "packed twice", "the file, packed once at most")
    with ExitStack() as stack:
        place = stack.enter_context(scratch_folder()) / (path.stem or "unpacked")
        size = 0
        try:
            with gzip.open(path) as packed, place.open("xb") as whole:
                while block := packed.read(_BLOCK_BYTES):
                    size += len(block)
                    refuse_above("recording_mib", size / 2**20, path.name, "MiB")
                    whole.write(block)
        except (OSError, EOFError, zlib.error) as error:
            what = " ".join(str(error).split())[:100]
            raise InputError(path.name, f"cannot be unpacked ({what})", "a whole .gz file") from error
        file = stack.enter_context(closing(open_logger_file(place, chosen)))
        return replace(file, path=path, close=stack.pop_all().close)
