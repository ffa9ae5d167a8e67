"""The folder of the keys, on disk. Keys and certificates are never overwritten, and no whole
set of them is deleted.

KEYS/authority/        ca.pem, ca.key and the names it has signed: stays at home
KEYS/drone-pioneer/    ca.pem, certificate.pem, key.pem, admitted.txt: goes to the drone
KEYS/pilot-ann/        the same for a pilot: goes to the pilot's computer, into KEYS there
"""

import contextlib
import os
from collections.abc import Callable, Collection
from datetime import datetime
from pathlib import Path
from typing import NamedTuple, TypeVar

from services.runtime.bus.key_files import Credentials, KeyFiles
from services.runtime.config.disk import reason
from services.runtime.config.errors import LindyError
from services.runtime.os import system
from tools.fresh import write_fresh
from tools.keys import certificates
from tools.keys.certificates import Certificate
from tools.keys.roles import ROLES, Identity, Role, parse_list, with_article

AUTHORITY = "authority"
CA, CA_KEY, SIGNED, REVOKED = "ca.pem", "ca.key", "signed.txt", "revoked.txt"
CERTIFICATE, KEY, ADMITTED = "certificate.pem", "key.pem", "admitted.txt"
WHOLE = (CA, CERTIFICATE, KEY, ADMITTED)
MAKE = "`lindy keys new` makes them"  # a drone's and a pilot's; `keys add` those of others

T = TypeVar("T")


class Own(NamedTuple):
    """Keys of this machine, checked."""

    certificate: Certificate
    credentials: Credentials


def own_keys(keys: Path, roles: Collection[Role], now: datetime) -> Own:
    """The keys with which this machine takes one of these roles.

    Args:
        keys: the folder of all keys, or that of this machine's.

    Raises:
        LindyError: there are none, or they are not whole, not valid or not private.
    """
    folder = _own_folder(keys, roles)
    data = {name: read(folder / name) for name in WHOLE}
    said(folder / CA, certificates.check_authority, data[CA], now)
    found = said(
        folder / CERTIFICATE, certificates.check_certificate, data[CERTIFICATE], data[CA], now
    )
    if found.who.role not in roles:
        wanted = " or ".join(f"{with_article(role)}'s" for role in roles)
        raise LindyError(f"{folder / CERTIFICATE} is that of {found.who}, but {wanted} is needed")
    said(folder / KEY, certificates.check_pair, data[CERTIFICATE], data[KEY])
    _private(folder / KEY)
    for path in (folder, *(folder / name for name in WHOLE)):
        _own(path)
    admitted = read_list(folder / ADMITTED)
    files = KeyFiles(*(str((folder / name).absolute()) for name in (CA, CERTIFICATE, KEY)))
    return Own(found, Credentials(files, tuple(str(who) for who in admitted), found.who.name))


def bundles(keys: Path) -> list[Path]:
    """The folders of drones, pilots and observers."""
    found = [path for role in ROLES for path in keys.glob(f"{role}-*") if path.is_dir()]
    return sorted(found)


def make_bundle(folder: Path, files: dict[str, bytes]) -> None:
    """
    Raises:
        LindyError: the folder is there already, or cannot be written; nothing is left of it then.
    """
    make_folder(folder)
    written: list[Path] = []
    try:
        for name, data in files.items():
            write_private(folder / name, data)
            written.append(folder / name)
    except LindyError:  # no whole set of keys, and the command can be repeated without it
        with contextlib.suppress(OSError):
            for path in written:
                path.unlink()
            folder.rmdir()
        raise


def make_folder(folder: Path) -> None:
    """A new folder that nobody else may look into.

    Raises:
        LindyError: it is there already, or cannot be made.
    """
    try:
        folder.parent.mkdir(parents=True, exist_ok=True, mode=0o700)
        folder.mkdir(mode=0o700)
    except FileExistsError:
        raise LindyError(f"{folder} is there already, and keys are never overwritten") from None
    except OSError as error:
        raise LindyError(f"cannot make {folder}: {reason(error)}") from None


def write_private(path: Path, data: bytes) -> None:
    """A new file that nobody else may read.

    Raises:
        LindyError: it is there already, or cannot be written.
    """
    before = os.umask(0o077)  # from its first byte on
    try:
        write_fresh(path, data)
    finally:
        os.umask(before)


def read(path: Path) -> bytes:
    """
    Raises:
        LindyError: it cannot be read.
    """
    try:
        return path.read_bytes()
    except FileNotFoundError:
        raise LindyError(f"{path} is missing: copy the whole folder") from None
    except OSError as error:
        raise LindyError(f"cannot read {path}: {reason(error)}") from None


def read_list(path: Path) -> tuple[Identity, ...]:
    """
    Raises:
        LindyError: it cannot be read, or has a line that is no name.
    """
    return said(path, parse_list, text_of(path))


def text_of(path: Path) -> str:
    return read(path).decode(errors="replace")


def change(path: Path, to: Callable[[str], str]) -> bool:
    """Change a list of names, whole or not at all. Did it change?

    Raises:
        LindyError: it cannot be read or written, or has a line that is no name.
    """
    before = text_of(path)
    after = said(path, to, before)
    if after == before:
        return False
    _replace(path, after.encode(), lambda _: None)
    return True


def supersede(path: Path, data: bytes) -> Path:
    """Put a new file in the place of one that is kept beside it: `certificate-1.pem`,
    `certificate-2.pem` … Returns where. At every instant one of both is in its place.

    Raises:
        LindyError: it cannot be written.
    """
    return _replace(path, data, _kept)


def _replace(path: Path, data: bytes, before: Callable[[Path], T]) -> T:
    """Put a new file in the place of one; what `before` did with that is returned.

    Raises:
        LindyError: it cannot be written.
    """
    fresh = path.with_name(f".{path.name}-{os.getpid()}")
    write_private(fresh, data)
    try:
        done = before(path)
        fresh.replace(path)
    except OSError as error:
        with contextlib.suppress(OSError):
            fresh.unlink()
        raise LindyError(f"cannot write {path}: {reason(error)}") from None
    return done


def _kept(path: Path) -> Path:
    """A second name for the file.

    Raises:
        OSError: it cannot have one.
    """
    number = 1
    while True:
        kept = path.with_stem(f"{path.stem}-{number}")
        try:
            kept.hardlink_to(path)
        except FileExistsError:
            number += 1
        else:
            return kept


def said(path: Path, judge: Callable[..., T], *data: object) -> T:
    """Whatever is wrong is said of this file.

    Raises:
        LindyError: it is not as it should be.
    """
    try:
        return judge(*data)
    except ValueError as error:
        raise LindyError(f"{path}: {error}") from None


def _own_folder(keys: Path, roles: Collection[Role]) -> Path:
    if any((keys / name).exists() for name in WHOLE):
        return keys
    kinds = " or ".join(roles)
    whose = " or ".join(with_article(role) for role in roles)
    try:
        found = [path for path in bundles(keys) if path.name.partition("-")[0] in roles]
        there = keys.is_dir()
    except OSError as error:
        raise LindyError(f"cannot read {keys}: {reason(error)}") from None
    if not found:
        where = f"of {whose} in {keys}" if there else f"in {keys}, which is not there"
        new = not {"drone", "pilot"}.isdisjoint(roles)
        make = MAKE if new else f"`lindy keys add {kinds} NAME` makes them"
        raise LindyError(
            f"no keys {where}: {make}, and the folder of this machine's is copied here"
        )
    if len(found) > 1:
        names = ", ".join(path.name for path in found)
        raise LindyError(
            f"{keys} has the keys of more than one {kinds} ({names}); name one: --keys {found[0]}"
        )
    return found[0]


def _own(path: Path) -> None:
    """Whoever may write the list of names lets himself in."""
    try:
        written_by_others = system.others_can_write(path)
    except OSError:
        return  # what is missing is said where it is read
    if written_by_others:
        raise LindyError(f"{path} can be written by others on this computer: chmod go-w {path}")


def _private(key: Path) -> None:
    """As ssh does: a key that others can read is no secret."""
    try:
        read_by_others = system.others_can_read(key)
    except OSError as error:
        raise LindyError(f"cannot read {key}: {reason(error)}") from None
    if read_by_others:
        raise LindyError(f"{key} can be read by others on this computer: chmod 600 {key}")
