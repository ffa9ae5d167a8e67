"""Certificates are good for one authority, one role, one key and one time."""

import contextlib
from datetime import UTC, datetime, timedelta

import pytest
from cryptography import x509
from cryptography.hazmat.primitives import hashes
from cryptography.hazmat.primitives.asymmetric import ec, ed25519
from cryptography.hazmat.primitives.serialization import (
    BestAvailableEncryption,
    Encoding,
    NoEncryption,
    PrivateFormat,
)
from cryptography.x509.oid import NameOID
from hypothesis import given
from hypothesis import strategies as st

from tools.keys.certificates import (
    AUTHORITY_NAME,
    EARLIER,
    authority,
    check_authority,
    check_certificate,
    check_pair,
    issue,
    key_pem,
    read,
    read_key,
)
from tools.keys.credentials import ROLES, parse

NOW = datetime(2026, 6, 1, tzinfo=UTC)
SIGNER, OTHER, KEY = (ec.generate_private_key(ec.SECP256R1()) for _ in range(3))
CA, FOREIGN = authority(SIGNER, NOW), authority(OTHER, NOW)
DAYS = 10
ANN = issue(parse("pilot:ann"), KEY.public_key(), SIGNER, NOW, DAYS)
TIME = st.timedeltas(min_value=timedelta(days=-30), max_value=timedelta(days=30))
ENDS = [timedelta(0), -EARLIER, timedelta(days=DAYS)]
NEAR = st.tuples(st.sampled_from(ENDS), st.timedeltas(timedelta(seconds=-2), timedelta(seconds=2)))


@given(st.one_of(TIME, NEAR.map(lambda two: two[0] + two[1])))
def test_a_certificate_is_good_from_its_first_to_its_last_second(later: timedelta) -> None:
    if -EARLIER <= later <= timedelta(days=DAYS):
        assert str(check_certificate(ANN, CA, NOW + later).who) == "pilot:ann"
        return
    with pytest.raises(ValueError, match="this computer's clock says") as refused:
        check_certificate(ANN, CA, NOW + later)
    assert ("set the clock" in str(refused.value)) == (later < -EARLIER)


@pytest.mark.parametrize("role", ROLES)
def test_every_role_has_good_certificates(role: str) -> None:
    made = issue(parse(f"{role}:x"), KEY.public_key(), SIGNER, NOW, DAYS)
    assert check_certificate(made, CA, NOW) == read(made)
    check_pair(key_pem(KEY), made)


def by_hand(
    subject: str, issuer: str, signer: ec.EllipticCurvePrivateKey, *, ca: bool = False
) -> bytes:
    """A certificate without a role's usage."""

    def name(text: str) -> x509.Name:
        return x509.Name([x509.NameAttribute(NameOID.COMMON_NAME, text)])

    made = (
        x509.CertificateBuilder(name(issuer), name(subject), KEY.public_key(), 5)
        .not_valid_before(NOW)
        .not_valid_after(NOW + timedelta(days=1))
        .add_extension(x509.BasicConstraints(ca=ca, path_length=None), critical=True)
        .sign(signer, hashes.SHA256())
    )
    return made.public_bytes(Encoding.PEM)


@pytest.mark.parametrize(
    ("made", "why"),
    [
        (by_hand("pilot:ann", "pilot:ann", KEY), "is from another authority"),
        (CA, "did not make it"),
        (by_hand("pilot:ann", AUTHORITY_NAME, OTHER), "is from another authority"),
        (by_hand("pilot:ann", AUTHORITY_NAME, SIGNER), "is not made for the role of pilot:ann"),
        (by_hand("king:ann", AUTHORITY_NAME, SIGNER), "`lindy keys` did not make it"),
        (b"", "is not a certificate"),
        (key_pem(KEY), "is not a certificate"),
    ],
    ids=["self-signed", "authority's own", "foreign", "no role", "no name", "empty", "a key"],
)  # fmt: skip
def test_what_is_no_good_is_refused_with_the_reason(made: bytes, why: str) -> None:
    with pytest.raises(ValueError, match=why):
        check_certificate(made, CA, NOW)


def test_who_was_signed_by_the_authority_is_no_authority() -> None:
    with pytest.raises(ValueError, match="not the certificate of an authority"):
        check_authority(ANN, NOW)
    check_authority(CA, NOW)
    with pytest.raises(ValueError, match="was valid until 2036"):
        check_authority(CA, NOW + timedelta(days=4000))


def locked() -> bytes:
    secret = BestAvailableEncryption(b"secret")
    return KEY.private_bytes(Encoding.PEM, PrivateFormat.PKCS8, secret)


def another_kind() -> bytes:
    key = ed25519.Ed25519PrivateKey.generate()
    return key.private_bytes(Encoding.PEM, PrivateFormat.PKCS8, NoEncryption())


@pytest.mark.parametrize(
    ("data", "why"),
    [
        (key_pem(OTHER), "does not belong to certificate.pem"),
        (ANN, "is not a private key"),
        (b"", "is not a private key"),
        (locked(), "is not a private key"),
        (another_kind(), "is not a private key"),
    ],
    ids=["another's", "a certificate", "empty", "locked", "kind"],
)
def test_a_key_is_that_of_its_certificate(data: bytes, why: str) -> None:
    check_pair(key_pem(KEY), ANN)
    with pytest.raises(ValueError, match=why):
        check_pair(data, ANN)


@given(
    st.sampled_from([ANN, CA, key_pem(KEY)]), st.integers(0, 2000), st.integers(0, 255), st.data()
)
def test_a_damaged_file_is_refused_or_as_good_as_before(
    whole: bytes, at: int, to: int, data: st.DataObject
) -> None:
    at %= len(whole)
    damaged = whole[:at] + bytes([to]) + whole[at + data.draw(st.integers(0, 2)) :]
    for judge in (
        lambda: check_certificate(damaged, CA, NOW),
        lambda: check_certificate(ANN, damaged, NOW),
        lambda: check_authority(damaged, NOW),
        lambda: check_pair(key_pem(KEY), damaged),
        lambda: check_pair(damaged, ANN),
        lambda: read_key(damaged),
    ):
        with contextlib.suppress(ValueError):  # and nothing else
            judge()
