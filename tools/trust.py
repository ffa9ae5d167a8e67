"""What a stack file of somebody else may execute here is asked before it does.

A stack file names Python modules, in its own folder or installed ones, and whatever is in them runs
as the user. At a terminal a person is asked once for each file as it is now; where nobody can be
asked, as in a script, it is said and run.
"""

import hashlib
import sys
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path

from services.runtime.config.disk import reason
from services.runtime.config.errors import LindyError
from services.runtime.hosts.registry import Registry

TRUSTED = "~/.config/lindy/trusted.txt"  # checksums of files, one a line


def foreign(services: Registry) -> list[str]:
    """Services whose code is not Lindy's own, with the module of each."""
    specs = services.items()
    return [f"{name} (module {spec.module})" for name, spec in specs if spec.module is not None]


def require_trusted(
    services: Registry, *, trust: bool, ask: Callable[[str], str] | None = None
) -> None:
    """
    Args:
        trust: the user has said so.
        ask: puts a question and returns the answer; None: nobody can be asked.

    Raises:
        LindyError: a person was asked, and does not want it.
    """
    names = foreign(services)
    if trust or not names:
        return
    what = f"{services.file} runs code that is not Lindy's own: {', '.join(names)}"
    checksum = hashlib.sha256(f"{services.file}\n".encode() + _content(services.file)).hexdigest()
    notes = Path(TRUSTED).expanduser()
    if ask is None:
        print(what, flush=True)
        return
    with suppress(OSError):
        if checksum in notes.read_text(encoding="utf-8").split():
            return
    if ask(f"{what}. Run it? [y/N] ").strip().lower() not in ("y", "yes"):
        raise LindyError(f"{what}; with --trust nobody is asked")
    try:
        notes.parent.mkdir(parents=True, exist_ok=True)
        with notes.open("a", encoding="utf-8") as file:
            file.write(f"{checksum}\n")
    except OSError as error:
        print(f"it is asked again next time: cannot write {notes}: {reason(error)}", flush=True)


def asking() -> Callable[[str], str] | None:
    """How a person is asked; None: there is none at a terminal."""
    if not (sys.stdin and sys.stdin.isatty() and sys.stdout.isatty()):
        return None
    return _answer


def _answer(question: str) -> str:
    try:
        return input(question)
    except EOFError:
        return ""


def _content(file: Path) -> bytes:
    try:
        return file.read_bytes()
    except OSError:
        return b""  # a copy of it was read
