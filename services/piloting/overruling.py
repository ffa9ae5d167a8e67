"""Which older requests a newer one withdraws, so that no late repetition arms the drone, ends
a failsafe or starts an older manoeuvre again."""

from messages.pilot import MANOEUVRES, PilotRequest, RequestKind

OVERRULES: dict[RequestKind, tuple[RequestKind, ...]] = {
    "stop": ("arm", "resume", *MANOEUVRES, "mode"),
    "disarm": ("arm", "resume", *MANOEUVRES),
    "mode": (*MANOEUVRES, "mode"),
    **dict.fromkeys(MANOEUVRES, (*MANOEUVRES, "mode")),
    "light": ("light",),
}  # newer request → older requests that are no longer repeated


def overrules(newer: PilotRequest, older: PilotRequest) -> bool:
    if newer.kind == "output":
        return (older.kind, older.output) == ("output", newer.output)
    return older.kind in OVERRULES.get(newer.kind, ())
