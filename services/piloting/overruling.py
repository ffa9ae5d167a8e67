"""Which older requests a newer one withdraws, so that no late repetition arms the drone, ends
a failsafe or starts an older manoeuvre again."""

from messages.pilot import PilotRequest, RequestKind

OVERRULES: dict[RequestKind, tuple[RequestKind, ...]] = {
    "stop": ("arm", "resume", "goto", "follow", "mode"),
    "disarm": ("arm", "resume", "goto", "follow"),
    "goto": ("goto", "follow", "mode"),
    "follow": ("goto", "follow", "mode"),
    "mode": ("goto", "follow", "mode"),
    "light": ("light",),
}  # newer request → older requests that are no longer repeated


def overrules(newer: PilotRequest, older: PilotRequest) -> bool:
    if newer.kind == "output":
        return (older.kind, older.output) == ("output", newer.output)
    return older.kind in OVERRULES.get(newer.kind, ())
