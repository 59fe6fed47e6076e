"""The command `gyrotc`: the entry point. Commands print in `commands`; only this module exits."""

from __future__ import annotations

import os
import sys

from .commands import app
from .errors import GyrotcError


def main() -> None:
    """Entry point: the command's exit status, without tearing the interpreter down.

    Arrow's read-ahead threads may still hold a Python file when the interpreter goes; it would end them inside C++
    code, which aborts the process after its work is done.
    """
    status = _status()
    sys.stdout.flush()
    sys.stderr.flush()
    os._exit(status)


def _status() -> int:
    """Runs the command; errors become one message on stderr and their exit status."""
    try:
        app(standalone_mode=True)
    except GyrotcError as error:
        print(f"gyrotc: {error}", file=sys.stderr)
        return error.exit_status
    except BrokenPipeError:
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 0
    except SystemExit as end:
        return end.code if isinstance(end.code, int) else int(end.code is not None)
    return 0
