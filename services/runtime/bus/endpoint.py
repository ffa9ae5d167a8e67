"""Where a hub listens and where it is reached, as Zenoh writes it: PROTOCOL/ADDRESS."""

import re

from services.runtime.config.errors import LindyError

MOST = 65535  # the highest port
EXAMPLE = "tcp/127.0.0.1:7447"
# Only protocols to which access control gives rights: by others a hub would hear nobody.
# Of Zenoh's options behind an address only the network interface: others could switch keys off.
ENDPOINT = re.compile(
    r"(tcp|udp|tls|quic)/(\[[^\]/\s]+\]|[^:/?#\s]+):(?P<port>[0-9]+)(#iface=[\w.-]+)?"
    r"|unixsock-stream/[^?#]+"
)


def checked_endpoint(text: str, option: str) -> str:
    """
    Raises:
        LindyError: this is no endpoint, or there is no such port.
    """
    found = ENDPOINT.fullmatch(text)
    if found is None:
        raise LindyError(
            f"{option} {text!r}: expected PROTOCOL/ADDRESS:PORT with tcp, tls, quic or udp, such "
            f"as {EXAMPLE}"
        )
    port = found["port"]
    if port is not None and (len(port) > len(str(MOST)) or not 1 <= int(port) <= MOST):
        raise LindyError(f"{option} {text!r}: no such port, expected one of 1 to {MOST}")
    return text
