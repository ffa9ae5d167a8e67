"""Endpoints on the command line, checked before anything is made for a dive."""

import re

from services.runtime.border import NETWORK
from services.runtime.errors import LindyError

ENDPOINT = re.compile(rf"({'|'.join(NETWORK)})/(\[[^\]/\s]+\]|[^:/\s]+):\d{{1,5}}([?#]\S*)?")


def checked_endpoint(option: str, endpoint: str) -> None:
    """
    Raises:
        LindyError: it is not PROTOCOL/ADDRESS:PORT.
    """
    if ENDPOINT.fullmatch(endpoint) is None:
        raise LindyError(
            f"{option} is {endpoint!r}, expected PROTOCOL/ADDRESS:PORT with a protocol of"
            f" {', '.join(NETWORK)}, for example tcp/192.168.2.2:7447"
        )
