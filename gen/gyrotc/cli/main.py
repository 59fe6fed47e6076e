"""The command `gyrotc`: the entry point, exit statuses, and what happens when the program itself fails."""

from __future__ import annotations

import contextlib
import ctypes
import hashlib
import logging
import os
import platform
import signal
import stat
import sys
import tempfile
import traceback
import warnings
from itertools import islice
from pathlib import Path
from typing import TYPE_CHECKING

from .. import __version__
from ..common.errors import GyrotcError, InputError
from ..common.texts import terminal_line, terminal_text
from ..common.threads import single_threaded

if TYPE_CHECKING:
    from typer import Typer

EXIT_STATUS = 70
"""EX_SOFTWARE of sysexits.h: an internal fault, not one of the input."""


def crash_line(error: BaseException) -> str:
    """Write the report of an unexpected exception, and return the line for the user, with its id and place.

    The id follows from where the program failed, so that the same fault has the same id everywhere.
    """
    frames = [f"{Path(f.filename).name}:{f.lineno}:{f.name}" for f in traceback.extract_tb(error.__traceback__)]
    kind = type(error).__name__
    number = hashlib.sha256(" ".join([__version__, kind, *frames]).encode()).hexdigest()[:8]
    text = "\n".join(
        [
            f"gyrotc {__version__}, report {number}",
            f"Python {sys.version.split()[0]}, {platform.platform()}",
            f"arguments: {sys.argv[1:]!r}",
            "",
            *traceback.format_exception(error),
        ]
    )
    found = " ".join(f"{kind}: {error}".split())[:160]
    found = "".join(c if c.isprintable() else "?" for c in found)
    return f"internal fault {number} ({found}); {_kept(number, text)}"


def _kept(number: str, text: str) -> str:
    """Write the report to the user's folder of state, else to that of temporary files, and return its path."""
    from platformdirs import user_state_path

    state = user_state_path("gyrotc", appauthor=False)
    for folder in (state, Path(tempfile.gettempdir())):
        try:
            folder.mkdir(parents=True, exist_ok=True, mode=0o700)
            handle, name = tempfile.mkstemp(prefix=f"crash-{number}-", suffix=".txt", dir=folder)
            with os.fdopen(handle, "w", encoding="utf-8", errors="backslashreplace") as file:
                file.write(text)
        except OSError:
            continue
        return f"please send {name}"
    return "its report could not be written"


_LOOP = "Symlink loop"  # what `Path.resolve` says of links that lead to one another, until Python 3.13
_CLOSED = 128 + 13  # what a shell reports of a program that SIGPIPE ended


def main() -> None:
    """Entry point: the command's exit status, without tearing the interpreter down.

    Arrow's read-ahead threads may still hold a Python file when the interpreter goes; it would end them inside C++
    code, which aborts the process after its work is done.
    """
    _open_closed_streams()
    _quiet_start()
    single_threaded()
    _returning_columns()
    _without_warnings()
    os.umask(os.umask(0) & ~stat.S_IRWXU)  # what gyrotc writes it reads again
    from ..results.signals import Interrupted, die_of, raise_on_signals

    raise_on_signals()
    try:
        status = flushed(run(sys.argv[1:]))
    except Interrupted as end:
        with contextlib.suppress(OSError):  # the terminal may be gone
            print(f"gyrotc: interrupted ({end})", file=sys.stderr, flush=True)
        die_of(end.number)
    os._exit(status)


_COLUMN_BYTES = 2**23  # of a recording of 1e6 rows; what is done part by part stays below
_MMAP_THRESHOLD, _TRIM_THRESHOLD = -3, -1  # names of glibc's mallopt


def _returning_columns() -> None:
    """Give columns of long recordings back to the system when they are freed, if the C library is glibc.

    Left to itself it keeps what was freed of up to 32 MiB; so does the allocator that Arrow brings along.
    """
    os.environ.setdefault("ARROW_DEFAULT_MEMORY_POOL", "system")
    with contextlib.suppress(OSError, AttributeError):
        mallopt = ctypes.CDLL(None).mallopt
        mallopt(_MMAP_THRESHOLD, _COLUMN_BYTES)
        mallopt(_TRIM_THRESHOLD, _COLUMN_BYTES)


def _open_closed_streams() -> None:
    """Standard streams that were closed lead nowhere, else the next file opened would get their number."""
    for number, name in enumerate(("stdin", "stdout", "stderr")):
        if getattr(sys, name) is None:
            handle = os.open(os.devnull, os.O_RDWR)
            if handle != number:
                os.dup2(handle, number)
                os.close(handle)
            setattr(sys, name, os.fdopen(number, "w" if number else "r", encoding="utf-8", closefd=False))


def _quiet_start() -> None:
    """Until `raise_on_signals` Ctrl-C ends the process as it ends any other: nothing is begun that could be cleaned up.

    Python's own answer would be a traceback out of the middle of an import. A signal that is ignored stays so.
    """
    if signal.getsignal(signal.SIGINT) is signal.default_int_handler:
        signal.signal(signal.SIGINT, signal.SIG_DFL)


def flushed(status: int) -> int:
    """Print what is still buffered; return the command's status, or that of a failure, which is reported once."""
    try:
        sys.stdout.flush()
        sys.stderr.flush()
    except OSError as error:
        return status if status == GyrotcError.exit_status else _failed(error)
    return status


def _failed(error: OSError) -> int:
    """One line of a file that cannot be read or written; none where the reader of stdout has gone."""
    if isinstance(error, BrokenPipeError):
        return _CLOSED
    where = error.filename or "standard output"
    with contextlib.suppress(OSError):
        print(f"gyrotc: {terminal_line(f'{where}: {error.strerror or error}')}", file=sys.stderr, flush=True)
    return GyrotcError.exit_status


def _without_warnings() -> None:
    """Silence warnings and logs of libraries, here and in processes of a fleet: they are no news to a user.

    Whoever asks for warnings (`PYTHONWARNINGS`, `python -W`) gets them; in tests each one is an error (`pytest.ini`).
    """
    if not sys.warnoptions:
        warnings.simplefilter("ignore")
        os.environ.setdefault("PYTHONWARNINGS", "ignore")
        logging.disable()  # of Dask: what becomes of a gyro is reported by the fleet


# Options of the whole program, taken after the command as well; the last one has a value.
_ANYWHERE = ("-q", "--quiet", "-v", "--verbose")
_CEILING = "--max"


def hoisted(arguments: list[str]) -> list[str]:
    """The arguments with what concerns the whole program in front; what stands behind `--` is left alone."""
    end = arguments.index("--") if "--" in arguments else len(arguments)
    front: list[str] = []
    others: list[str] = []
    words = iter(arguments[:end])
    for word in words:
        if word == _CEILING:
            value = list(islice(words, 1))
            if not value:
                return [word]  # the option says that it lacks its value; in front of a command it would take its name
            front += [word, *value]
        else:
            (front if word in _ANYWHERE or word.startswith(f"{_CEILING}=") else others).append(word)
    return [*front, *others, *arguments[end:]]


def application() -> Typer:
    """The application with all its subcommands: importing a module of them registers its own."""
    from . import certificate, fleet, jobs, recordings, schema, steps  # noqa: F401
    from .application import app

    return app


def run(arguments: list[str]) -> int:
    """Run one command in this process and return its exit status; an error becomes one message on stderr.

    Signals, threads and warnings are the caller's, so that a program or a test may run many commands.
    """
    try:
        application()(hoisted(arguments), prog_name="gyrotc", standalone_mode=True)
    except GyrotcError as error:
        if isinstance(error, InputError):
            text = "\n".join(map(terminal_line, error.lines))
        else:
            text = terminal_text(str(error))  # compilers say more than a line
        print(f"gyrotc: {text}", file=sys.stderr)
        return error.exit_status
    except OSError as error:
        return _failed(error)
    except SystemExit as end:
        if isinstance(end.__context__, BrokenPipeError):  # typer's own way of ending then
            return _CLOSED
        return end.code if isinstance(end.code, int) else int(end.code is not None)
    except MemoryError:
        print("gyrotc: not enough memory for this job on this machine", file=sys.stderr)
        return GyrotcError.exit_status
    except Exception as error:  # a fault of the program: the user gets one line, the file gets the traceback
        from ..results.signals import interruption_in

        if (interruption := interruption_in(error)) is not None:
            raise interruption from None
        if isinstance(error, RuntimeError) and str(error).startswith(_LOOP):
            print(f"gyrotc: {terminal_line(str(error))}; expected a path that ends somewhere", file=sys.stderr)
            return GyrotcError.exit_status
        print(f"gyrotc: {crash_line(error)}", file=sys.stderr)
        return EXIT_STATUS
    return 0
