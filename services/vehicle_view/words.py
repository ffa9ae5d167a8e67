"""The words for what a pilot sees, the same on every screen. Pure."""

from typing import Literal, NamedTuple

from messages import events
from messages.events import FAILSAFE_ACTED, LEAK, RETURN, note, short, told
from services.marine.outputs import LIGHT
from services.vehicle_view.view import DOES, NOT_OBEYED, VehicleView

UNKNOWN = "–"
# Armed is amber everywhere: the propellers may turn, which asks for care. Red is for danger alone,
# and an armed drone is in none.
Tone = Literal["plain", "warning", "alarm"]


STOPPING = "stopping: centre the sticks; they act again once the drone is at rest"


# By `doing`: what a failsafe makes the drone do.
DONE = {doing: events.DOES[reaction] for reaction, doing in DOES.items()} | {
    "stopping": "the drone comes to rest",
    NOT_OBEYED: "nothing moves the drone: its board or control does not answer",
}


class Said(NamedTuple):
    """A sentence for the pilot."""

    text: str
    tone: Tone = "alarm"


def head_up(view: VehicleView) -> list[Said]:
    """The lines of a pilot's window, always the same in the same places: state, depth and heading,
    their references, figures, link; the last has the sentences."""
    late, told = old(view), said(view)
    blind = late or view.depth_m is None or view.heading_deg is None
    here = f"{number(view.depth_m, '.2f')} m   {number(view.heading_deg, '.1f')}°"
    wanted = f"{number(view.depth_wanted_m, '.2f')} m, {number(view.heading_wanted_deg, '.1f')}°"
    age = late or f"{number(view.age_ms, '.0f')} ms old"
    alarm = any(each.tone == "alarm" for each in told)
    return [
        Said(
            f"{known(view)}{armed(view)}", "warning" if view.armed or view.last_known else "plain"
        ),
        Said(here, "warning" if blind else "plain"),
        Said(f"{doing(view)}, {flight_mode(view)}", "plain"),
        Said(f"reference {wanted}", "plain"),
        Said(", ".join(f"{label} {text}" for label, text in numbers(view)), "plain"),
        Said(
            f"round trip {number(view.rtt_ms, '.0f')} ms; depth and heading {age}",
            "alarm" if view.alarms else "warning" if late else "plain",
        ),
        Said("; ".join(each.text for each in told), "alarm" if alarm else "warning"),
    ]


def said(view: VehicleView) -> list[Said]:
    """What is wrong, the gravest first, as what is lost, what the drone does, and what ends it."""
    acts = ": ".join(filter(None, (failsafe(view), acting(view))))
    return [*([Said(acts)] if acts else []), *others(view)]


def others(view: VehicleView) -> list[Said]:
    """What is wrong beside what makes the drone act by itself."""
    link = [Said(f"LINK {alarm(view)}")] if view.alarms else []
    # Water inside does not become a small matter because the pilot flies on.
    grave = [told(each) for each in view.notices if each.code == LEAK.noticed.name]
    return [*link, *(Said(text, "alarm" if text in grave else "warning") for text in notes(view))]


def acting(view: VehicleView) -> str:
    """What is lost, what the drone does now, and what ends it; empty: nothing acts."""
    if not view.acts:
        return ""
    ended = [f"{short(FAILSAFE_ACTED(name).name)} has ended" for name in view.ended]
    ends = [] if view.returns is None else [RETURN[view.returns]]
    does = DONE.get(view.doing, view.doing)
    return known(view) + "; ".join([*map(told, view.acting), *ended, does, *ends])


def notes(view: VehicleView) -> list[str]:
    """What the pilot has to know and what is no alarm."""
    stopping = view.activity == "stopping" and not view.acts
    silence = "" if view.silent_s is None else f"no status from the drone for {view.silent_s:.0f} s"
    return [*filter(None, (STOPPING if stopping else "", silence)), *map(told, view.notices)]


def alarm(view: VehicleView) -> str:
    """What is wrong with the link; empty: nothing."""
    return note(view.alarms)


def number(value: float | None, form: str) -> str:
    return UNKNOWN if value is None else format(value, form)


def known(view: VehicleView) -> str:
    """What stands before the state of a drone that is not heard any more."""
    return "last known: " if view.last_known else ""


def armed(view: VehicleView) -> str:
    return UNKNOWN if not view.activity else "ARMED" if view.armed else "DISARMED"


def failsafe(view: VehicleView) -> str:
    """What acts, since when, and when the drone rises, as in every later stage; empty: nothing."""
    coming = "" if view.next_s is None else f"rises in {max(0.0, view.next_s):.0f} s"
    if not view.acts:
        return f"FAILSAFE {coming}" if coming else ""
    since = "" if view.since_s is None else f" for {view.since_s:.0f} s"
    since = " has ended" if view.resumable else since
    name = short(FAILSAFE_ACTED(view.failsafe).name)
    return f"FAILSAFE {name}{since}" + (f", {coming}" if coming else "")


def doing(view: VehicleView) -> str:
    return view.doing.replace("_", " ") or UNKNOWN


def flight_mode(view: VehicleView) -> str:
    return view.flight_mode.replace("_", " ") or UNKNOWN


def sticks(view: VehicleView, *, yours: bool = False) -> str:
    """Whom the drone obeys.

    Args:
        yours: the reader is in control.
    """
    if not view.activity:
        return UNKNOWN
    if view.acts:
        return "failsafe: the sticks do nothing"
    return "you have the sticks" if yours else f"{view.pilot or 'nobody'} has the sticks"


def old(view: VehicleView) -> str:
    """That depth and heading are old, and by how much; empty: they are not."""
    return f"{(view.age_ms or 0.0) / 1e3:.1f} s old" if view.old else ""


def numbers(view: VehicleView) -> tuple[tuple[str, str], ...]:
    """What a pilot looks at now and then, as (label, text): every screen shows all of it."""
    light = UNKNOWN if view.light is None else f"{100.0 * view.light:.0f} %"
    # Of the others those that are not at rest: lasers that are on must be seen on every screen.
    others = [
        (name.replace("_", " "), f"{100.0 * value:.0f} %")
        for name, value in view.outputs.items()
        if value and name != LIGHT
    ]
    return (("battery", battery(view)), ("light", light), *others)


def battery(view: VehicleView) -> str:
    """`15.9 V, 80 %`: what is left, or what was used where nobody knows how much there was."""
    if view.battery_v is None:
        return UNKNOWN
    words = f"{view.battery_v:.1f} V"
    if view.charge is not None:
        return f"{words}, {100.0 * view.charge:.0f} %"
    return words if view.used_wh is None else f"{words}, {view.used_wh:.1f} Wh used"
