"""With this folder on PYTHONPATH, Lindy finds a Python as it is on Windows, as far as Linux can
pretend: without the modules, functions and constants that Windows lacks, without unix sockets and
links, and with files and sockets that are not the same. Libraries find everything.
"""

import builtins
import errno
import os
import pathlib
import select
import signal
import socket
import stat
from types import ModuleType
from typing import Any

OURS = ("messages", "services", "tools", "lindy")
GONE = {"fcntl", "resource", "pwd", "grp", "termios", "tty", "pty", "readline", "curses", "syslog"}
LACKING = {
    os: (
        "fork forkpty killpg setsid setpgid getpgid getuid geteuid getgid getegid getgroups uname "
        "statvfs fstatvfs pread pwrite preadv pwritev mkfifo mknod chown fchown lchown chroot nice "
        "getpriority setpriority sched_getaffinity sched_setaffinity sched_yield memfd_create wait "
        "getloadavg sysconf openpty ctermid ttyname fdatasync posix_fallocate posix_fadvise "
        "set_blocking get_blocking sync O_NONBLOCK O_NOCTTY O_DIRECTORY O_NOFOLLOW O_CLOEXEC "
        "WNOHANG register_at_fork eventfd pidfd_open sendfile execv execve"
    ),
    signal: (
        "SIGHUP SIGKILL SIGALRM SIGUSR1 SIGUSR2 SIGPIPE SIGCHLD SIGSTOP SIGCONT SIGQUIT "
        "alarm pause setitimer getitimer ITIMER_REAL pthread_sigmask pthread_kill sigwait "
        "sigpending SIG_BLOCK SIG_UNBLOCK SIG_SETMASK"
    ),
    select: "poll epoll EPOLLIN POLLIN POLLOUT POLLERR",
    socket: "AF_UNIX SO_REUSEPORT TCP_INFO TCP_DEFER_ACCEPT TCP_USER_TIMEOUT AF_CAN AF_PACKET",
}


def is_socket(end: Any) -> bool:
    return stat.S_ISSOCK(os.fstat(end if isinstance(end, int) else end.fileno()).st_mode)


def kill(pid: int, number: int) -> None:
    raise AssertionError(f"os.kill({pid}, {number}) ends any process on Windows")


def open_(path: Any, *others: Any) -> int:
    if pathlib.Path(path).is_dir():
        raise PermissionError(errno.EACCES, "a folder cannot be opened", str(path))
    return os.open(path, *others)


def read(end: int, length: int) -> bytes:
    if is_socket(end):
        raise OSError(errno.EBADF, "a socket is no file")
    return os.read(end, length)


def write(end: int, data: bytes) -> int:
    if is_socket(end):
        raise OSError(errno.EBADF, "a socket is no file")
    return os.write(end, data)


def only_sockets(reads: Any, writes: Any, wrong: Any, timeout: float | None = None) -> Any:
    ends = [*reads, *writes, *wrong]
    if not ends or not all(map(is_socket, ends)):
        raise OSError(errno.EINVAL, "select is for sockets")
    return select.select(reads, writes, wrong, timeout)


def no_link(*_: Any, **__: Any) -> None:
    raise OSError(errno.EPERM, "a required privilege is not held by the client")


OTHERWISE: dict[ModuleType, dict[str, Any]] = {
    os: {"kill": kill, "open": open_, "read": read, "write": write},
    select: {"select": only_sockets},
}


def disguised(module: ModuleType, lacking: str) -> ModuleType:
    found = ModuleType(module.__name__, module.__doc__)
    known = vars(module) | OTHERWISE.get(module, {})
    vars(found).update({n: v for n, v in known.items() if n not in lacking.split()})
    return found


SHOWN = {module.__name__: disguised(module, lacking) for module, lacking in LACKING.items()}
everything = builtins.__import__


def imported(name: str, where: dict[str, Any] | None = None, *others: Any, **named: Any) -> Any:
    """As `__import__`; `where` are the globals of the module that imports."""
    package = str((where or {}).get("__package__") or "")
    if package.partition(".")[0] in OURS:
        if name.partition(".")[0] in GONE:
            raise ModuleNotFoundError(f"No module named {name!r}", name=name)
        if name in SHOWN:
            return SHOWN[name]
    return everything(name, where, *others, **named)


builtins.__import__ = imported
pathlib.Path.symlink_to = no_link
