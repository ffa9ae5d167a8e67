"""Where a hub listens and where it is reached, as Zenoh writes it: PROTOCOL/ADDRESS."""

import re

from services.runtime.config.errors import LindyError

EXAMPLE = "tcp/127.0.0.1:7447"
ENDPOINT = re.compile(
    r"(tcp|udp|tls|quic|ws)/(\[[^\]/\s]+\]|[^:/?#\s]+):\d{1,5}([?#].*)?|(unixsock-stream|unixpipe|vsock|serial)/.+"
)


def checked_endpoint(text: str, option: str) -> str:
    """
    Raises:
        LindyError: this is no endpoint.
    """
    if not ENDPOINT.fullmatch(text):
        raise LindyError(f"{option} {text!r}: expected PROTOCOL/ADDRESS:PORT, such as {EXAMPLE}")
    return text
