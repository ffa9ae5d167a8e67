"""Where the cockpit is reached, and with which token by other machines."""

import os
import secrets
import socket

from services.cockpit.core import Settings
from services.cockpit.handshake import Access
from services.runtime.config.errors import LindyError

VARIABLE = "LINDY_COCKPIT_TOKEN"  # from `lindy dive --cockpit`, so that it can print the address


def access_to(settings: Settings) -> Access:
    scheme = "https" if settings.certificate else "http"
    open_to_all = settings.local or settings.insecure
    token = "" if open_to_all else os.environ.get(VARIABLE) or secrets.token_urlsafe(16)
    return Access(scheme, settings.host, settings.port, settings.local, token)


def listening(settings: Settings) -> socket.socket:
    """The socket for pages.

    Raises:
        LindyError: the port is taken, or the address is not of this machine.
    """
    family = socket.AF_INET6 if ":" in settings.host else socket.AF_INET
    try:
        return socket.create_server((settings.host, settings.port), family=family)
    except OSError as error:
        raise LindyError(
            f"the cockpit cannot listen on {settings.host}:{settings.port}: {error.strerror}; "
            f"another port is --set cockpit.port={settings.port % 65535 + 1}"
        ) from None
