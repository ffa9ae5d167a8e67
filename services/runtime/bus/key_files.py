"""The certificate files of this machine, and Zenoh's TLS settings for them."""

from typing import Any, NamedTuple


class KeyFiles(NamedTuple):
    """Paths of PEM files."""

    authority: str  # certificate of the authority that signed everybody's certificate
    certificate: str  # this machine's
    key: str  # its private key


class Credentials(NamedTuple):
    """How this machine proves who it is, and whom it lets in."""

    keys: KeyFiles
    admitted: tuple[str, ...]  # common names of certificates, `role:name`
    name: str = ""  # of this machine's own certificate, without its role


def tls_settings(keys: KeyFiles) -> dict[str, Any]:
    """Zenoh's `transport/link/tls`: both ends prove who they are.

    A certificate names a role and no address, so addresses are not compared; that only a drone's
    certificate can answer and only a pilot's or observer's can call is in its extended key usage.
    A certificate that expires during a dive does not end the dive.
    """
    return {
        "root_ca_certificate": keys.authority,
        "listen_certificate": keys.certificate,
        "listen_private_key": keys.key,
        "connect_certificate": keys.certificate,
        "connect_private_key": keys.key,
        "enable_mtls": True,
        "verify_name_on_connect": False,
        "close_link_on_expiration": False,
    }
