"""New files. Nothing that exists is ever deleted or overwritten."""

from collections.abc import Generator
from contextlib import contextmanager, suppress
from importlib.util import find_spec
from pathlib import Path
from typing import BinaryIO

from services.runtime.config.disk import reason
from services.runtime.config.errors import LindyError
from services.runtime.config.extras import how_to_install

EXISTS = "it exists already; choose another {}, or remove it first"


def free_name(folder: Path, name: str, suffix: str = "") -> Path:
    """This name in a folder, or the next that is free: `name-2`, `name-3` …"""
    place, number = folder / f"{name}{suffix}", 1
    while place.exists():
        number += 1
        place = folder / f"{name}-{number}{suffix}"
    return place


def refuse_existing(path: Path, option: str = "--out") -> None:
    """Check, before the work of making a file begins, that it does not exist.

    Args:
        option: that names it.

    Raises:
        LindyError: there is such a file.
    """
    if path.exists():
        raise LindyError(f"cannot write {path}: {EXISTS.format(option)}")


def require_picture(path: Path, option: str) -> None:
    """Check, before the work of a picture begins, that it can be drawn, and is new.

    Args:
        option: that names it.

    Raises:
        LindyError: its name is no PNG's, matplotlib is missing, or there is such a file.
    """
    if path.suffix != ".png":
        raise LindyError(f"{option} {path}: expected a name that ends in .png")
    if find_spec("matplotlib") is None:
        raise LindyError(
            f"a picture needs matplotlib, which is not installed; {how_to_install('figures')}"
        )
    refuse_existing(path, option)


@contextmanager
def new_file(path: Path, option: str = "--out") -> Generator[BinaryIO]:
    """A new file, whole or not at all.

    Args:
        option: that names it.

    Raises:
        LindyError: there is such a file already, or it cannot be written.
    """
    try:
        with path.open("xb") as file:
            try:
                yield file
                file.flush()
            except BaseException:
                with suppress(OSError):  # of what is not written yet, on a full disk
                    file.close()
                path.unlink()  # an incomplete file would block the next attempt
                raise
    except FileExistsError:
        raise LindyError(f"cannot write {path}: {EXISTS.format(option)}") from None
    except OSError as error:
        raise LindyError(f"cannot write {path}: {reason(error)}") from None


def write_fresh(path: Path, data: bytes, option: str = "--out") -> None:
    """Write a new file. Arguments and errors as of `new_file`."""
    with new_file(path, option) as file:
        file.write(data)
