"""Addresses may hold passwords, which nobody may read: in a log, on a screen, in a recording."""

import re

# What stands before the last @ of an address, and its query. A password may hold nearly any letter;
# rather too much of an address is left out than a part of a password shown.
_BEFORE_HOST = re.compile(r"(\w://)[^\"'\n]*@")
_QUERY = re.compile(r"(\w://[^\"'\n?]*\?)[^\"'\n\s]*")


def without_passwords(text: str) -> str:
    """A text as it may be shown and recorded: of each address in it without user, password and
    query, which are replaced by …"""
    return _QUERY.sub(r"\1…", _BEFORE_HOST.sub(r"\1…@", text))
