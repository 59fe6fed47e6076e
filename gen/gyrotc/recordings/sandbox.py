"""What a process that reads a file of others may still do: limits of the system for it, and Landlock where it is.

Limits (`setrlimit`) hold on every POSIX system, that of memory on Linux alone. Landlock (Linux 5.13) takes away every
file but those handed over, and with later versions TCP and signals to others:
https://docs.kernel.org/userspace-api/landlock.html, whose numbers stand below.
"""

from __future__ import annotations

import ctypes
import os
import resource
import signal
import sys
import sysconfig
from collections.abc import Iterable, Iterator
from contextlib import suppress
from pathlib import Path

_CREATE, _ADD_RULE, _RESTRICT = 444, 445, 446  # system calls, the same on every processor
_VERSION = 1  # flag of _CREATE: only asks for the version
_PATH_BENEATH = 1  # kind of a rule: what lies in a folder, or is a file
_NO_NEW_PRIVILEGES, _DEATH_SIGNAL = 38, 1  # PR_SET_NO_NEW_PRIVS, PR_SET_PDEATHSIG of prctl
_READ_FILE, _READ_FOLDER = 1 << 2, 1 << 3  # LANDLOCK_ACCESS_FS_READ_FILE, READ_DIR
_RIGHTS = {1: 13, 2: 14, 3: 15, 5: 16}  # rights to files that a version knows: bits 0 to n - 1
_OPEN_FILES = 64  # a bag of several files has a few open at once


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
