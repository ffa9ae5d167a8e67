"""The token of this start, where other machines reach the cockpit."""

import os
import secrets

from services.cockpit.core import Settings
from services.cockpit.handshake import Access

VARIABLE = "LINDY_COCKPIT_TOKEN"  # from `lindy dive --cockpit`, so that it can print the address


def access_to(settings: Settings) -> Access:
    scheme = "https" if settings.certificate else "http"
    token = "" if settings.local else os.environ.get(VARIABLE) or secrets.token_urlsafe(16)
    return Access(scheme, settings.host, settings.port, settings.local, token)
