"""The 3-D scene in Foxglove's types: frames, hull and thrusters as simple primitives.

Foxglove draws with z upwards (x east, y north, z up: ENU). Lindy's numbers stay as they are, NED
and FRD: the frame `ned` is a child of the root `world`, turned by half a revolution about the
horizontal line to the north-east, and Foxglove turns everything that is drawn in it.
"""

from collections.abc import Iterable
from math import cos, hypot, sin, sqrt
from typing import Any

from messages.reference import Reference
from messages.state import VehicleState
from messages.units import Quaternion, Vec3
from messages.vehicle import Truth
from services.marine.vehicle import Vehicle

WORLD, NED, VEHICLE, REFERENCE, TRUTH = "world", "ned", "vehicle", "reference", "truth"
HALF = sqrt(0.5)
NED_IN_WORLD: Quaternion = (0.0, HALF, HALF, 0.0)  # x of ned (north) is y of world, z is -z
LEVEL: Quaternion = (1.0, 0.0, 0.0, 0.0)
ORIGIN: Vec3 = (0.0, 0.0, 0.0)
METRES_PER_NEWTON = 0.04  # length of a thruster's arrow, as in the viewer
SHORTEST = 0.5  # [N] a smaller thrust has no arrow
HULL, NOSE = (0.95, 0.75, 0.2, 1.0), (0.2, 0.2, 0.2, 1.0)
COLOURS = {REFERENCE: (0.2, 0.8, 0.4, 0.35), TRUTH: (1.0, 1.0, 1.0, 0.35)}
ARROW = (0.9, 0.3, 0.2, 1.0)
FOR_EVER = {"sec": 0, "nsec": 0}

Json = dict[str, Any]


def time(utc_ns: int) -> Json:
    return {"sec": utc_ns // 10**9, "nsec": utc_ns % 10**9}


def state_is_known(state: VehicleState) -> bool:
    """Is there a depth to draw the vehicle at?"""
    return state.phase == "running" and state.depth.valid


def place(state: VehicleState) -> Vec3:
    """[m] NED; at the surface point (0, 0) as long as nobody knows north and east."""
    if state.north is None or state.east is None:
        return (0.0, 0.0, state.depth.value)
    return (state.north.value, state.east.value, state.depth.value)


def pose(position: Vec3, attitude: Quaternion) -> Json:
    return {"position": _vector(position), "orientation": _quaternion(attitude)}


def transforms(
    utc_ns: int, state: VehicleState, reference: Reference | None, truth: Truth | None
) -> Json:
    """`foxglove.FrameTransforms`: the tree of frames. The root is in every message, so that whoever
    begins to watch in mid-dive has all of it."""
    here = place(state)
    frames = [(WORLD, NED, ORIGIN, NED_IN_WORLD), (NED, VEHICLE, here, state.attitude)]
    if reference is not None:
        wanted = (here[0], here[1], reference.depth.position)
        half = reference.heading.position / 2
        frames.append((NED, REFERENCE, wanted, (cos(half), 0.0, 0.0, sin(half))))
    if truth is not None:
        frames.append((NED, TRUTH, truth.position, truth.attitude))
    when = time(utc_ns)
    return {
        "transforms": [
            {
                "timestamp": when,
                "parent_frame_id": parent,
                "child_frame_id": child,
                "translation": _vector(position),
                "rotation": _quaternion(attitude),
            }
            for parent, child, position, attitude in frames
        ]
    }


def hulls(utc_ns: int, vehicle: Vehicle, ghosts: Iterable[str]) -> Json:
    """`foxglove.SceneUpdate`: the vehicle as a box with a darker nose, and translucent boxes where
    the reference and the simulator's truth are.

    Args:
        ghosts: frames that are known.
    """
    length, width, height = vehicle.size
    nose = _cube((length / 2, 0.0, 0.0), (0.04, 0.6 * width, 0.35 * height), NOSE)
    hull = [_cube(ORIGIN, vehicle.size, HULL), nose]
    entities = [_entity(utc_ns, VEHICLE, "hull", cubes=hull)]
    for frame in ghosts:
        ghost = [_cube(ORIGIN, vehicle.size, COLOURS[frame])]
        entities.append(_entity(utc_ns, frame, frame, cubes=ghost))
    return {"deletions": [], "entities": entities}


def thrust_arrows(utc_ns: int, vehicle: Vehicle, thrust: Iterable[float]) -> Json:
    """`foxglove.SceneUpdate`: an arrow for the thrust [N] of each thruster."""
    arrows = [
        _arrow(thruster.position, thruster.direction, newton)
        for thruster, newton in zip(vehicle.thruster, thrust, strict=True)
        if abs(newton) >= SHORTEST
    ]
    return {"deletions": [], "entities": [_entity(utc_ns, VEHICLE, "thrust", arrows=arrows)]}


def along(direction: Vec3) -> Quaternion:
    """The rotation that turns the x axis into a direction, which need not be normalised; none where
    it has no length."""
    length = hypot(*direction)
    if length < 1e-9:
        return LEVEL
    x, y, z = (part / length for part in direction)
    if x < -1.0 + 1e-9:
        return (0.0, 0.0, 0.0, 1.0)  # half a revolution, about any axis across
    w = sqrt((1.0 + x) / 2)  # half-angle formulas; the axis is x × direction = (0, -z, y)
    return (w, 0.0, -z / (2 * w), y / (2 * w))


def _arrow(position: Vec3, direction: Vec3, newton: float) -> Json:
    dx, dy, dz = direction
    forwards = direction if newton > 0 else (-dx, -dy, -dz)
    return {
        "pose": pose(position, along(forwards)),
        "shaft_length": METRES_PER_NEWTON * abs(newton),
        "shaft_diameter": 0.02,
        "head_length": 0.05,
        "head_diameter": 0.05,
        "color": _colour(ARROW),
    }


def _entity(
    utc_ns: int, frame: str, name: str, *, cubes: Iterable[Json] = (), arrows: Iterable[Json] = ()
) -> Json:
    nothing: dict[str, list[Json]] = {
        kind: [] for kind in ("spheres", "cylinders", "lines", "triangles", "texts", "models")
    }
    return {
        "timestamp": time(utc_ns),
        "frame_id": frame,
        "id": name,
        "lifetime": FOR_EVER,
        "frame_locked": True,  # it moves with its frame
        "metadata": [],
        "arrows": arrows,
        "cubes": cubes,
        **nothing,
    }


def _cube(position: Vec3, size: Vec3, colour: Quaternion) -> Json:
    return {"pose": pose(position, LEVEL), "size": _vector(size), "color": _colour(colour)}


def _vector(v: Vec3) -> Json:
    return {"x": v[0], "y": v[1], "z": v[2]}


def _quaternion(q: Quaternion) -> Json:
    """Foxglove names the parts, so the order does not matter."""
    return {"w": q[0], "x": q[1], "y": q[2], "z": q[3]}


def _colour(rgba: tuple[float, float, float, float]) -> Json:
    return {"r": rgba[0], "g": rgba[1], "b": rgba[2], "a": rgba[3]}
