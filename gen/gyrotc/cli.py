"""The command `gyrotc`: the entry point. Commands print in `commands`; only this module exits."""

from __future__ import annotations

import os
import sys

from .errors import GyrotcError
from .texts import terminal_text

_INTERRUPTED = 130  # 128 + SIGINT, as a shell reports it


def main() -> None:
    """Entry point: the command's exit status, without tearing the interpreter down.

    Arrow's read-ahead threads may still hold a Python file when the interpreter goes; it would end them inside C++
    code, which aborts the process after its work is done.
    """
    _single_threaded()
    status = _status()
    sys.stdout.flush()
    sys.stderr.flush()
    os._exit(status)


def _single_threaded() -> None:
    """One thread of BLAS unless the user says otherwise; read when numpy is first imported.

    The matrices here are small: more threads gain nothing, and on a busy machine they cost many times the work.
    """
    for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
        os.environ.setdefault(name, "1")


def _status() -> int:
    """Runs the command; errors become one message on stderr and their exit status."""
    try:
        from .commands import app

        app(standalone_mode=True)
    except GyrotcError as error:
        print(f"gyrotc: {terminal_text(str(error))}", file=sys.stderr)
        return error.exit_status
    except BrokenPipeError:
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 0
    except SystemExit as end:
        return end.code if isinstance(end.code, int) else int(end.code is not None)
    except KeyboardInterrupt:
        return _INTERRUPTED
    except MemoryError:
        print("gyrotc: not enough memory for this job on this machine", file=sys.stderr)
        return GyrotcError.exit_status
    except Exception as error:  # a fault of the program: the user gets one line, the file gets the traceback
        from .crash import EXIT_STATUS, crash_line

        print(f"gyrotc: {crash_line(error)}", file=sys.stderr)
        return EXIT_STATUS
    return 0
