"""The words for what a pilot sees, the same in the terminal and in the keyboard's window. Pure."""

from messages.counts import short
from services.piloting.pilot_view import PilotView

OLD_MS = 150.0  # [ms] the age of depth and heading is shown from here on
UNKNOWN = "–"


def number(value: float | None, form: str) -> str:
    return UNKNOWN if value is None else format(value, form)


def known(view: PilotView) -> str:
    """What stands before the state of a drone that is not heard any more."""
    return "last known: " if view.last_known else ""


def armed(view: PilotView) -> str:
    return "ARMED" if view.armed else "DISARMED"


def failsafe(view: PilotView) -> str:
    """What acts, since when, and when it does more; empty: nothing."""
    coming = "" if view.next_s is None else f"in {max(0.0, view.next_s):.0f} s"
    if view.failsafe == "none":
        return f"FAILSAFE {coming}" if coming else ""
    since = "" if view.since_s is None else f" for {view.since_s:.0f} s"
    name = short(f"failsafe:{view.failsafe}")
    return f"FAILSAFE {name}{since}" + (f", next {coming}" if coming else "")


def old(view: PilotView) -> str:
    """That depth and heading are old, and by how much; empty: they are not."""
    age_ms = view.age_ms
    return "" if age_ms is None or age_ms <= OLD_MS else f"{age_ms / 1e3:.1f} s old"


def hold(view: PilotView) -> str:
    return view.hold.replace("_", " ") or UNKNOWN


def light(view: PilotView) -> str:
    return f"{number(None if view.light is None else 100.0 * view.light, '.0f')} %"


def battery(view: PilotView) -> str:
    words = f"{number(view.battery_v, '.1f')} V"
    if view.used_wh is not None:
        words += f", {view.used_wh:.1f} Wh used"
        words += "" if view.capacity_wh is None else f" of {view.capacity_wh:.0f}"
    return words
