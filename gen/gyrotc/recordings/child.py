"""Read a file in a child process with limits, where a damaged file makes its library crash, run on or fill the memory.

The child opens the file, says what it holds, and hands back rows part by part as they are asked for: requests and
answers are lines of JSON, and rows follow their line as an Arrow stream. It is started for one file and ends with it.
However it ends, that is one message about the file.
"""

from __future__ import annotations

import importlib
import json
import math
import os
import resource
import signal
import subprocess
import sys
import threading
import weakref
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, suppress
from dataclasses import dataclass
from datetime import datetime
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
import pyarrow as pa

from ..common.arrays import numpy_of
from ..common.errors import InputError, short_reason
from ..common.inputs import ENVIRONMENT, ceiling
from ..common.threads import ONE_THREAD
from ..results.folder import scratch_folder
from .tables import Chunk, Column, LoggerFile, LoggerTable

Opener = Callable[[Path], LoggerFile]

# Larger files have as many times the processor time of one of this size, bytes.
_SMALL_FILE = 2**23
# A library may need so much for any file, bytes.
_MIN_MEMORY = 2**28
# Elapsed time over processor time, where a dozen jobs share a core.
_MAX_SLOWDOWN = 10
_MAX_OPEN_FILES = 64
# Names that a child has of the environment, besides those of gyrotc.
_PASSED = ("LANG", "LC_ALL", "LD_LIBRARY_PATH", "PATH", "SYSTEMROOT", ENVIRONMENT)
_START = f"import sys; sys.path[:] = sys.argv[4:]; from {__name__} import serve; serve(*sys.argv[1:4])"


def open_in_child(opener: Opener, path: Path) -> LoggerFile:
    """Open a file by a function that runs in a child process.

    Raises:
        InputError: The function refuses the file, crashes on it, or needs more memory or time than is allowed.
    """
    child = _Child(opener, path)
    try:
        content = child.ask({"do": "open"})
        tables = tuple(_ChildTable.of(child, k, one) for k, one in enumerate(content["tables"]))
        return LoggerFile(
            path, content["format"], tables, content["facts"], close=child.close, unread=tuple(content["unread"])
        )
    except BaseException:
        child.close()
        raise


@dataclass(frozen=True)
class _ChildTable(LoggerTable):
    """A table whose rows come from a child."""

    index: int = 0
    child: Any = None

    @staticmethod
    def of(child: _Child, index: int, stated: dict[str, Any]) -> _ChildTable:
        started = stated.pop("started")
        columns = tuple(Column(n, u, w, k, tuple(s)) for n, u, w, k, s in stated.pop("columns"))
        return _ChildTable(
            columns=columns,
            started=datetime.fromisoformat(started) if started else None,
            notes=tuple(stated.pop("notes")),
            index=index,
            child=child,
            **stated,
        )

    def chunks(self, names: Sequence[str]) -> Iterator[Chunk]:
        """Yield rows in order; see `LoggerTable.chunks`."""
        stream = self.child.ask({"do": "start", "table": self.index, "names": list(names)})["stream"]
        first = 0
        while (answer := self.child.ask({"do": "next", "stream": stream}))["rows"] is not None:
            batch = answer["rows"]
            values = {
                name: column if pa.types.is_string(column.type) else numpy_of(column)
                for name, column in zip(batch.schema.names, batch.columns, strict=True)
            }
            yield Chunk(values, first, answer["done"], answer["left_out"])
            first += len(batch)

    def place(self, row: int) -> str:
        """Return the place of a row in the words of the reader of the file."""
        return str(self.child.ask({"do": "place", "table": self.index, "row": row})["place"])


class _Child:
    """The process that reads one file, seen from the one that asks."""

    def __init__(self, opener: Opener, path: Path) -> None:
        self._path = path
        self._cpu_s = math.ceil(ceiling("parser_s") * math.ceil(max(path.stat().st_size, 1) / _SMALL_FILE))
        self._late = False
        with ExitStack() as stack:
            folder = stack.enter_context(scratch_folder())
            environment = {name: os.environ[name] for name in _PASSED if name in os.environ}
            environment |= {"TMPDIR": str(folder), **ONE_THREAD}
            where = [str(Path(entry).absolute()) for entry in sys.path]
            self._process = subprocess.Popen(
                [sys.executable, "-I", "-c", _START, opener.__module__, opener.__name__, str(self._cpu_s), *where],
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                stderr=subprocess.DEVNULL,
                env=environment,
                cwd=folder,
                start_new_session=True,
            )
            stack.callback(_end, self._process)
            self.close = weakref.finalize(self, stack.pop_all().close)

    def ask(self, request: dict[str, Any]) -> dict[str, Any]:
        """The answer to a request; `rows` of it are a batch of Arrow.

        Raises:
            InputError: The reader refuses the file, or the child has ended.
        """
        timer = threading.Timer(self._cpu_s * _MAX_SLOWDOWN, self._give_up)
        timer.start()
        try:
            answer = self._answer({"path": str(self._path.absolute()), **request})
        except (OSError, ValueError, KeyError, EOFError, pa.ArrowException):
            raise InputError(self._path.name, f"its reader {self._how_it_ended()}", _WHOLE) from None
        finally:
            timer.cancel()
        if refused := answer.get("refused"):
            raise InputError(*refused)
        return answer

    def _answer(self, request: dict[str, Any]) -> dict[str, Any]:
        assert self._process.stdin is not None and self._process.stdout is not None
        self._process.stdin.write(json.dumps(request).encode() + b"\n")
        self._process.stdin.flush()
        line = self._process.stdout.readline()
        if not line.endswith(b"\n"):
            raise EOFError
        answer: dict[str, Any] = json.loads(line)
        if size := answer.get("rows"):
            with pa.ipc.open_stream(_exactly(self._process.stdout, size)) as stream:
                answer["rows"] = stream.read_next_batch()
            answer["rows"].validate(full=True)
        return answer

    def _give_up(self) -> None:
        self._late = True
        self._process.kill()

    def _how_it_ended(self) -> str:
        with suppress(subprocess.TimeoutExpired):
            self._process.wait(timeout=1.0)
        status = self._process.poll()
        if self._late:
            return f"gives no answer for {self._cpu_s * _MAX_SLOWDOWN} s"
        if status == -signal.SIGXCPU:
            return f"takes more than {self._cpu_s} s of processor time"
        if status is not None and status < 0:
            return f"ends by {signal.Signals(-status).name}"
        return "ends without an answer" if status is not None else "gives no answer that can be read"


_WHOLE = "a whole file (--max parser_s=... for more time)"


def _exactly(stream: Any, size: int) -> bytes:
    data: bytes = stream.read(size)
    if len(data) != size:
        raise EOFError
    return data


def _end(process: subprocess.Popen[bytes]) -> None:
    """End a child, whatever it does."""
    process.kill()
    process.wait()
    for stream in (process.stdin, process.stdout):
        if stream is not None:
            with suppress(OSError):
                stream.close()


# From here on: what runs in the child.


def serve(module: str, function: str, cpu_s: str) -> None:
    """Answer requests for one file, line by line, until there are no more."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    answers = os.fdopen(os.dup(1), "wb")
    os.dup2(os.open(os.devnull, os.O_WRONLY), 1)  # a library that prints does not answer
    importlib.import_module("pyarrow.ipc")
    opener: Opener = getattr(importlib.import_module(module), function)
    _limit(int(cpu_s))
    reading = _Reading(opener)
    for line in sys.stdin.buffer:
        _send(answers, _answered(reading, json.loads(line)))


def _limit(cpu_s: int) -> None:
    """Limit this process: memory beyond that of the libraries now, processor time, files."""
    memory = max(int(ceiling("memory_gib") * 2**30), _MIN_MEMORY)
    for kind, soft, hard in (
        (resource.RLIMIT_CORE, 0, 0),
        (resource.RLIMIT_DATA, _data_bytes() + memory, _data_bytes() + memory),
        (resource.RLIMIT_CPU, cpu_s, cpu_s + 1),  # at the hard one comes a signal that names no reason
        (resource.RLIMIT_FSIZE, memory, memory),
        (resource.RLIMIT_NOFILE, _MAX_OPEN_FILES, _MAX_OPEN_FILES),
    ):
        most = resource.getrlimit(kind)[1]
        with suppress(OSError, ValueError):  # a system without that limit
            unlimited = most == resource.RLIM_INFINITY
            resource.setrlimit(kind, (soft, hard) if unlimited else (min(soft, most), min(hard, most)))


def _data_bytes() -> int:
    """Return the bytes that count against the limit of data now."""
    try:
        pages = Path("/proc/self/statm").read_text(encoding="ascii").split()[5]
    except OSError:  # no Linux, where the limit of data does not bind either
        return 0
    return int(pages) * resource.getpagesize()


@dataclass(frozen=True, slots=True)
class _Answer:
    """An answer, and the rows that follow it."""

    content: dict[str, Any]
    rows: pa.Buffer | None = None


def _send(answers: BinaryIO, answer: _Answer) -> None:
    rows = answer.rows
    content = answer.content | ({"rows": rows.size} if rows is not None else {})
    answers.write(json.dumps(content).encode() + b"\n")
    if rows is not None:
        answers.write(rows)
    answers.flush()


def _answered(reading: _Reading, request: dict[str, Any]) -> _Answer:
    name = Path(request["path"]).name
    try:
        return reading.answer(request)
    except InputError as error:
        refused = [error.where, error.found, error.expected]
    except MemoryError:
        found = f"takes more than {ceiling('memory_gib'):g} GiB of memory"
        refused = [name, found, "a smaller file, or --max memory_gib=..."]
    except Exception as error:  # whatever a damaged file makes of a library
        refused = [name, f"is damaged ({type(error).__name__}: {short_reason(error)})", "a whole file"]
    return _Answer({"refused": refused})


class _Reading:
    """A file that is being read."""

    def __init__(self, opener: Opener) -> None:
        self._opener = opener
        self._tables: tuple[LoggerTable, ...] = ()
        self._streams: list[Iterator[Chunk]] = []

    def answer(self, request: dict[str, Any]) -> _Answer:
        """The answer to one request."""
        if request["do"] == "open":
            file = self._opener(Path(request["path"]))
            self._tables = file.tables
            tables = [_stated(table) for table in file.tables]
            stated = {"format": file.format, "facts": file.facts, "tables": tables, "unread": file.unread}
            return _Answer(stated)
        if request["do"] == "place":
            return _Answer({"place": self._tables[request["table"]].place(request["row"])})
        if request["do"] == "start":
            self._streams.append(self._tables[request["table"]].chunks(request["names"]))
            return _Answer({"stream": len(self._streams) - 1})
        chunk = next(self._streams[request["stream"]], None)
        if chunk is None:
            return _Answer({"rows": None})
        return _Answer({"done": float(chunk.done), "left_out": dict(chunk.left_out)}, _stream_of(chunk))


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
    """Return rows as an Arrow stream of one batch."""
    batch = pa.RecordBatch.from_arrays([_array(v) for v in chunk.columns.values()], names=list(chunk.columns))
    sink = pa.BufferOutputStream()
    with pa.ipc.new_stream(sink, batch.schema) as stream:
        stream.write_batch(batch)
    return sink.getvalue()


def _array(values: Any) -> pa.Array:
    if isinstance(values, pa.Array):
        return values
    wide = values.dtype.kind == "f" and values.dtype.itemsize > 8  # Arrow has no wider numbers
    return pa.array(values.astype(np.float64) if wide else values)
