"""The certificate authority in a folder: what `lindy keys` does there."""

from datetime import datetime
from pathlib import Path
from typing import NamedTuple

from cryptography import x509
from cryptography.hazmat.primitives.asymmetric import ec

from services.runtime.config.errors import LindyError
from tools.keys import certificates, key_folder
from tools.keys.certificates import LONGEST_DAYS, Certificate
from tools.keys.key_folder import (
    ADMITTED,
    AUTHORITY,
    CA,
    CA_KEY,
    CERTIFICATE,
    KEY,
    MAKE,
    REVOKED,
    SIGNED,
    bundles,
    make_bundle,
    read,
    read_list,
    said,
)
from tools.keys.roles import LETS_IN, Identity, let_in, with_one, without


class Listed(NamedTuple):
    """A line of `lindy keys list`."""

    certificate: Certificate
    revoked: bool
    folder: Path


def new(keys: Path, now: datetime) -> None:
    """A new authority.

    Raises:
        LindyError: there is one already, or it cannot be written.
    """
    key = _new_key()
    made = {
        CA: certificates.authority(key, now, x509.random_serial_number()),
        CA_KEY: certificates.key_pem(key),
        SIGNED: b"",
        REVOKED: b"",
    }
    make_bundle(keys / AUTHORITY, made)


def add(keys: Path, who: Identity, now: datetime, days: int) -> tuple[Path, list[Path]]:
    """Keys for somebody. Returns their folder, and the lists of others that name them now.

    Raises:
        LindyError: the name was used before, there is no authority, or it cannot be written.
    """
    home = keys / AUTHORITY
    if not home.is_dir():
        raise LindyError(f"there is no authority in {keys}: {MAKE}")
    if who in read_list(home / SIGNED):  # an old certificate must not become valid with a new name
        longer = "" if _revoked(keys, who) else f", or make them last: `lindy keys renew {who}`"
        raise LindyError(f"{who} has keys already, or had once; choose another name{longer}")
    ca, signer = _signer(home, now, days)
    key = _new_key()
    public, serial = key.public_key(), x509.random_serial_number()
    others = let_in(who.role, [one for one in read_list(home / SIGNED) if not _revoked(keys, one)])
    made = {
        CA: ca,
        CERTIFICATE: certificates.issue(who, public, signer, now, days, serial),
        KEY: certificates.key_pem(key),
        ADMITTED: _list_of(who, others).encode(),
    }
    key_folder.change(home / SIGNED, lambda text: with_one(text, who))  # first: used is used
    make_bundle(keys / who.folder, made)
    return keys / who.folder, _let_in_by_all(keys, who)


def renew(keys: Path, who: Identity, now: datetime, days: int) -> tuple[Path, Path]:
    """A new certificate for the same name and key. Returns it, and where the old one is kept.

    Raises:
        LindyError: who was revoked or has no keys here, there is no authority, or it cannot be
            written.
    """
    home, path = keys / AUTHORITY, keys / who.folder / CERTIFICATE
    if not home.is_dir():
        raise LindyError(f"there is no authority in {keys}: certificates are renewed where it is")
    if _revoked(keys, who):
        raise LindyError(f"{who} was revoked, and its name is never given again")
    if who not in read_list(home / SIGNED):
        raise LindyError(f"{keys} has no keys of {who}; `lindy keys list` shows all")
    ca, signer = _signer(home, now, days)
    before = read(path)
    if (found := said(path, certificates.check_issued, before, ca)).who != who:
        raise LindyError(f"{path} is that of {found.who}, not of {who}")
    public, serial = said(path, certificates.public_key, before), x509.random_serial_number()
    fresh = certificates.issue(who, public, signer, now, days, serial)
    return path, key_folder.supersede(path, fresh)


def _signer(home: Path, now: datetime, days: int) -> tuple[bytes, ec.EllipticCurvePrivateKey]:
    """The authority's certificate and its key, which may sign for so many days.

    Raises:
        LindyError: it is not valid now, cannot be read, or may not sign for so long.
    """
    ca, signer = read(home / CA), said(home / CA_KEY, certificates.read_key, read(home / CA_KEY))
    said(home / CA, certificates.check_authority, ca, now)
    _check_days(days, certificates.ends(ca), now)
    return ca, signer


def revoke(keys: Path, who: Identity) -> list[Path]:
    """Take a name off every list in this folder. Returns those that it was on.

    Raises:
        LindyError: nobody here knows the name, or a list cannot be written.
    """
    changed = [
        folder / ADMITTED
        for folder in bundles(keys)
        if key_folder.change(folder / ADMITTED, lambda text: without(text, who))
    ]
    if (home := keys / AUTHORITY).is_dir():
        if who not in read_list(home / SIGNED):
            raise LindyError(f"{keys} has no keys of {who}; `lindy keys list` shows all")
        key_folder.change(home / REVOKED, lambda text: with_one(text, who))
    elif not changed:
        raise LindyError(f"{who} is on no list in {keys}")
    return changed


def listed(keys: Path) -> list[Listed]:
    """Every certificate in the folder.

    Raises:
        LindyError: there is none, or one cannot be read.
    """
    if not keys.is_dir():
        raise LindyError(f"no keys in {keys}, which is not there: {MAKE}")
    found: list[Listed] = []
    for folder in bundles(keys):
        path = folder / CERTIFICATE
        certificate = said(path, certificates.read, read(path))
        found.append(Listed(certificate, _revoked(keys, certificate.who), folder))
    if not found:
        raise LindyError(f"no keys in {keys}: {MAKE}")
    return found


def _revoked(keys: Path, who: Identity) -> bool:
    path = keys / AUTHORITY / REVOKED
    return path.is_file() and who in read_list(path)


def _let_in_by_all(keys: Path, who: Identity) -> list[Path]:
    """Put a new name on the lists of those who have a use for it."""
    lists = [
        folder / ADMITTED
        for folder in bundles(keys)
        if folder.name != who.folder  # a router needs no other with its own key
        and any(folder.name.startswith(f"{role}-") for role in LETS_IN if who.role in LETS_IN[role])
    ]
    return [path for path in lists if key_folder.change(path, lambda text: with_one(text, who))]


def _list_of(who: Identity, others: tuple[Identity, ...]) -> str:
    heading = f"# Whose certificates {who} lets in. Read when its side of a dive is started.\n"
    return heading + "".join(f"{other}\n" for other in others)


def _check_days(days: int, authority_ends: datetime, now: datetime) -> None:
    most = min(LONGEST_DAYS, (authority_ends - now).days)
    if not 1 <= days <= most:
        raise LindyError(f"--days is {days}, expected 1 to {most}")


def _new_key() -> ec.EllipticCurvePrivateKey:
    return ec.generate_private_key(ec.SECP256R1())
