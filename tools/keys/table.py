"""`lindy keys list` as a person reads it. Pure."""

from collections.abc import Sequence
from datetime import datetime

from tools.keys.authority import Listed
from tools.keys.certificates import day


def table(found: Sequence[Listed], now: datetime) -> str:
    """One line for each certificate."""
    width = max(len(str(one.certificate.who)) for one in found)
    return "\n".join(
        f"{one.certificate.who!s:<{width}}  {day(one.certificate.begins)} to "
        f"{day(one.certificate.ends)}  {state(one, now)}"
        for one in found
    )


def state(one: Listed, now: datetime) -> str:
    if one.revoked:
        return "revoked"
    if now < one.certificate.begins:
        return "not valid yet"
    return "expired" if now > one.certificate.ends else "valid"
