"""Which Lindy a side runs. From `link_monitor`, of each side, at once and every second.

It must be understood by every version of Lindy, older or newer: its fields all have defaults, none
is ever removed and none changes its type.
"""

from messages.message import Message
from messages.units import Count, Name, Stamp


class SideIdentity(Message, frozen=True, kw_only=True):
    """Two sides fly together only with the same version, messages and vehicle."""

    stamp_ns: Stamp = 0
    side: Name = ""
    instance: Count = 0  # drawn by the process that says it, at its start
    version: Name = ""  # of Lindy
    commit: Name = ""  # of the repository it runs from; empty: installed, or on virtual time
    messages: Name = ""  # hash of the topic table and of all message types
    vehicle: Name = ""  # its name
    vehicle_hash: Name = ""  # of the table [vehicle] of its file, with what --set changed


def difference(ours: SideIdentity, theirs: SideIdentity) -> str:
    """Why two sides cannot fly together, in one sentence; empty when they can."""
    who, here = theirs.side or "other side", ours.side or "this side"
    if theirs.version != ours.version or theirs.messages != ours.messages:
        messages = "" if theirs.messages == ours.messages else ", with other messages"
        return (
            f"the {who} runs Lindy {_named(theirs)}{messages}; the {here} runs {_named(ours)}: "
            f"install the same on both machines"
        )
    if (theirs.vehicle, theirs.vehicle_hash) != (ours.vehicle, ours.vehicle_hash):
        return (
            f"the {who} was started with another vehicle than the {here}: the table [vehicle] of "
            f"{theirs.vehicle or 'its file'} differs, or a --set; give both the same file"
        )
    return ""


def _named(identity: SideIdentity) -> str:
    commit = f" ({identity.commit})" if identity.commit else ""
    return f"{identity.version or 'of an unknown version'}{commit}"
