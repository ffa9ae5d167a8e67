"""Which older requests a newer one withdraws, so that no late repetition arms the drone or sends it
off again after a stop, or back to where it was sent before."""

from messages.pilot import PilotRequest, RequestKind

OVERRULES: dict[RequestKind, tuple[RequestKind, ...]] = {
    "stop": ("arm", "goto", "follow", "mode"),
    "disarm": ("arm", "goto", "follow"),
    "goto": ("goto", "follow", "mode"),
    "follow": ("goto", "follow", "mode"),
    "mode": ("goto", "follow", "mode"),
}  # a newer request → older ones that are not repeated any more


def overrules(newer: PilotRequest, older: PilotRequest) -> bool:
    return older.kind in OVERRULES.get(newer.kind, ())
