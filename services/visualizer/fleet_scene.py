"""Several drones in one 3-D scene: the way of each, from its recording. Pure.

Every drone has a part of its own, `world/<name>`. They share one time, UTC, and one frame: north
and east are as each estimates them or the simulator tells them, (0, 0) where that is not known.
"""

from collections.abc import Iterable
from typing import NamedTuple

from messages.message import Message
from messages.units import Quaternion, Vec3
from services.marine.vehicle import Vehicle
from services.visualizer.scene import Scene

STEP_NS = 100_000_000  # between two poses
COLOURS = (
    *(0x4CA6FF, 0xFFB347, 0x7BD389, 0xE07BE0, 0xFF6F61, 0x38D6C0, 0xF2E26B, 0x9D8DF1),
)  # of the drones, one after the other


class TrackPose(NamedTuple):
    time: int  # [ns] UTC
    position: Vec3  # [m] NED
    attitude: Quaternion  # [-] q_NB as w, x, y, z


class FlownTrack(NamedTuple):
    """The way of one drone."""

    name: str
    size: Vec3  # [m] of its hull: length, width, height
    poses: list[TrackPose]


def track(name: str, vehicle: Vehicle, said: Iterable[tuple[int, Message]]) -> FlownTrack:
    """
    Args:
        said: time [ns] UTC and message, in their order.
    """
    scene, poses, due = Scene(vehicle), list[TrackPose](), 0
    for time, message in said:
        scene.hear(message)
        if time < due:
            continue
        if (frame := scene.frame(0)) is not None:
            due = time + STEP_NS
            poses.append(TrackPose(time, frame.position, frame.attitude))
    length, width, height = vehicle.size
    return FlownTrack(name, (length, width, height), poses)


def entity(name: str) -> str:
    """Its part of the scene; a path's own signs are not taken for parts of it."""
    kept = "".join(letter if letter.isalnum() or letter in "_-" else "_" for letter in name)
    return f"world/{kept or '_'}"


def entities(tracks: Iterable[FlownTrack]) -> list[str]:
    """Of each, and no two the same."""
    found: list[str] = []
    for each in tracks:
        path, number = entity(each.name), 2
        while path in found:
            path, number = f"{entity(each.name)}_{number}", number + 1
        found.append(path)
    return found
