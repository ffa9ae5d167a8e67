"""Linux and macOS have POSIX, Windows has not: a function for whatever they do in different ways.

Windows is tested on Linux, which then counts as Windows as soon as `os.fork` is not there. On
Windows a child is asked to end by its stdin, and the private channel is TCP of this machine:
whoever connects shows a password, which stands in a file in this user's folder.
"""

import ctypes
import os
import secrets
import select
import signal
import socket
import subprocess
import sys
from collections.abc import Callable, Iterable, Sequence
from contextlib import suppress
from faulthandler import cancel_dump_traceback_later, dump_traceback_later
from io import FileIO
from mmap import PAGESIZE
from pathlib import Path
from typing import Any, NamedTuple, TypedDict

WINDOWS = not hasattr(os, "fork")  # beside it, `sys.platform` is what a type checker understands
PRIVATE = "unixsock-stream/"  # before the path, in an endpoint of this machine

# Processes.

STDIN = subprocess.PIPE  # of a child
# The terminal is gone.
HANG_UP = () if sys.platform == "win32" or WINDOWS else (signal.SIGHUP,)


class Apart(TypedDict):
    """How a child is started that Ctrl-C does not reach."""

    start_new_session: bool
    creationflags: int


NEW_GROUP = getattr(subprocess, "CREATE_NEW_PROCESS_GROUP", 0)
APART = Apart(start_new_session=not WINDOWS, creationflags=NEW_GROUP)


def exists(pid: int) -> bool:
    """Is there a process with this id?"""
    if WINDOWS:
        import psutil

        return psutil.pid_exists(pid)
    try:
        os.kill(pid, 0)  # signal 0 only asks
    except ProcessLookupError:
        return False
    except PermissionError:
        pass  # it is somebody else's
    return True


def began(pid: int) -> float | None:
    """When a process began, to tell it from a later one of the same id; None: there is none."""
    with suppress(OSError, ValueError, IndexError):  # Linux: a set clock changes nothing in it
        stat = Path(f"/proc/{pid}/stat").read_text(encoding="utf-8")
        return float(stat.rpartition(")")[2].split()[19])  # [clock ticks] since the boot
    with suppress(ImportError):
        import psutil

        with suppress(psutil.Error):
            return psutil.Process(pid).create_time()
    return None


def wait_until_unwanted() -> bool:
    """In a child that was started with `STDIN`: wait until it has to end. True: it was asked to;
    False: its parent has ended."""
    return bool(os.read(0, 1))


def ask_to_end(process: "subprocess.Popen[bytes]") -> None:
    """A child that was started with `STDIN` and `APART`."""
    if not WINDOWS:
        process.terminate()
        return
    assert process.stdin is not None
    with suppress(OSError, ValueError):  # it has ended, or was asked before
        process.stdin.write(b".")
        process.stdin.close()


def kill_all(process: "subprocess.Popen[bytes]") -> None:
    """End a child that was started with `APART`, and what it has started, even if it has ended."""
    if sys.platform != "win32" and not WINDOWS:
        with suppress(ProcessLookupError, PermissionError):  # nobody is left
            os.killpg(process.pid, signal.SIGKILL)
        return
    import psutil

    with suppress(psutil.Error):
        for child in psutil.Process(process.pid).children(recursive=True):
            with suppress(psutil.Error):
                child.kill()
    process.kill()


def end_within(seconds: float) -> None:
    """End this process after so long, whatever it does then; 0: do not."""
    if sys.platform != "win32" and not WINDOWS:
        signal.signal(signal.SIGALRM, signal.SIG_DFL)
        signal.setitimer(signal.ITIMER_REAL, seconds)
    elif seconds > 0:
        dump_traceback_later(seconds, exit=True)
    else:
        cancel_dump_traceback_later()


def exact_timers() -> None:
    """Timer slack of 1 ns instead of 50 µs, where Linux offers it: half the lateness."""
    with suppress(OSError, AttributeError, TypeError):
        ctypes.CDLL(None).prctl(29, 1, 0, 0, 0)  # PR_SET_TIMERSLACK


def memory_mb() -> float:
    """[MB] Memory of this process."""
    with suppress(OSError):  # Linux, where this is four times as fast and needs no library
        pages = int(Path("/proc/self/statm").read_text(encoding="ascii").split()[1])
        return pages * PAGESIZE / 1e6
    import psutil

    return psutil.Process().memory_info().rss / 1e6


def cores() -> int:
    """That this process may use."""
    allowed = getattr(os, "sched_getaffinity", None)
    return (os.cpu_count() or 1) if allowed is None else len(allowed(0))


def hold_back(signals: Iterable[signal.Signals]) -> Callable[[], None]:
    """Signals wait, also in processes that are started meanwhile, until the result is called."""
    if sys.platform == "win32" or WINDOWS:
        return lambda: None
    before = signal.pthread_sigmask(signal.SIG_BLOCK, signals)

    def let_go() -> None:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)

    return let_go


# Terminals and cables.


def is_unread(output: int) -> bool:
    """Has whoever read from this pipe ended?"""
    if sys.platform == "win32" or WINDOWS:
        return not os.isatty(output)
    poll = select.poll()
    poll.register(output, select.POLLOUT)
    return any(events & select.POLLERR for _, events in poll.poll(0))


def serial(device: str, baud: int) -> FileIO:
    """Eight bits as they come, nothing interpreted.

    Raises:
        OSError: there is no such device, or it has no such speed.
    """
    if sys.platform == "win32" or WINDOWS:
        raise OSError("a cable needs Linux or macOS")
    import termios

    speed = getattr(termios, f"B{baud}", None)
    if speed is None:
        raise OSError(f"{baud} is no speed of this system, such as 115200")
    cable = FileIO(os.open(device, os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK), "r+")
    try:
        mode = termios.tcgetattr(cable)
        mode[0] = mode[1] = mode[3] = 0
        mode[2] = termios.CS8 | termios.CREAD | termios.CLOCAL
        mode[4] = mode[5] = speed
        mode[6][termios.VMIN], mode[6][termios.VTIME] = 1, 0  # no bytes mean that it was pulled
        termios.tcsetattr(cable, termios.TCSANOW, mode)
        termios.tcflush(cable, termios.TCIOFLUSH)
    except termios.error as error:
        cable.close()
        raise OSError(*error.args) from None
    return cable


# Files and folders.


class Lock(NamedTuple):
    """Of a file or a folder; ends with the process, if not before."""

    descriptor: int | None  # None: the file system has no locks
    file: Path | None = None  # which Windows has beside it, and removes with its process

    def release(self) -> None:
        """Once."""
        if self.descriptor is not None:
            os.close(self.descriptor)
        if self.file is not None:
            self.file.unlink(missing_ok=True)


def lock(path: Path) -> Lock | None:
    """Lock a file or a folder; None: somebody has it. A file system without locks counts as locked.

    Raises:
        OSError: it cannot be opened.
    """
    if sys.platform == "win32" or WINDOWS:
        path.stat()
        file, temporary = path.with_name(f".{path.name}.lock"), getattr(os, "O_TEMPORARY", 0)
        try:
            return Lock(os.open(file, os.O_CREAT | os.O_EXCL | os.O_RDWR | temporary), file)
        except FileExistsError:
            return None
    import fcntl

    descriptor = os.open(path, os.O_RDONLY)
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError as error:
        os.close(descriptor)
        return None if isinstance(error, BlockingIOError) else Lock(None)
    return Lock(descriptor)


def sync_folder(folder: Path) -> None:
    """The names in it are on the disk, too. NTFS writes them in their order.

    Raises:
        OSError: the disk failed.
    """
    if WINDOWS:
        return
    descriptor = os.open(folder, os.O_RDONLY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)


# The private channel between the processes of a machine, by its protocol's name in Zenoh: a socket
# in a folder of this user, or what nothing else uses, so that access control can tell it apart.

LOCAL = "ws" if WINDOWS else "unixsock-stream"
PASSWORDS = "transport/auth/usrpwd"  # place in Zenoh's configuration
HERE, NOBODY = "127.0.0.1", "1"  # and a port at which nobody listens


def local_channel(
    listen: Sequence[str], connect: Sequence[str]
) -> tuple[Sequence[str], Sequence[str], dict[str, Any]]:
    """The endpoints as Zenoh is to have them, and what it needs to know besides. Where POSIX has
    the socket Windows has a file with `PORT:PASSWORD`, which is what Zenoh takes as a list of users
    with their passwords.

    Raises:
        OSError: a hub would be private and public, and its password for both; or the file cannot
            be written.
    """
    private = [end for end in (*listen, *connect) if end.startswith(PRIVATE)]
    if not WINDOWS or not private:
        return listen, connect, {}
    path = Path(private[0].removeprefix(PRIVATE))
    known = path.read_text(encoding="ascii") if path.exists() else ""
    if private[0] not in listen:
        port, _, password = (known or f"{NOBODY}:").partition(":")
        return listen, [f"{LOCAL}/{HERE}:{port}"], {PASSWORDS: {"user": port, "password": password}}
    if len(listen) > 1:
        raise OSError(f"to let other machines in at {listen[-1]} needs Linux or macOS")
    if not known:  # a hub that starts again is found where it was
        with socket.create_server((HERE, 0)) as free:
            known = f"{free.getsockname()[1]}:{secrets.token_hex(32)}"
        fresh = path.with_name(f"{path.name}-{os.getpid()}")
        fresh.touch(mode=0o600)
        fresh.write_text(known, encoding="ascii")
        fresh.replace(path)
    listen = [f"{LOCAL}/{HERE}:{known.partition(':')[0]}"]
    return listen, connect, {PASSWORDS: {"dictionary_file": str(path)}}
