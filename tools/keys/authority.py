"""The folder of the keys, and the certificate authority in it: what `lindy keys` does there.

KEYS/authority/        ca.pem, ca.key and the names it has signed: stays at home
KEYS/drone-pioneer/    ca.pem, certificate.pem, key.pem, admitted.txt: goes to the drone
KEYS/pilot-ann/        the same for a pilot: goes to the pilot's computer, into KEYS there
"""

import os
import shutil
from collections.abc import Callable, Collection
from datetime import datetime
from pathlib import Path
from typing import TypeVar

from cryptography.hazmat.primitives.asymmetric import ec

from services.runtime.bus.access_control import Credentials, KeyFiles
from services.runtime.config.disk import reason
from services.runtime.config.errors import LindyError
from services.runtime.node.checkpoint import write_safely
from services.runtime.os import system
from tools.keys import certificates
from tools.keys.certificates import Certificate
from tools.keys.credentials import LETS_IN, ROLES, Identity, Role, parse_list, with_one, without

LONGEST_DAYS = 730  # for which a certificate is valid, at most
CA, CA_KEY, SIGNED, REVOKED = "ca.pem", "ca.key", "signed.txt", "revoked.txt"
CERTIFICATE, KEY, ADMITTED = "certificate.pem", "key.pem", "admitted.txt"
WHOLE = (CA, CERTIFICATE, KEY, ADMITTED)
PRIVATE = 0o600  # mode of every file
MAKE = "`lindy keys new` makes them"  # a drone's and a pilot's; `keys add` those of others
T = TypeVar("T")


class KeyAuthority:
    """The one in a folder of keys. Whatever it cannot do is one LindyError, and changes nothing
    but the list of the names that were used."""

    def __init__(self, keys: Path) -> None:
        self.keys, self.home = keys, keys / "authority"

    def make(self, now: datetime) -> None:
        """A new authority, where there is none yet."""
        key = ec.generate_private_key(ec.SECP256R1())
        ca, private = certificates.authority(key, now), certificates.key_pem(key)
        _make_folder(self.home, {CA: ca, CA_KEY: private, SIGNED: b"", REVOKED: b""})

    def add(self, who: Identity, now: datetime, days: int) -> tuple[Path, list[Path]]:
        """Keys for somebody whose name was never used. Returns their folder, and the lists of
        others that name them now."""
        ca, signer = self._signer(now, days)
        signed, revoked = _list(self.home / SIGNED), _list(self.home / REVOKED)
        if who in signed:  # an old certificate must not become valid with a new name
            longer = f", or make them last: `lindy keys add {who.role} {who.name} --again`"
            told = f"{who} has keys already, or had once; choose another name"
            raise LindyError(told if who in revoked else f"{told}{longer}")
        key = ec.generate_private_key(ec.SECP256R1())
        admitted = [w for w in signed if w not in revoked and w.role in LETS_IN[who.role]]
        heading = f"# Whose certificates {who} lets in. Read when its side of a dive is started.\n"
        made = {
            CA: ca,
            CERTIFICATE: certificates.issue(who, key.public_key(), signer, now, days),
            KEY: certificates.key_pem(key),
            ADMITTED: (heading + "".join(f"{other}\n" for other in admitted)).encode(),
        }
        _change(self.home / SIGNED, with_one, who)  # first: used is used
        own = self.keys / who.folder
        _make_folder(own, made)
        others = [folder for folder in bundles(self.keys, LETS_IN[who.role]) if folder != own]
        return own, [p / ADMITTED for p in others if _change(p / ADMITTED, with_one, who)]

    def renew(self, who: Identity, now: datetime, days: int) -> Path:
        """A new certificate for the same name and key, in the place of the old one."""
        ca, signer = self._signer(now, days)
        if who in _list(self.home / REVOKED):
            raise LindyError(f"{who} was revoked, and its name is never given again")
        self._require_signed(who)
        path = self.keys / who.folder / CERTIFICATE
        before = _read(path)
        found = _in_file(path, certificates.check_certificate, before, ca, None)
        if found.who != who:
            raise LindyError(f"{path} is that of {found.who}, not of {who}")
        public = _in_file(path, certificates.public_key, before)
        _write(path, certificates.issue(who, public, signer, now, days))
        return path

    def revoke(self, who: Identity) -> list[Path]:
        """Take a name off every list in this folder, also where no authority is. Returns those
        that it was on."""
        lists = [folder / ADMITTED for folder in bundles(self.keys)]
        changed = [path for path in lists if _change(path, without, who)]
        if self.home.is_dir():
            self._require_signed(who)
            _change(self.home / REVOKED, with_one, who)
        elif not changed:
            raise LindyError(f"{who} is on no list in {self.keys}")
        return changed

    def _require_signed(self, who: Identity) -> None:
        if who not in _list(self.home / SIGNED):
            raise LindyError(f"{self.keys} has no keys of {who}; `lindy keys list` shows all")

    def _signer(self, now: datetime, days: int) -> tuple[bytes, ec.EllipticCurvePrivateKey]:
        """Its certificate, and its key, which may sign for so many days."""
        if not self.home.is_dir():
            raise LindyError(f"there is no authority in {self.keys}: {MAKE}, where it stays")
        ca = _read(self.home / CA)
        left = _in_file(self.home / CA, certificates.check_authority, ca, now) - now
        most = min(LONGEST_DAYS, left.days)
        if not 1 <= days <= most:
            raise LindyError(f"--days is {days}, expected 1 to {most}")
        key = _read(self.home / CA_KEY)
        return ca, _in_file(self.home / CA_KEY, certificates.read_key, key)


def listed(keys: Path, now: datetime) -> list[tuple[Certificate, str, Path]]:
    """Every certificate in the folder, its state and its own folder.

    Raises:
        LindyError: there is none, or one cannot be read.
    """
    found, gone = list[tuple[Certificate, str, Path]](), revoked(keys)
    for folder in bundles(keys):
        own = _in_file(folder / CERTIFICATE, certificates.read, _read(folder / CERTIFICATE))
        found.append((own, "revoked" if own.who in gone else own.state(now), folder))
    if not found:
        raise LindyError(f"no keys in {keys}: {MAKE}")
    return found


def own_keys(keys: Path, roles: Collection[Role], now: datetime) -> tuple[Certificate, Credentials]:
    """The keys with which this machine takes one of these roles.

    Args:
        keys: the folder of all keys, or that of this machine's.

    Raises:
        LindyError: there are none, or they are not whole, not valid or not private.
    """
    folder = _own_folder(keys, roles)
    ca, certificate, key, admitted = (folder / name for name in WHOLE)
    _in_file(ca, certificates.check_authority, _read(ca), now)
    data = _read(certificate)
    found = _in_file(certificate, certificates.check_certificate, data, _read(ca), now)
    if found.who.role not in roles:
        wanted = " or ".join(roles)
        raise LindyError(f"{certificate} is that of {found.who}, allowed: of {wanted}")
    _in_file(key, certificates.check_pair, _read(key), data)
    if _others_may(key, 0o077):  # as ssh does: such a key is no secret
        raise LindyError(f"{key} can be read by others on this computer: chmod 600 {key}")
    names = _list(admitted)
    for path in (folder, ca, certificate, admitted):  # who writes the list lets himself in
        if _others_may(path, 0o002):
            raise LindyError(f"{path} can be written by others on this computer: chmod o-w {path}")
    files = KeyFiles(*(str(path.absolute()) for path in (ca, certificate, key)))
    return found, Credentials(files, tuple(map(str, names)), found.who.name)


def _others_may(path: Path, mode: int) -> bool:
    """May other users do one of these things? Windows says by other means who may."""
    return not system.WINDOWS and bool(path.stat().st_mode & mode)


def _own_folder(keys: Path, roles: Collection[Role]) -> Path:
    if any((keys / name).exists() for name in WHOLE):
        return keys
    gone = {who.folder for who in revoked(keys)}  # as far as this machine knows
    found = [folder for folder in bundles(keys, roles) if folder.name not in gone]
    kinds, names = " or ".join(roles), ", ".join(path.name for path in found)
    if not found:
        new = not {"drone", "pilot"}.isdisjoint(roles)
        make = MAKE if new else f"`lindy keys add {kinds} NAME` makes them"
        raise LindyError(
            f"no keys of {kinds} in {keys}: {make}, and the folder of this machine's is copied here"
        )
    if len(found) > 1:
        raise LindyError(
            f"{keys} has the keys of more than one {kinds} ({names}); name one: --keys {found[0]}"
        )
    return found[0]


def revoked(keys: Path) -> tuple[Identity, ...]:
    """Where the authority is; elsewhere nobody is known to be."""
    path = KeyAuthority(keys).home / REVOKED
    return _list(path) if path.is_file() else ()


def bundles(keys: Path, roles: Collection[Role] = ROLES) -> list[Path]:
    """The folders of the keys of these roles."""
    try:
        return sorted(p for role in roles for p in keys.glob(f"{role}-*") if p.is_dir())
    except OSError as error:
        raise LindyError(f"cannot read {keys}: {reason(error)}") from None


def _make_folder(folder: Path, files: dict[str, bytes]) -> None:
    """A new folder that nobody else may look into, whole or not at all."""
    if folder.exists():
        raise LindyError(f"{folder} is there already, and keys are never overwritten")
    fresh = folder.with_name(f".{folder.name}-{os.getpid()}")
    try:
        folder.parent.mkdir(parents=True, exist_ok=True, mode=0o700)
        fresh.mkdir(mode=0o700)
        for name, data in files.items():
            write_safely(fresh / name, data, PRIVATE)
        fresh.rename(folder)
    except OSError as error:
        shutil.rmtree(fresh, ignore_errors=True)
        raise LindyError(f"cannot make {folder}: {reason(error)}") from None


def _change(path: Path, to: Callable[[str, Identity], str], who: Identity) -> bool:
    """Change a list of names, whole or not at all. Did it change?"""
    before = _read(path).decode(errors="replace")
    if (after := _in_file(path, to, before, who)) == before:
        return False
    _write(path, after.encode())
    return True


def _write(path: Path, data: bytes) -> None:
    try:
        write_safely(path, data, PRIVATE)
    except OSError as error:
        raise LindyError(f"cannot write {path}: {reason(error)}") from None


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
