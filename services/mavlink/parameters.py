"""The parameters that ground stations of a submarine ask for, under ArduSub's names, by
PARAM_REQUEST_LIST, PARAM_REQUEST_READ and PARAM_SET.

Those of the pilot's gamepad can be changed, until the service ends. The others say how the drone
behaves, in ArduSub's terms; to change one is refused, and the answer is the value in force."""

from collections.abc import Mapping
from math import isfinite
from typing import NamedTuple

from messages import events
from messages.events import Outbox
from messages.pilot import TTL_MS
from services.mavlink.pilot import Addressed, Reaction
from services.mavlink_io.packet import MavlinkPacket, MavSeverity

INT8, INT16, INT32, REAL32 = 2, 4, 6, 9  # MAV_PARAM_TYPE
NO_INDEX = -1  # PARAM_REQUEST_READ: by name
AT_ONCE = 10  # of a list, in one tick
BUTTONS = 32  # of MANUAL_CONTROL: `buttons` and `buttons2`


class Parameter(NamedTuple):
    value: float
    kind: int = REAL32
    limits: tuple[float, float] | None = None  # it can be changed within these; None: it cannot


# What the buttons do: as in ArduSub, for those functions that are here (`buttons.py`).
BUTTON_DEFAULTS = (0, 5, 7, 6, 4, 0, 3, 0, 0, 23, 22, 42, 43, 33, 32, 0, *(0,) * 16)
TABLE: Mapping[str, Parameter] = {
    "SYSID_THISMAV": Parameter(1.0, INT16),
    "SYSID_MYGCS": Parameter(255.0, INT16),
    "FRAME_CONFIG": Parameter(7.0, INT8),  # custom
    "ARMING_CHECK": Parameter(1.0, INT32),  # all
    "FS_PILOT_INPUT": Parameter(1.0, INT8),  # comes to rest and holds; ArduSub would only warn
    "FS_PILOT_TIMEOUT": Parameter(TTL_MS / 1e3),  # [s]
    "FS_GCS_ENABLE": Parameter(0.0, INT8),  # sticks count, not heartbeats
    "FS_LEAK_ENABLE": Parameter(2.0, INT8),  # rises
    "FS_PRESS_ENABLE": Parameter(0.0, INT8),
    "FS_TEMP_ENABLE": Parameter(1.0, INT8),  # warns
    "FS_EKF_ACTION": Parameter(1.0, INT8),  # warns, and comes to rest
    "FS_CRASH_CHECK": Parameter(0.0, INT8),
    "BATT_FS_LOW_ACT": Parameter(0.0, INT8),  # warns; ArduSub has no number for that
    "BATT_FS_CRT_ACT": Parameter(3.0, INT8),  # rises
    "BATT_MONITOR": Parameter(4.0, INT8),  # voltage and current
    "RC_OVERRIDE_TIME": Parameter(TTL_MS / 1e3),  # [s]
    "SURFACE_DEPTH": Parameter(0.0),
    "COMPASS_USE": Parameter(1.0, INT8),
    "JS_GAIN_DEFAULT": Parameter(0.5, REAL32, (0.1, 1.0)),
    "JS_GAIN_MIN": Parameter(0.25, REAL32, (0.1, 1.0)),
    "JS_GAIN_MAX": Parameter(1.0, REAL32, (0.1, 1.0)),
    "JS_GAIN_STEPS": Parameter(4.0, INT8, (1.0, 10.0)),
    "JS_LIGHTS_STEPS": Parameter(8.0, INT8, (1.0, 10.0)),
    "JS_THR_GAIN": Parameter(1.0),
    **{
        f"BTN{k}_FUNCTION": Parameter(float(n), INT8, (0.0, 127.0))
        for k, n in enumerate(BUTTON_DEFAULTS)
    },
    **{f"BTN{k}_SFUNCTION": Parameter(0.0, INT8, (0.0, 0.0)) for k in range(BUTTONS)},
}
NAMES = tuple(sorted(TABLE))


class Parameters:
    """Their values, and the answers about them."""

    def __init__(self, system: int, outbox: Outbox) -> None:
        """`system`: our system id."""
        self._outbox = outbox
        self._values = {name: parameter.value for name, parameter in TABLE.items()}
        self._values["SYSID_THISMAV"] = float(system)
        self._next = dict[str, int]()  # link → next of its list

    def __getitem__(self, name: str) -> float:
        return self._values[name]

    def begin_list(self, packet: MavlinkPacket) -> None:
        """Begin the list on this link, or begin it again."""
        self._next[packet.sender.link] = 0

    def forget(self, link: str) -> None:
        self._next.pop(link, None)

    def answer(self, packet: MavlinkPacket, out: Reaction) -> None:
        index: int | None = packet.fields["param_index"]
        if index == NO_INDEX:
            index = _index(packet.fields["param_id"])
        if index is None or not 0 <= index < len(NAMES):
            self._outbox.tell(events.UNKNOWN_PARAMETER("mavlink"))
        else:
            out.packets.append(Addressed(packet.sender.link, self._packet(index)))

    def set(self, packet: MavlinkPacket, out: Reaction, *, is_holder: bool) -> None:
        """The answer is the value in force, on all links."""
        name: str = packet.fields["param_id"]
        index = _index(name)
        if index is None:
            self._outbox.tell(events.UNKNOWN_PARAMETER("mavlink"))
            return
        if not is_holder:
            self._outbox.tell(events.NOT_THE_HOLDER("parameter"))
            refusal = f"{events.NOT_THE_HOLDER.sentence}: {name} is not changed"
            out.say(packet.sender.link, MavSeverity.WARNING, refusal)
        elif refusal := self._change(name, packet.fields["param_value"]):
            self._outbox.tell(events.REFUSED_PARAMETER())
            out.say(packet.sender.link, MavSeverity.WARNING, refusal)
        out.packets.append(Addressed(None, self._packet(index)))

    def tick(self, out: Reaction) -> None:
        """The next of each list."""
        for link, begin in list(self._next.items()):
            end = min(begin + AT_ONCE, len(NAMES))
            out.packets += [Addressed(link, self._packet(index)) for index in range(begin, end)]
            self._next[link] = end
            if end == len(NAMES):
                del self._next[link]

    def _packet(self, index: int) -> MavlinkPacket:
        """PARAM_VALUE: a float, whatever the type."""
        name = NAMES[index]
        fields = {
            "param_id": name.encode(),
            "param_value": self._values[name],
            "param_type": TABLE[name].kind,
            "param_count": len(NAMES),
            "param_index": index,
        }
        return MavlinkPacket("PARAM_VALUE", fields)

    def _change(self, name: str, value: float) -> str:
        """Returns why not, or nothing."""
        limits = TABLE[name].limits
        if limits is None:
            return f"{name} cannot be changed from a ground station"
        low, high = limits
        if not (isfinite(value) and low <= value <= high):
            return f"{name}: {value:g} is not between {low:g} and {high:g}"
        self._values[name] = value if TABLE[name].kind == REAL32 else float(round(value))
        return ""


def _index(name: str) -> int | None:
    """None: there is no such parameter."""
    return NAMES.index(name) if name in TABLE else None
