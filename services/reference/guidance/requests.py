"""Requests that move the drone or change its mode; each returns the reason for a refusal, or
nothing. And the vehicle's outputs as the pilot wants them: what keeps its value, and what is held.
"""

from collections.abc import Mapping
from math import tau

from messages.pilot import Course, FlightMode, PilotAnswer, PilotCommand, PilotRequest
from messages.units import Ns, Outputs
from services.marine.attitude import north_offset, whole_turns, wrapped
from services.marine.outputs import LIGHT, Output, gripper_of, refusal
from services.reference.guidance.axes import lacking, safe
from services.reference.guidance.guidance import Guidance
from services.reference.guidance.path_following import PlannedPath
from services.reference.guidance.station_keeping import Pair


def mode(guidance: Guidance, flight_mode: FlightMode | None, *, armed: bool) -> str:
    """Change the mode."""
    if flight_mode is None:
        return "mode needs to be told what to hold"
    if reason := lacking(flight_mode, guidance.state, armed=armed, bottom=guidance.bottom.known):
        return reason
    guidance.change(flight_mode)
    return ""


def manoeuvre(guidance: Guidance, request: PilotRequest) -> str:
    """Go to a depth, a heading, both, or a position; along a path; home; turn back."""
    ground = guidance.ground
    match request.kind:
        case "goto":
            return _goto(guidance, request)
        case "follow":  # from where the drone is; blind if the position is not measured
            course = request.course
            return "follow needs a path" if course is None else _follow(guidance, course)
        case "home":  # straight, at this depth or height, to where the drone was first armed
            if (place := guidance.home.place) is None:
                return guidance.home.missing
            if ground is None:
                return "this drone does not know its position"
            there = place.north, place.east
            return _follow(guidance, Course(waypoints=(ground.position, there)), there)
        case _:  # unwind: the whole turns since the start, for the tether's sake
            here = guidance.axes.yaw.at(guidance.t).position
            if (turns := whole_turns(here)) == 0:
                return "the tether has no whole turn in it"
            _prepare(guidance, hold_place=guidance.held.place, moves_depth=False)
            guidance.go(None, here - tau * turns)
            return ""


def onto_the_bottom(guidance: Guidance, depth: float | None) -> str:
    """What comes of going to a depth [m] nearer to the measured bottom than the stick leads; empty:
    it is not, or not known. Meant or not, it goes through: to land is to type a depth."""
    bottom, floor = guidance.bottom, guidance.settings.failsafe.floor_distance
    if depth is None or not bottom.known:
        return ""
    there = bottom.depth(guidance.t)
    if (height := there - depth) <= 0.0:
        return f"the bottom is at {there:.1f} m here: the drone will land on it and press down"
    return f"the drone will come to rest {height:.1f} m above the bottom" if height < floor else ""


def _goto(guidance: Guidance, request: PilotRequest) -> str:
    depth, heading, north, east = request.depth, request.heading, request.north, request.east
    if depth is not None and depth < 0:
        return f"{depth:g} m is above the surface"
    if depth is not None and (reason := _too_deep(guidance, depth)):
        return reason
    if north is not None or east is not None:  # turn on the spot, then go straight and level
        if north is None or east is None or heading is not None:
            return "goto a place needs north and east, and turns there by itself"
        if guidance.ground is None:
            return "this drone does not know its position"
        way = Course(waypoints=(guidance.ground.position, (north, east)))
        return _follow(guidance, way, (north, east), depth)
    if depth is None and heading is None:
        return "goto needs a depth or a heading"
    _prepare(guidance, hold_place=guidance.held.place, moves_depth=depth is not None)
    if heading is not None:  # the shortest turn
        here = guidance.axes.yaw.at(guidance.t).position
        heading = here + wrapped(heading - here)
    guidance.go(depth, heading)
    return ""


def _follow(
    guidance: Guidance, course: Course, goal: Pair | None = None, depth: float | None = None
) -> str:
    try:
        planned = PlannedPath(course)
    except ValueError as error:
        return f"this is no path: {error}"
    has_depth = planned.first_depth is not None
    if has_depth and (reason := _too_deep(guidance, max(planned.path.depths))):
        return reason
    measured = guidance.ground is not None
    offset = 0.0 if guidance.state is None else north_offset(guidance.state)
    _prepare(guidance, hold_place=measured, moves_depth=has_depth or depth is not None)
    if goal is not None and not guidance.held.height:
        guidance.flight_mode = "station_keeping"  # there it stays, whatever the current
    guidance.plan(planned, measured=measured, offset=offset, goal=goal)
    if depth is not None:
        guidance.axes.go_to_depth(depth, guidance.t)
    return ""


def _too_deep(guidance: Guidance, depth: float) -> str:
    limit = guidance.settings.failsafe.depth_limit
    return "" if depth <= limit else f"{depth:g} m is deeper than the depth limit, {limit:g} m"


def _prepare(guidance: Guidance, *, hold_place: bool, moves_depth: bool) -> None:
    """End the current manoeuvre, and hold depth and heading for the next; or the height, where
    that leaves the depth as it is."""
    guidance.end_manoeuvre(hold_place=hold_place)
    if moves_depth or not guidance.held.height:
        guidance.flight_mode = safe(guidance.flight_mode)


def refused(request: PilotRequest, reason: str, now: Ns) -> PilotAnswer:
    """The answer to a request that is not carried out."""
    return PilotAnswer(
        stamp_ns=now, id=request.id, accepted=False, reason=reason, cause_ns=request.stamp_ns
    )


class PilotOutputs:
    """The laws:

    1. A dimmer or switch has the value of the newest request that was granted.
    2. One with `off_after` is off while the drone is disarmed, and goes off once there has been no
       pilot for so long. It stays off until it is asked for again.
    3. A gripper moves only while fresh commands of a present pilot say so, and the drone is armed
       and obeys the sticks. After any gap it moves again once it was let go: a button that was
       held through a loss moves nothing.
    """

    def __init__(self, outputs: tuple[Output, ...], values: Mapping[str, float], now: Ns) -> None:
        """`values`: of dimmers and switches, from a checkpoint."""
        self._outputs = outputs
        self._values = {o.name: values.get(o.name, 0.0) for o in outputs if o.kind != "gripper"}
        self._asked_ns = dict[str, Ns]()  # stamp of the newest request that was granted
        self._pilot_ns = now  # when a pilot was there last
        self._gripper_of = gripper_of(outputs)
        self._let_go = False  # the pilot has released the gripper since the last gap
        self.gripper = 0.0  # [-] now

    @property
    def values(self) -> Outputs:
        """Of dimmers and switches, by name."""
        return dict(self._values)

    @property
    def all(self) -> Outputs:
        """Of every output, by name."""
        held = {} if self._gripper_of is None else {self._gripper_of.name: self.gripper}
        return self._values | held

    @property
    def light(self) -> float:
        return self._values.get(LIGHT, 0.0)

    def set(self, request: PilotRequest, now: Ns, *, armed: bool) -> str:
        """A request of kind output or light. Returns why it is refused, or nothing."""
        name = LIGHT if request.kind == "light" else request.output
        if reason := refusal(self._outputs, name, request.value, armed=armed):
            return reason
        asked_ns = min(request.stamp_ns, now)
        if asked_ns < self._asked_ns.get(name, asked_ns):
            return f"a newer request has set {name}"
        self._asked_ns[name] = asked_ns
        self._values[name] = request.value or 0.0
        return ""

    def disarm(self) -> None:
        """What is on only while the drone is armed goes off, and the gripper stands still."""
        self._values |= {o.name: 0.0 for o in self._outputs if o.off_after is not None}
        self.gripper, self._let_go = 0.0, False

    def step(self, command: PilotCommand | None, now: Ns, *, armed: bool, free: bool) -> None:
        """
        Args:
            command: the newest fresh one.
            free: the drone obeys the sticks.
        """
        present = command is not None and command.pilot == "present"
        if present:
            self._pilot_ns = now
        if not armed:
            self.disarm()
        for output in self._outputs:
            if output.off_after is not None and now - self._pilot_ns > output.off_after * 1e9:
                self._values[output.name] = 0.0
        asked = command.gripper if command is not None and present and free else None
        self._let_go = asked is not None and (self._let_go or asked == 0.0)
        obeys = self._let_go and self._gripper_of is not None
        self.gripper = asked if obeys and asked is not None else 0.0
