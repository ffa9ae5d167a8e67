"""Windows, by what every operating system has. It works on Linux as well, where it is tested.

A child is asked to end, and notices its parent's end, by its stdin. The private channel is TCP of
this machine: whoever connects shows a password, which stands in a file in this user's folder.
"""

import faulthandler
import os
import secrets
import socket
import subprocess
from collections.abc import Callable, Iterable, Sequence
from contextlib import suppress
from io import FileIO
from pathlib import Path
from signal import Signals
from typing import Any, TypedDict

import psutil

NEEDS_POSIX = "needs Linux or macOS"
PRIVATE = "unixsock-stream/"  # before the path, in an endpoint of this machine
PASSWORDS = "transport/auth/usrpwd"  # place in Zenoh's configuration

# Processes.

STDIN = subprocess.PIPE


class NewGroup(TypedDict):
    creationflags: int


APART = NewGroup(creationflags=getattr(subprocess, "CREATE_NEW_PROCESS_GROUP", 0))
WINDOWS = True


def exists(pid: int) -> bool:
    return psutil.pid_exists(pid)


def began(pid: int) -> float | None:
    with suppress(psutil.Error):
        return psutil.Process(pid).create_time()
    return None


def is_parent(pid: int) -> bool:
    return exists(pid)  # a program that only starts Python may stand between them


def wait_until_unwanted(parent: int) -> bool:  # noqa: ARG001 - whoever has the other end
    return bool(os.read(0, 1))


def ask_to_end(process: "subprocess.Popen[bytes]") -> None:
    assert process.stdin is not None
    with suppress(OSError, ValueError):  # it has ended, or was asked before
        process.stdin.write(b".")
        process.stdin.close()


def kill_all(process: "subprocess.Popen[bytes]") -> None:
    found = [process.pid] if process.poll() is None else []
    with suppress(psutil.Error):
        found += [each.pid for each in psutil.Process(process.pid).children(recursive=True)]
    for pid in found:
        with suppress(psutil.Error):
            psutil.Process(pid).kill()


def end_within(seconds: float) -> None:
    if seconds > 0:
        faulthandler.dump_traceback_later(seconds, exit=True)
    else:
        faulthandler.cancel_dump_traceback_later()


def exact_timers() -> None:
    """Those of Windows are, since Python 3.11."""


def memory_mb() -> float:
    return psutil.Process().memory_info().rss / 1e6


def cores() -> int:
    return os.cpu_count() or 1


# Signals.

HANG_UP: tuple[Signals, ...] = ()


def hold_back(signals: Iterable[Signals]) -> Callable[[], None]:  # noqa: ARG001 - it cannot
    return lambda: None


# Terminals and cables.


def is_unread(output: int) -> bool:
    return not os.isatty(output)


def serial(device: str, baud: int) -> FileIO:  # noqa: ARG001 - as in posix
    raise OSError(f"a cable {NEEDS_POSIX}")


# Files and folders.


class Lock:
    """A file beside what is locked, which Windows removes with its process."""

    is_known = True

    def __init__(self, path: Path) -> None:
        self._path = path
        flags = os.O_CREAT | os.O_EXCL | os.O_RDWR | getattr(os, "O_TEMPORARY", 0)
        self._descriptor: int | None = os.open(path, flags, 0o600)

    def release(self) -> None:
        if self._descriptor is not None:
            os.close(self._descriptor)
            self._descriptor = None
            self._path.unlink(missing_ok=True)


def lock(path: Path) -> Lock | None:
    path.stat()
    try:
        return Lock(path.with_name(f".{path.name}.lock"))
    except FileExistsError:
        return None


def sync_folder(folder: Path) -> None:
    folder.stat()  # NTFS writes names in their order


def others_may(path: Path, mode: int) -> bool:  # noqa: ARG001 - Windows has no such bits
    path.stat()
    return False  # Windows says by other means who may; the home folder is its user's


def point(pointer: Path, name: str) -> None:
    with suppress(FileNotFoundError):
        pointer.unlink()  # Windows does not put one link to a folder in the place of another
    pointer.symlink_to(name, target_is_directory=True)


# The private channel between the processes of a machine.

LOCAL = "ws"  # which nothing else uses, so that access control can tell it apart
HERE = "127.0.0.1"
NOBODY = 1  # a port at which nobody listens


def local_channel(
    listen: Sequence[str], connect: Sequence[str]
) -> tuple[Sequence[str], Sequence[str], dict[str, Any]]:
    """Where POSIX has the socket there is a file with `PORT:PASSWORD`, which is what Zenoh takes as
    a list of users with their passwords.

    Raises:
        OSError: a hub would be private and public, and its password for both; or the file cannot
            be written.
    """
    private = [end for end in (*listen, *connect) if end.startswith(PRIVATE)]
    if not private:
        return listen, connect, {}
    path = Path(private[0].removeprefix(PRIVATE))
    if private[0] in listen:
        if len(listen) > 1:
            raise OSError(f"to let other machines in at {listen[-1]} {NEEDS_POSIX}")
        listen = [f"{LOCAL}/{HERE}:{_written(path)}"]
        return listen, connect, {PASSWORDS: {"dictionary_file": str(path)}}
    port, password = _read(path) or (str(NOBODY), "")
    return listen, [f"{LOCAL}/{HERE}:{port}"], {PASSWORDS: {"user": port, "password": password}}


def _written(path: Path) -> str:
    """The port of a hub. One that starts again is found where it was."""
    if (known := _read(path)) is None:
        with socket.create_server((HERE, 0)) as free:
            known = str(free.getsockname()[1]), secrets.token_hex(32)
        fresh = path.with_name(f"{path.name}-{os.getpid()}")
        fresh.touch(mode=0o600)
        fresh.write_text(":".join(known), encoding="ascii")
        fresh.replace(path)
    return known[0]


def _read(path: Path) -> tuple[str, str] | None:
    try:
        port, _, password = path.read_text(encoding="ascii").partition(":")
    except FileNotFoundError:
        return None
    return port, password
