"""Linux and macOS. Where only Linux can tell something, macOS is told nothing, without an error."""

import sys

if sys.platform == "win32":
    raise ImportError("this computer has no POSIX")

import ctypes
import fcntl
import os
import resource
import select
import signal
import subprocess
import termios
import time
from collections.abc import Callable, Iterable, Sequence
from contextlib import suppress
from io import FileIO
from pathlib import Path
from typing import Any, TypedDict

PARENT_S = 0.2  # [s] between two looks at whether the parent lives

# Processes.

STDIN = subprocess.DEVNULL  # of a child


class NewSession(TypedDict):
    """How a child is started that Ctrl-C does not reach."""

    start_new_session: bool


APART = NewSession(start_new_session=True)
WINDOWS = False


def exists(pid: int) -> bool:
    """Is there a process with this id?"""
    try:
        os.kill(pid, 0)  # signal 0 only asks
    except ProcessLookupError:
        return False
    except PermissionError:
        pass  # it is somebody else's
    return True


def began(pid: int) -> float | None:
    """When a process began, to tell it from a later one of the same id; None: nobody can tell."""
    try:
        stat = Path(f"/proc/{pid}/stat").read_text(encoding="utf-8")
        return float(stat.rpartition(")")[2].split()[19])  # [clock ticks] since the boot
    except (OSError, ValueError, IndexError):
        return None


def is_parent(pid: int) -> bool:
    """Does the process that started this one still live?"""
    return os.getppid() == pid


def wait_until_unwanted(parent: int) -> bool:
    """Wait until this process has to end. True: it was asked to; False: its parent has ended."""
    while is_parent(parent):
        time.sleep(PARENT_S)  # Linux could tell, but of the thread that began it
    return False  # who is asked to end gets SIGTERM


def ask_to_end(process: "subprocess.Popen[bytes]") -> None:
    """A child that was started with `STDIN` and `APART`."""
    process.terminate()


def kill_all(process: "subprocess.Popen[bytes]") -> None:
    """End a child that was started with `APART`, and what it has started, even if it has ended."""
    with suppress(ProcessLookupError, PermissionError):  # nobody is left
        os.killpg(process.pid, signal.SIGKILL)


def end_within(seconds: float) -> None:
    """End this process after so long, whatever it does then; 0: do not."""
    signal.signal(signal.SIGALRM, signal.SIG_DFL)
    signal.setitimer(signal.ITIMER_REAL, seconds)


def exact_timers() -> None:
    """Timer slack of 1 ns instead of 50 µs, where Linux offers it: half the lateness."""
    with suppress(OSError, AttributeError):
        ctypes.CDLL(None).prctl(29, 1, 0, 0, 0)  # PR_SET_TIMERSLACK


def memory_mb() -> float:
    """[MB] Memory of this process."""
    try:
        pages = int(Path("/proc/self/statm").read_text(encoding="ascii").split()[1])
        return pages * resource.getpagesize() / 1e6
    except OSError:  # not Linux: only the peak is known
        return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e6


def cores() -> int:
    """That this process may use."""
    if sys.platform == "linux":
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


# Signals.

HANG_UP = (signal.SIGHUP,)  # the terminal is gone


def hold_back(signals: Iterable[signal.Signals]) -> Callable[[], None]:
    """Signals wait, also in processes that are started meanwhile, until the result is called."""
    before = signal.pthread_sigmask(signal.SIG_BLOCK, signals)

    def let_go() -> None:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)

    return let_go


# Terminals and cables.


def is_unread(output: int) -> bool:
    """Has whoever read from this pipe ended?"""
    poll = select.poll()
    poll.register(output, select.POLLOUT)
    return any(events & select.POLLERR for _, events in poll.poll(0))


def serial(device: str, baud: int) -> FileIO:
    """Eight bits as they come, nothing interpreted.

    Raises:
        OSError: there is no such device, or it has no such speed.
    """
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


class Lock:
    """Of a file or a folder; ends with the process, if not before.

    Attributes:
        is_known: False: the file system has no locks.
    """

    def __init__(self, descriptor: int | None) -> None:
        self._descriptor, self.is_known = descriptor, descriptor is not None

    def release(self) -> None:
        if self._descriptor is not None:
            os.close(self._descriptor)
            self._descriptor = None


def lock(path: Path) -> Lock | None:
    """Lock a file or a folder; None: somebody has it. A file system without locks counts as locked.

    Raises:
        OSError: it cannot be opened.
    """
    descriptor = os.open(path, os.O_RDONLY)
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        os.close(descriptor)
        return None
    except OSError:
        os.close(descriptor)
        return Lock(None)
    return Lock(descriptor)


def sync_folder(folder: Path) -> None:
    """The names in it are on the disk, too.

    Raises:
        OSError: the disk failed.
    """
    descriptor = os.open(folder, os.O_RDONLY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)


def others_may(path: Path, mode: int) -> bool:
    """May other users do one of these things, as bits of a file's mode?

    Raises:
        OSError: there is no such file or folder.
    """
    return bool(path.stat().st_mode & mode)


def point(pointer: Path, name: str) -> None:
    """Make `pointer` a link to a folder beside it, at once: it always points somewhere.

    Raises:
        OSError: it cannot be made.
    """
    fresh = pointer.with_name(f".{pointer.name}-{os.getpid()}")
    fresh.symlink_to(name, target_is_directory=True)
    fresh.replace(pointer)


# The private channel between the processes of a machine.

LOCAL = "unixsock-stream"  # Zenoh's name of its protocol: a socket in a folder of this user


def local_channel(
    listen: Sequence[str],
    connect: Sequence[str],
) -> tuple[Sequence[str], Sequence[str], dict[str, Any]]:
    """The endpoints as Zenoh is to have them, and what it needs to know besides."""
    return listen, connect, {}
