"""Certificates: made from a public key, and judged from their bytes. Pure.

X.509 (RFC 5280). A drone's or router's certificate may answer (extended key usage `serverAuth`) and
call a router (`clientAuth`); a pilot's or observer's may only call, so that a stolen pilot's key
cannot pose as a drone. All raise ValueError with what is wrong, to be put behind the name of the
file.
"""

from datetime import UTC, datetime, timedelta
from typing import NamedTuple

from cryptography import x509
from cryptography.exceptions import InvalidSignature, UnsupportedAlgorithm
from cryptography.hazmat.primitives import hashes
from cryptography.hazmat.primitives.asymmetric import ec
from cryptography.hazmat.primitives.serialization import (
    Encoding,
    NoEncryption,
    PrivateFormat,
    load_pem_private_key,
)
from cryptography.x509.oid import ExtendedKeyUsageOID, NameOID

from tools.keys.credentials import Identity, Role, parse

AUTHORITY_DAYS = 3650
EARLIER = timedelta(days=1)  # valid from a day before: no two clocks are equal
AUTHORITY_NAME = "lindy keys"
ANSWER, CALL = ExtendedKeyUsageOID.SERVER_AUTH, ExtendedKeyUsageOID.CLIENT_AUTH
# The first is what makes a certificate good for its role.
USAGE: dict[Role, tuple[x509.ObjectIdentifier, ...]] = {
    "drone": (ANSWER, CALL),
    "pilot": (CALL,),
    "observer": (CALL,),
    "router": (ANSWER, CALL),
}
ABSENT = (x509.ExtensionNotFound, x509.DuplicateExtension, ValueError)  # or damaged


class Certificate(NamedTuple):
    """A certificate that somebody's keys hold."""

    who: Identity
    begins: datetime  # UTC
    ends: datetime

    def state(self, now: datetime) -> str:
        if now < self.begins:
            return "not valid yet"
        return "expired" if now > self.ends else "valid"


def authority(key: ec.EllipticCurvePrivateKey, now: datetime) -> bytes:
    """The certificate (PEM) of a new authority, signed by itself."""
    usage = x509.KeyUsage(
        digital_signature=False, content_commitment=False, key_encipherment=False,
        data_encipherment=False, key_agreement=False, key_cert_sign=True, crl_sign=True,
        encipher_only=False, decipher_only=False,
    )  # fmt: skip
    made = (
        _builder(AUTHORITY_NAME, key.public_key(), now, AUTHORITY_DAYS)
        .add_extension(x509.BasicConstraints(ca=True, path_length=0), critical=True)
        .add_extension(usage, critical=True)
        .add_extension(x509.SubjectKeyIdentifier.from_public_key(key.public_key()), critical=False)
    )
    return made.sign(key, hashes.SHA256()).public_bytes(Encoding.PEM)


def issue(
    who: Identity,
    public: ec.EllipticCurvePublicKey,
    signer: ec.EllipticCurvePrivateKey,
    now: datetime,
    days: int,
) -> bytes:
    """A certificate (PEM) for somebody's public key, signed by the authority."""
    made = (
        _builder(str(who), public, now, days)
        .add_extension(x509.BasicConstraints(ca=False, path_length=None), critical=True)
        .add_extension(x509.ExtendedKeyUsage(USAGE[who.role]), critical=True)
        .add_extension(x509.SubjectAlternativeName([x509.DNSName("lindy")]), critical=False)
    )
    return made.sign(signer, hashes.SHA256()).public_bytes(Encoding.PEM)


def _builder(
    subject: str, public: ec.EllipticCurvePublicKey, now: datetime, days: int
) -> x509.CertificateBuilder:
    issuer, name = (
        x509.Name([x509.NameAttribute(NameOID.COMMON_NAME, text)])
        for text in (AUTHORITY_NAME, subject)
    )
    serial, ends = x509.random_serial_number(), now + timedelta(days=days)
    return x509.CertificateBuilder(issuer, name, public, serial, now - EARLIER, ends)


def key_pem(key: ec.EllipticCurvePrivateKey) -> bytes:
    """The file of a private key, without a password: nobody types one on board."""
    return key.private_bytes(Encoding.PEM, PrivateFormat.PKCS8, NoEncryption())


def read_key(data: bytes) -> ec.EllipticCurvePrivateKey:
    """The private key of such a file."""
    try:
        key = load_pem_private_key(data, password=None)
    except (ValueError, TypeError, UnsupportedAlgorithm):  # TypeError: it has a password
        key = None
    if not isinstance(key, ec.EllipticCurvePrivateKey):
        raise ValueError("is not a private key that `lindy keys` made")
    return key


def read(data: bytes) -> Certificate:
    """Whose certificate it is, and when it is valid."""
    certificate = _load(data)
    names = certificate.subject.get_attributes_for_oid(NameOID.COMMON_NAME)
    try:
        who = parse(" ".join(str(name.value) for name in names))
    except ValueError as error:
        raise ValueError(f"{error}: `lindy keys` did not make it") from None
    return Certificate(who, certificate.not_valid_before_utc, certificate.not_valid_after_utc)


def check_certificate(data: bytes, authority: bytes, now: datetime | None) -> Certificate:
    """Is it the authority's, for its role, and valid now? None: at whatever time."""
    certificate = _load(data)
    try:
        certificate.verify_directly_issued_by(_load(authority))
    except (ValueError, TypeError, InvalidSignature):
        raise ValueError("is from another authority than that of ca.pem") from None
    found = read(data)
    try:
        usages = certificate.extensions.get_extension_for_class(x509.ExtendedKeyUsage).value
    except ABSENT:
        usages = ()
    if USAGE[found.who.role][0] not in usages:
        raise ValueError(f"is not made for the role of {found.who}")
    again = f"lindy keys add {found.who.role} {found.who.name} --again"
    if now is not None:
        remedy = f"renew it where the authority is, with `{again}`"
        _check_dates(found.begins, found.ends, now, remedy)
    return found


def check_authority(data: bytes, now: datetime) -> datetime:
    """Is it that of an authority, and valid now? Returns until when."""
    certificate = _load(data)
    try:
        is_one = certificate.extensions.get_extension_for_class(x509.BasicConstraints).value.ca
    except ABSENT:
        is_one = False
    if not is_one:
        raise ValueError("is not the certificate of an authority")
    remedy = "make a new authority in another folder, and new keys for all, with `lindy keys new`"
    begins, ends = certificate.not_valid_before_utc, certificate.not_valid_after_utc
    _check_dates(begins, ends, now, remedy)
    return ends


def _check_dates(begins: datetime, ends: datetime, now: datetime, remedy: str) -> None:
    clock = f"and this computer's clock says {day(now)}"
    if now < begins:
        raise ValueError(f"is valid from {day(begins)} on, {clock}: set the clock")
    if now > ends:
        raise ValueError(f"was valid until {day(ends)}, {clock}: if the clock is right, {remedy}")


def public_key(data: bytes) -> ec.EllipticCurvePublicKey:
    """The key that a certificate is for."""
    key = _load(data).public_key()
    if not isinstance(key, ec.EllipticCurvePublicKey):
        raise ValueError("is not for the kind of key that `lindy keys` makes")
    return key


def check_pair(key: bytes, certificate: bytes) -> None:
    """Does the private key belong to the certificate?"""
    if read_key(key).public_key() != public_key(certificate):
        raise ValueError("does not belong to certificate.pem")


def day(at: datetime) -> str:
    return f"{at.astimezone(UTC):%Y-%m-%d}"


def _load(data: bytes) -> x509.Certificate:
    try:
        return x509.load_pem_x509_certificate(data)
    except (ValueError, UnsupportedAlgorithm):
        raise ValueError("is not a certificate") from None
