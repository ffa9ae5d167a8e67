"""The folder of the keys, and the certificate authority in it: what `lindy keys` does there.

KEYS/authority/        ca.pem, ca.key and the names it has signed: stays at home
KEYS/drone-pioneer/    ca.pem, certificate.pem, key.pem, admitted.txt: goes to the drone
KEYS/pilot-ann/        the same for a pilot: goes to the pilot's computer, into KEYS there
"""

import os
import shutil
from collections.abc import Callable, Collection
from contextlib import suppress
from datetime import datetime
from pathlib import Path
from typing import NamedTuple, TypeVar

from cryptography import x509
from cryptography.hazmat.primitives.asymmetric import ec

from services.runtime.bus.key_files import Credentials, KeyFiles
from services.runtime.config.disk import reason
from services.runtime.config.errors import LindyError
from services.runtime.os import system
from tools.keys import certificates
from tools.keys.certificates import Certificate
from tools.keys.roles import (
    LETS_IN,
    LONGEST_DAYS,
    ROLES,
    Identity,
    Role,
    parse_list,
    with_one,
    without,
)  # fmt: skip

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


class Listed(NamedTuple):
    """A line of `lindy keys list`."""

    certificate: Certificate
    state: str
    folder: Path


def new(keys: Path, now: datetime) -> None:
    """A new authority.

    Raises:
        LindyError: there is one already, or it cannot be written.
    """
    key = ec.generate_private_key(ec.SECP256R1())
    made = {
        CA: certificates.authority(key, now, x509.random_serial_number()),
        CA_KEY: certificates.key_pem(key),
        SIGNED: b"",
        REVOKED: b"",
    }
    _make_folder(keys / AUTHORITY, made)


def add(keys: Path, who: Identity, now: datetime, days: int) -> tuple[Path, list[Path]]:
    """Keys for somebody. Returns their folder, and the lists of others that name them now.

    Raises:
        LindyError: the name was used before, there is no authority, or it cannot be written.
    """
    ca, signer = _signer(keys, now, days)
    signed, revoked = _list(keys / AUTHORITY / SIGNED), _list(keys / AUTHORITY / REVOKED)
    if who in signed:  # an old certificate must not become valid with a new name
        longer = (
            ""
            if who in revoked
            else f", or make them last: `lindy keys add {who.role} {who.name} --again`"
        )
        raise LindyError(f"{who} has keys already, or had once; choose another name{longer}")
    key, serial = ec.generate_private_key(ec.SECP256R1()), x509.random_serial_number()
    admitted = [w for w in signed if w not in revoked and w.role in LETS_IN[who.role]]
    heading = f"# Whose certificates {who} lets in. Read when its side of a dive is started.\n"
    made = {
        CA: ca,
        CERTIFICATE: certificates.issue(who, key.public_key(), signer, now, days, serial),
        KEY: certificates.key_pem(key),
        ADMITTED: (heading + "".join(f"{other}\n" for other in admitted)).encode(),
    }
    _change(keys / AUTHORITY / SIGNED, lambda text: with_one(text, who))  # first: used is used
    _make_folder(keys / who.folder, made)
    lists = [
        folder / ADMITTED
        for role in LETS_IN[who.role]  # who lets in is let in
        for folder in _bundles(keys, [role])
        if folder.name != who.folder
    ]
    return keys / who.folder, [p for p in lists if _change(p, lambda text: with_one(text, who))]


def renew(keys: Path, who: Identity, now: datetime, days: int) -> Path:
    """A new certificate for the same name and key, in the place of the old one.

    Raises:
        LindyError: who was revoked or has no keys here, there is no authority, or it cannot be
            written.
    """
    ca, signer = _signer(keys, now, days)
    if who in _list(keys / AUTHORITY / REVOKED):
        raise LindyError(f"{who} was revoked, and its name is never given again")
    if who not in _list(keys / AUTHORITY / SIGNED):
        raise LindyError(f"{keys} has no keys of {who}; `lindy keys list` shows all")
    path = keys / who.folder / CERTIFICATE
    before = _read(path)
    if (found := _in_file(path, certificates.check_issued, before, ca)).who != who:
        raise LindyError(f"{path} is that of {found.who}, not of {who}")
    public, serial = _in_file(path, certificates.public_key, before), x509.random_serial_number()
    _replace(path, certificates.issue(who, public, signer, now, days, serial))
    return path


def revoke(keys: Path, who: Identity) -> list[Path]:
    """Take a name off every list in this folder. Returns those that it was on.

    Raises:
        LindyError: nobody here knows the name, or a list cannot be written.
    """
    lists = [folder / ADMITTED for folder in _bundles(keys)]
    changed = [path for path in lists if _change(path, lambda text: without(text, who))]
    if (home := keys / AUTHORITY).is_dir():
        if who not in _list(home / SIGNED):
            raise LindyError(f"{keys} has no keys of {who}; `lindy keys list` shows all")
        _change(home / REVOKED, lambda text: with_one(text, who))
    elif not changed:
        raise LindyError(f"{who} is on no list in {keys}")
    return changed


def listed(keys: Path, now: datetime) -> list[Listed]:
    """Every certificate in the folder.

    Raises:
        LindyError: there is none, or one cannot be read.
    """
    revoked, found = _revoked(keys), list[Listed]()
    for folder in _bundles(keys):
        own = _in_file(folder / CERTIFICATE, certificates.read, _read(folder / CERTIFICATE))
        found.append(Listed(own, "revoked" if own.who in revoked else own.state(now), folder))
    if not found:
        raise LindyError(f"no keys in {keys}: {MAKE}")
    return found


def own_keys(keys: Path, roles: Collection[Role], now: datetime) -> Own:
    """The keys with which this machine takes one of these roles.

    Args:
        keys: the folder of all keys, or that of this machine's.

    Raises:
        LindyError: there are none, or they are not whole, not valid or not private.
    """
    folder = _own_folder(keys, roles)
    ca, certificate, key, _ = (_read(folder / name) for name in WHOLE)
    _in_file(folder / CA, certificates.check_authority, ca, now)
    found = _in_file(folder / CERTIFICATE, certificates.check_certificate, certificate, ca, now)
    if found.who.role not in roles:
        wanted = " or ".join(roles)
        raise LindyError(f"{folder / CERTIFICATE} is that of {found.who}, allowed: of {wanted}")
    _in_file(folder / KEY, certificates.check_pair, certificate, key)
    if system.others_may(folder / KEY, 0o077):  # as ssh does: such a key is no secret
        path = folder / KEY
        raise LindyError(f"{path} can be read by others on this computer: chmod 600 {path}")
    for path in (folder, *(folder / name for name in WHOLE)):  # who writes the list lets himself in
        if system.others_may(path, 0o002):
            raise LindyError(f"{path} can be written by others on this computer: chmod o-w {path}")
    admitted = _list(folder / ADMITTED)
    files = KeyFiles(*(str((folder / name).absolute()) for name in (CA, CERTIFICATE, KEY)))
    return Own(found, Credentials(files, tuple(str(who) for who in admitted), found.who.name))


def _own_folder(keys: Path, roles: Collection[Role]) -> Path:
    if any((keys / name).exists() for name in WHOLE):
        return keys
    revoked = {who.folder for who in _revoked(keys)}  # as far as this machine knows
    found = [folder for folder in _bundles(keys, roles) if folder.name not in revoked]
    kinds = " or ".join(roles)
    if not found:
        new = not {"drone", "pilot"}.isdisjoint(roles)
        make = MAKE if new else f"`lindy keys add {kinds} NAME` makes them"
        raise LindyError(
            f"no keys of {kinds} in {keys}: {make}, and the folder of this machine's is copied here"
        )
    if len(found) > 1:
        names = ", ".join(path.name for path in found)
        raise LindyError(
            f"{keys} has the keys of more than one {kinds} ({names}); name one: --keys {found[0]}"
        )
    return found[0]


def _revoked(keys: Path) -> tuple[Identity, ...]:
    """Where the authority is; elsewhere nobody is known to be."""
    path = keys / AUTHORITY / REVOKED
    return _list(path) if path.is_file() else ()


def _bundles(keys: Path, roles: Collection[Role] = ROLES) -> list[Path]:
    """The folders of the keys of these roles."""
    try:
        found = [path for role in roles for path in keys.glob(f"{role}-*") if path.is_dir()]
    except OSError as error:
        raise LindyError(f"cannot read {keys}: {reason(error)}") from None
    return sorted(found)


def _signer(keys: Path, now: datetime, days: int) -> tuple[bytes, ec.EllipticCurvePrivateKey]:
    """The authority's certificate and its key, which may sign for so many days."""
    home = keys / AUTHORITY
    if not home.is_dir():
        raise LindyError(f"there is no authority in {keys}: {MAKE}, where it stays")
    ca = _read(home / CA)
    most = (_in_file(home / CA, certificates.check_authority, ca, now) - now).days
    if not 1 <= days <= min(LONGEST_DAYS, most):
        raise LindyError(f"--days is {days}, expected 1 to {min(LONGEST_DAYS, most)}")
    return ca, _in_file(home / CA_KEY, certificates.read_key, _read(home / CA_KEY))


def _make_folder(folder: Path, files: dict[str, bytes]) -> None:
    """A new folder that nobody else may look into, whole or not at all.

    Raises:
        LindyError: it is there already, or cannot be written.
    """
    if folder.exists():
        raise LindyError(f"{folder} is there already, and keys are never overwritten")
    fresh = folder.with_name(f".{folder.name}-{os.getpid()}")
    try:
        folder.parent.mkdir(parents=True, exist_ok=True, mode=0o700)
        fresh.mkdir(mode=0o700)
        for name, data in files.items():
            _write_private(fresh / name, data)
        fresh.rename(folder)
    except OSError as error:
        shutil.rmtree(fresh, ignore_errors=True)
        raise LindyError(f"cannot make {folder}: {reason(error)}") from None


def _change(path: Path, to: Callable[[str], str]) -> bool:
    """Change a list of names, whole or not at all. Did it change?"""
    before = _read(path).decode(errors="replace")
    if (after := _in_file(path, to, before)) == before:
        return False
    _replace(path, after.encode())
    return True


def _replace(path: Path, data: bytes) -> None:
    """At every instant the old file or the new one is there."""
    fresh = path.with_name(f".{path.name}-{os.getpid()}")
    try:
        _write_private(fresh, data)
        fresh.replace(path)
    except OSError as error:
        with suppress(OSError):
            fresh.unlink()
        raise LindyError(f"cannot write {path}: {reason(error)}") from None


def _write_private(path: Path, data: bytes) -> None:
    """A new file that nobody else may read, from its first byte on."""
    with os.fdopen(os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600), "wb") as file:
        file.write(data)


def _read(path: Path) -> bytes:
    try:
        return path.read_bytes()
    except FileNotFoundError:
        raise LindyError(f"{path} is missing: copy the whole folder") from None
    except OSError as error:
        raise LindyError(f"cannot read {path}: {reason(error)}") from None


def _list(path: Path) -> tuple[Identity, ...]:
    return _in_file(path, parse_list, _read(path).decode(errors="replace"))


def _in_file(path: Path, judge: Callable[..., T], *data: object) -> T:
    """Whatever is wrong is said of this file."""
    try:
        return judge(*data)
    except ValueError as error:
        raise LindyError(f"{path}: {error}") from None
