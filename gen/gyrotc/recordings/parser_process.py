"""Third-party libraries read a file of others in a process of its own, which hands back rows as Arrow streams.

A server is started once for a process that imports: a clean interpreter, which imports a library and forks for each
file, so that a file costs milliseconds. The fork takes limits of memory, time, rows and files, opens the
file and answers requests: what the file holds, then rows part by part. A crash, too much memory or time of it is a
message about the file. What it says is checked as the file itself would be: JSON and Arrow carry no code.

Limits (`setrlimit`) hold on every POSIX system, that of memory on Linux alone. Landlock (Linux 5.13) takes away every
file but those handed over, and with later versions TCP and signals to others:
https://docs.kernel.org/userspace-api/landlock.html, whose numbers stand below.
"""

from __future__ import annotations

import atexit
import ctypes
import functools
import importlib
import json
import math
import os
import resource
import signal
import socket
import struct
import subprocess
import sys
import sysconfig
import tempfile
import threading
import weakref
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import ExitStack, suppress
from dataclasses import dataclass
from datetime import datetime
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa

from ..common.arrays import numpy_of
from ..common.errors import InputError
from ..common.inputs import ENVIRONMENT, ceiling, refuse_above
from ..results.folder import scratch_folder
from .tables import Chunk, Column, LoggerFile, LoggerTable

_HEAD = struct.Struct(">cQ")  # kind and length of a message
_JSON, _ROWS, _REFUSED = b"j", b"r", b"e"
_FORK, _WAIT = b"f", b"w"  # what a server is asked for
_CEILINGS = {_JSON: "result_mib", _REFUSED: "text_mib", _ROWS: "memory_gib"}
_UNITS = {"result_mib": 2**20, "text_mib": 2**20, "memory_gib": 2**30}  # bytes
_SMALL_FILE = 2**23  # 8 MiB; larger files have as many times the processor time of one
_LEAST_MEMORY = 2**28  # 256 MiB, which a library may need for any file
_SLOWEST = 10  # elapsed time over processor time, where a dozen jobs share a core
_PASSED = ("LANG", "LC_ALL", "LD_LIBRARY_PATH", "PATH", "SYSTEMROOT")  # of the environment
_START = "import sys; sys.path[:] = sys.argv[2:]; from {} import serve; serve(int(sys.argv[1]))"


@dataclass(frozen=True, slots=True)
class Parser:
    """The reader of one format.

    Attributes:
        module: Module of this package that has it.
        function: Opens a path, gives a `LoggerFile`.
        library: Module that it needs, loaded before the fork.
        unpacks: Whether the reader needs a folder to unpack into.
    """

    module: str
    function: str
    library: str
    unpacks: bool = False


def open_confined(parser: Parser, path: Path) -> LoggerFile:
    """Opens a file by a reader that runs in a process of its own.

    Raises:
        InputError: The reader refuses the file, crashes on it, or needs more memory or time than is allowed.
    """
    worker = _Worker(parser, path)
    try:
        content = worker.ask({"do": "open"})
        tables = tuple(_Rows.of(worker, path, k, one) for k, one in enumerate(content["tables"]))
        for table in tables:
            where = f"{path.name} {table.name}".rstrip()
            refuse_above("rows", table.rows, where, "rows")
            refuse_above("columns", len(table.columns), where, "columns")
        return LoggerFile(
            path,
            content["format"],
            tables,
            content["facts"],
            close=worker.close,
        )
    except BaseException:
        worker.close()
        raise


@dataclass(frozen=True)
class _Rows(LoggerTable):
    """A table whose rows come from the worker."""

    file: str = ""
    index: int = 0
    worker: Any = None

    @staticmethod
    def of(worker: _Worker, path: Path, index: int, stated: dict[str, Any]) -> _Rows:
        started = stated["started"]
        return _Rows(
            stated["name"],
            tuple(Column(n, u, w, k, tuple(s)) for n, u, w, k, s in stated["columns"]),
            stated["rate_hz"],
            stated["why_rate"],
            datetime.fromisoformat(started) if started else None,
            tuple(stated["notes"]),
            file=path.name,
            index=index,
            rows=int(stated["rows"]),
            above=int(stated["above"]),
            worker=worker,
        )

    def chunks(self, names: Sequence[str]) -> Iterator[Chunk]:
        """As `LoggerTable.chunks`."""
        stream = self.worker.ask({"do": "start", "table": self.index, "names": list(names)})["stream"]
        first = 0
        while (batch := self.worker.rows({"do": "next", "stream": stream})) is not None:
            refuse_above("rows", first + len(batch), f"{self.file} {self.name}".rstrip(), "rows")
            values = {
                name: column if pa.types.is_string(column.type) else numpy_of(column)
                for name, column in zip(batch.schema.names, batch.columns, strict=True)
            }
            metadata = batch.schema.metadata
            yield Chunk(values, first, float(metadata[b"done"]), json.loads(metadata[b"left_out"]))
            first += len(batch)


class _Worker:
    """The process that reads one file, seen from the one that asks."""

    def __init__(self, parser: Parser, path: Path) -> None:
        self._path = path
        self._seconds = _cpu_seconds(path)
        with ExitStack() as stack:
            notes = stack.enter_context(scratch_folder()) if parser.unpacks else None
            request = {
                "parser": [parser.module, parser.function, parser.library, parser.unpacks],
                "path": str(path.absolute()),
                "cpu_s": self._seconds,
                "notes": str(notes) if notes else None,
                "ceilings": os.environ.get(ENVIRONMENT, ""),
            }
            self._server = _server(os.getpid())
            try:
                self._channel, self._pid = self._server.start(request)
            except OSError:  # somebody has ended it: the next file gets another
                self._server.stop()
                _server.cache_clear()
                raise self._broken("cannot be started") from None
            stack.callback(self._server.end, self._channel, self._pid)
            self.close = weakref.finalize(self, stack.pop_all().close)

    def ask(self, request: dict[str, Any]) -> dict[str, Any]:
        """An answer in JSON."""
        kind, data = self._answer(request)
        if kind != _JSON:
            raise self._broken("answers out of turn")
        answer: dict[str, Any] = json.loads(data)
        return answer

    def rows(self, request: dict[str, Any]) -> Any:
        """The next rows of a stream, None at its end."""
        kind, data = self._answer(request)
        if kind == _JSON:
            return None
        try:
            with pa.ipc.open_stream(pa.py_buffer(data)) as stream:
                batch = stream.read_next_batch()
            batch.validate(full=True)
        except (pa.ArrowException, OSError, StopIteration) as error:
            raise self._broken("hands back what is no Arrow stream") from error
        return batch

    def _answer(self, request: dict[str, Any]) -> tuple[bytes, Any]:
        self._channel.settimeout(self._seconds * _SLOWEST)
        try:
            _send(self._channel, _JSON, json.dumps(request).encode())
            kind, data = _receive(self._channel)
        except TimeoutError:
            raise self._broken(f"gives no answer for {self._seconds * _SLOWEST} s") from None
        except OSError:  # it has ended
            raise self._broken(self._ended()) from None
        if kind == _REFUSED:
            where, found, expected = json.loads(data)
            raise InputError(where, found, expected)
        return kind, data

    def _ended(self) -> str:
        number = self._server.wait(self._pid)
        if number == signal.SIGXCPU:
            return f"takes more than {self._seconds} s of processor time"
        return f"ends by {signal.Signals(number).name}" if number else "ends without an answer"

    def _broken(self, what: str) -> InputError:
        return InputError(self._path.name, f"its reader {what}", "a whole file (--max parser_s=... for more time)")


class _Server:
    """The process that forks for each file, seen from the one that asks."""

    def __init__(self) -> None:
        self._socket, its = socket.socketpair()
        self._lock = threading.Lock()
        self._ended: dict[int, int] = {}
        where = [str(Path(entry).absolute()) for entry in sys.path]
        passed = {name: os.environ[name] for name in _PASSED if name in os.environ}
        one = {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}  # a fork takes along no thread
        with its:
            self._process = subprocess.Popen(
                [sys.executable, "-I", "-c", _START.format(__name__), str(its.fileno()), *where],
                pass_fds=[its.fileno()],
                env=passed | one,
                cwd="/",
                stdin=subprocess.DEVNULL,
                stdout=subprocess.DEVNULL,
                stderr=subprocess.DEVNULL,
                start_new_session=True,
            )

    def start(self, request: dict[str, Any]) -> tuple[socket.socket, int]:
        """A process for a file: what to talk to it by, and its number."""
        mine, its = socket.socketpair()
        with its, self._lock:
            socket.send_fds(self._socket, [_FORK], [its.fileno()])
            return mine, self._ask(request)

    def wait(self, pid: int) -> int:
        """The signal by which a process ended, 0 for none; waits for its end."""
        with self._lock:
            if pid not in self._ended:
                self._socket.sendall(_WAIT)
                self._ended[pid] = self._ask({"pid": pid})
            return self._ended[pid]

    def end(self, channel: socket.socket, pid: int) -> None:
        """Ends a process, whatever it does."""
        channel.close()
        if pid not in self._ended:
            with suppress(ProcessLookupError):
                os.kill(pid, signal.SIGKILL)
            with suppress(OSError):
                self.wait(pid)
        del self._ended[pid]

    def stop(self) -> None:
        """Ends the server, and all that it started."""
        self._socket.close()
        self._process.wait()

    def _ask(self, request: dict[str, Any]) -> int:
        _send(self._socket, _JSON, json.dumps(request).encode())
        return int(json.loads(_receive(self._socket)[1]))


@functools.lru_cache(maxsize=1)
def _server(pid: int) -> _Server:
    """The server of a process; one that was forked from it has its own."""
    server = _Server()
    atexit.register(lambda: server.stop() if os.getpid() == pid else None)
    return server


def _cpu_seconds(path: Path) -> int:
    size = path.stat().st_size
    return math.ceil(ceiling("parser_s") * math.ceil(max(size, 1) / _SMALL_FILE))


def _send(channel: socket.socket, kind: bytes, data: bytes | pa.Buffer) -> None:
    channel.sendall(_HEAD.pack(kind, len(memoryview(data))))
    channel.sendall(data)


def _receive(channel: socket.socket) -> tuple[bytes, bytearray]:
    """The next message.

    Raises:
        ConnectionError: The other side has ended.
        InputError: It is of no kind, or longer than one of its kind may be.
    """
    kind, size = _HEAD.unpack(_exactly(channel, _HEAD.size))
    name = _CEILINGS.get(kind)
    if name is None:
        raise ConnectionError("a message of no kind")
    refuse_above(name, size / _UNITS[name], "what a file holds", "MiB" if name != "memory_gib" else "GiB")
    return kind, _exactly(channel, size)


def _exactly(channel: socket.socket, size: int) -> bytearray:
    data = bytearray(size)
    at = 0
    while at < size:
        count = channel.recv_into(memoryview(data)[at:])
        if count == 0:
            raise ConnectionError("the other side has ended")
        at += count
    return data


# From here on: what runs in the server and in the processes that it forks.


def serve(handle: int) -> None:
    """Answers requests by a socket, until that is closed: forks for a file, or waits for the end of a fork."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    with socket.socket(fileno=handle) as requests, suppress(ConnectionError):
        while True:
            what, handles, _, _ = socket.recv_fds(requests, 1, 1)
            if not what:
                return
            request = json.loads(_receive(requests)[1])
            number = _forked(requests, handles[0], request) if what == _FORK else _end_of(request["pid"])
            _send(requests, _JSON, json.dumps(number).encode())


def _end_of(pid: int) -> int:
    """The signal that ended a process, 0 for none."""
    _, status = os.waitpid(pid, 0)
    return os.WTERMSIG(status) if os.WIFSIGNALED(status) else 0


def _forked(requests: socket.socket, handle: int, request: dict[str, Any]) -> int:
    """Loads what a file needs, and forks: its number."""
    parser = Parser(*request["parser"])
    for name in (parser.module, parser.library):
        with suppress(Exception):  # the reader says what is missing
            importlib.import_module(name, __package__)
    pid = os.fork()
    if pid == 0:
        try:
            requests.close()
            with socket.socket(fileno=handle) as channel:
                _work(channel, parser, request)
        finally:
            os._exit(0)
    os.close(handle)
    return pid


def _work(channel: socket.socket, parser: Parser, request: dict[str, Any]) -> None:
    """Reads one file, as it is asked for."""
    os.environ[ENVIRONMENT] = request["ceilings"]
    path = Path(request["path"])
    notes = [Path(request["notes"])] if request["notes"] else []
    if notes:
        tempfile.tempdir = request["notes"]
    memory = int(ceiling("memory_gib") * 2**30)
    confine(
        memory_bytes=max(memory, _LEAST_MEMORY),
        cpu_s=request["cpu_s"],
        file_bytes=memory if notes else 0,
        readable=[path],
        writable=notes,
    )
    reading = _Reading(parser, path)
    while True:
        try:
            asked = json.loads(_receive(channel)[1])
            _send(channel, *_answered(reading, asked))
        except ConnectionError:
            return


def _answered(reading: _Reading, asked: dict[str, Any]) -> tuple[bytes, bytes | pa.Buffer]:
    name = reading.path.name
    try:
        return reading.answer(asked)
    except InputError as error:
        refused = [error.where, error.found, error.expected]
    except MemoryError:
        found = f"takes more than {ceiling('memory_gib'):g} GiB of memory"
        refused = [name, found, "a smaller file, or --max memory_gib=..."]
    except Exception as error:  # whatever a damaged file makes of a library
        what = " ".join(str(error).split())[:100]
        refused = [name, f"is damaged ({type(error).__name__}: {what})", "a whole file"]
    return _REFUSED, json.dumps(refused).encode()


class _Reading:
    """A file that is being read."""

    def __init__(self, parser: Parser, path: Path) -> None:
        self.path = path
        self._parser = parser
        self._tables: tuple[LoggerTable, ...] = ()
        self._streams: list[Iterator[Chunk]] = []

    def answer(self, asked: dict[str, Any]) -> tuple[bytes, bytes | pa.Buffer]:
        """The answer to one request: kind and content of a message."""
        if asked["do"] == "open":
            return _JSON, json.dumps(self._opened()).encode()
        if asked["do"] == "start":
            self._streams.append(self._tables[asked["table"]].chunks(asked["names"]))
            return _JSON, json.dumps({"stream": len(self._streams) - 1}).encode()
        chunk = next(self._streams[asked["stream"]], None)
        return (_JSON, b"null") if chunk is None else (_ROWS, _stream_of(chunk))

    def _opened(self) -> dict[str, Any]:
        module = importlib.import_module(self._parser.module, __package__)
        opener: Callable[[Path], LoggerFile] = getattr(module, self._parser.function)
        file = opener(self.path)
        self._tables = file.tables
        return {
            "format": file.format,
            "facts": file.facts,
            "tables": [_stated(table) for table in file.tables],
        }


def _stated(table: LoggerTable) -> dict[str, Any]:
    return {
        "name": table.name,
        "columns": [[c.name, c.unit, c.why, c.kind, list(c.sample)] for c in table.columns],
        "rate_hz": table.rate_hz,
        "why_rate": table.why_rate,
        "started": table.started.isoformat() if table.started else None,
        "notes": list(table.notes),
        "rows": table.rows,
        "above": table.above,
    }


def _stream_of(chunk: Chunk) -> pa.Buffer:
    """Rows as an Arrow stream of one batch."""
    arrays = [_array(values) for values in chunk.columns.values()]
    batch = pa.RecordBatch.from_arrays(arrays, names=list(chunk.columns))
    left_out = json.dumps(dict(chunk.left_out))
    batch = batch.replace_schema_metadata({"done": repr(float(chunk.done)), "left_out": left_out})
    sink = pa.BufferOutputStream()
    with pa.ipc.new_stream(sink, batch.schema) as stream:
        stream.write_batch(batch)
    return sink.getvalue()


def _array(values: Any) -> pa.Array:
    if isinstance(values, pa.Array):
        return values
    wide = values.dtype.kind == "f" and values.dtype.itemsize > 8  # Arrow has no wider numbers
    return pa.array(values.astype(np.float64) if wide else values)


_CREATE, _ADD_RULE, _RESTRICT = 444, 445, 446  # system calls, the same on every processor
_VERSION = 1  # flag of _CREATE: only asks for the version
_PATH_BENEATH = 1  # kind of a rule: what lies in a folder, or is a file
_NO_NEW_PRIVILEGES, _DEATH_SIGNAL = 38, 1  # PR_SET_NO_NEW_PRIVS, PR_SET_PDEATHSIG of prctl
_READ_FILE, _READ_FOLDER = 1 << 2, 1 << 3  # LANDLOCK_ACCESS_FS_READ_FILE, READ_DIR
_RIGHTS = {1: 13, 2: 14, 3: 15, 5: 16}  # rights to files that a version knows: bits 0 to n - 1
_OPEN_FILES = 64


def confine(
    *, memory_bytes: int, cpu_s: int, file_bytes: int, readable: Iterable[Path], writable: Iterable[Path]
) -> None:
    """Limits this process for the rest of its life.

    Args:
        memory_bytes: Most that its data may take besides what is there now: interpreter and libraries.
        cpu_s: Processor time, s; then it is killed.
        file_bytes: Largest file that it may write, 0: none.
        readable: Files and folders that it may read, besides Python's own.
        writable: Folders in which it may do anything.
    """
    _limit(resource.RLIMIT_CORE, 0)
    _limit(resource.RLIMIT_DATA, _data_bytes() + memory_bytes)
    _limit(resource.RLIMIT_CPU, cpu_s, cpu_s + 1)  # at the harder one comes a signal that names no reason
    _limit(resource.RLIMIT_FSIZE, file_bytes)
    _limit(resource.RLIMIT_NOFILE, _OPEN_FILES)
    if sys.platform == "linux":
        libc = ctypes.CDLL(None, use_errno=True)
        libc.prctl(_DEATH_SIGNAL, signal.SIGKILL, 0, 0, 0)
        _landlock(libc, [*_of_python(), *readable], writable)


def landlock_version() -> int:
    """Version of Landlock that the kernel offers, 0: none."""
    if sys.platform != "linux":
        return 0
    return max(int(ctypes.CDLL(None, use_errno=True).syscall(_CREATE, None, 0, _VERSION)), 0)


def _limit(kind: int, soft: int, hard: int | None = None) -> None:
    """Sets a limit, where no harder one is in force; `hard`: where that differs from the soft one."""
    now = resource.getrlimit(kind)[1]
    both = soft, soft if hard is None else hard
    with suppress(OSError, ValueError):  # a system without that limit
        resource.setrlimit(kind, both if now == resource.RLIM_INFINITY else (min(both[0], now), min(both[1], now)))


def _data_bytes() -> int:
    """What counts against the limit of data now."""
    try:
        pages = Path("/proc/self/statm").read_text(encoding="ascii").split()[5]
    except OSError:  # no Linux, where the limit of data does not bind either
        return 0
    return int(pages) * resource.getpagesize()


def _of_python() -> Iterator[Path]:
    """Where modules and libraries lie that may be loaded later."""
    yield Path(__file__).resolve().parents[1]
    for name in ("stdlib", "platstdlib", "purelib", "platlib"):
        yield Path(sysconfig.get_path(name))
    yield from (Path(entry) for entry in sys.path if Path(entry).name.endswith("-packages"))
    yield from (Path(entry) for entry in ("/lib", "/lib64", "/usr/lib", "/usr/lib64", "/usr/share/zoneinfo"))


def _landlock(libc: ctypes.CDLL, readable: Iterable[Path], writable: Iterable[Path]) -> None:
    version = landlock_version()
    if version == 0:
        return
    rights = (1 << max(bits for since, bits in _RIGHTS.items() if since <= version)) - 1
    network, scopes = (3 if version >= 4 else 0), (3 if version >= 6 else 0)
    words = (rights, network, scopes)[: 1 + (version >= 4) + (version >= 6)]
    attributes = b"".join(word.to_bytes(8, sys.byteorder) for word in words)
    rules = libc.syscall(_CREATE, attributes, len(attributes), 0)
    if rules < 0:
        return
    for paths, allowed in ((readable, _READ_FILE | _READ_FOLDER), (writable, rights)):
        for path in paths:
            _allow(libc, rules, path, allowed)
    libc.prctl(_NO_NEW_PRIVILEGES, 1, 0, 0, 0)
    libc.syscall(_RESTRICT, rules, 0)
    os.close(rules)


def _allow(libc: ctypes.CDLL, rules: int, path: Path, rights: int) -> None:
    try:
        handle = os.open(path, os.O_PATH | os.O_CLOEXEC)
    except OSError:  # a folder that this system does not have
        return
    if not path.is_dir():
        rights &= _READ_FILE
    rule = rights.to_bytes(8, sys.byteorder) + handle.to_bytes(4, sys.byteorder, signed=True)
    libc.syscall(_ADD_RULE, rules, _PATH_BENEATH, rule, 0)
    os.close(handle)
