"""Writes batches to a rerun recording. With `blueprint.py`, the only code that imports rerun."""

from collections.abc import Iterable
from itertools import chain
from math import cos, sin
from typing import get_args

import numpy as np
import numpy.typing as npt
import rerun as rr

from messages.cameras import FIRST
from messages.units import Quaternion, Vec3
from messages.vehicle import Failsafe
from services.marine.vehicle import Vehicle
from services.visualizer.batch import (
    Batch,
    CurveColumns,
    Frame,
    Note,
    VideoSample,
    joined_columns,
)
from services.visualizer.blueprint import TIMELINE, blueprint, camera_path
from services.visualizer.curves import MANY, PREDICTED, REFERENCE, Look, curves
from services.visualizer.io.live_viewer import LiveViewer
from services.visualizer.io.rrd_file import RrdFile

METRES_PER_NEWTON = 0.04  # length of a thruster's arrow in the scene
HULL, NOSE, FORCE, PATH, PLUMB = 0x4CA6FFFF, 0xF4F7FAFF, 0xFF5A4EFF, 0x38D6C0FF, 0x7FA8C4FF
SURFACE, SAND, SAND_LINES = 0x3A86A8FF, 0x4A4230FF, 0x6B6046FF
FILL = "transparentfillmajorwireframe"  # the thrusters' arrows begin inside the hull
GRID_HALF = 30  # [m] half the side of surface and floor around the vehicle
TIME = "timedelta64[ns]"
LEVELS = {"info": rr.TextLogLevel.INFO, "warning": "WARN", "error": rr.TextLogLevel.ERROR}

QUIET, GOOD, ACTIVE, CAUTION, ALARM = 0x4A5560FF, 0x2E7D5BFF, 0x2F6DB5FF, 0xC77F1AFF, 0xC23B3BFF
BY_ITSELF = 0x7A55B8FF
HOLDING = ("depth hold", "heading hold", "stabilised", "station keeping")
STATES: dict[str, dict[str, int]] = {
    "activity": {"starting": QUIET, "ready": GOOD, "piloted": ACTIVE, "stopping": CAUTION}
    | {"goto": BY_ITSELF, "follow": BY_ITSELF},
    "flight_mode": dict.fromkeys(HOLDING, ACTIVE) | {"manual": CAUTION},
    "armed": {"disarmed": QUIET, "armed": CAUTION},
    "failsafe": dict.fromkeys(get_args(Failsafe), ALARM) | {"no failsafe": GOOD},
    "pilot": {"pilot present": GOOD, "pilot lost": ALARM},
    "link": {"link up": GOOD, "link down": ALARM},
    "thrusters": {"stopped": QUIET, "driven": ACTIVE},
    "estimator": {"calibrating": CAUTION, "running": GOOD},
    "floor": {"free": GOOD, "on the floor": CAUTION},
}


class RerunWriter:
    """One recording: a file, or a live viewer."""

    def __init__(self, recording_id: str, vehicle: Vehicle) -> None:
        self._rec = rr.RecordingStream("lindy", recording_id=recording_id)
        self._vehicle = vehicle
        # Bytes, not rerun's own file: that keeps an index in memory until the end.
        self._bytes = self._rec.binary_stream()  # encoded, not yet written …
        self._to: RrdFile | LiveViewer | None = None  # … there
        self._times: list[int] = []  # [ns] of the columns written last …
        self._when = np.array([], TIME)  # … and as an array
        named = [curve for curve in curves(vehicle) if curve.look.names]
        self._looks = [curve.look for curve in named if not curve.topic.is_family]
        self._families = {curve.path: curve.look for curve in named if curve.topic.is_family}
        self._styled = {look.path for look in self._looks}
        self._cameras: list[str] = []  # of which a picture has been written
        self._services: dict[str, int] = {}  # colour of each, in every panel

    def save(self, to: RrdFile | LiveViewer) -> None:
        """Write there from here on.

        Raises:
            OSError: its beginning cannot be written.
            ValueError: as of `index_at`.
        """
        self._prepare()
        to.begin(self._bytes.read() or b"")
        self._to = to

    def write(self, *batches: Batch) -> None:
        """Write batches that follow each other. Many at once are smaller and cheaper."""
        for columns in joined_columns(batches):
            self._columns(columns)
        if frames := [frame for batch in batches for frame in batch.frames]:
            self._frames(frames)
        if video := [sample for batch in batches for sample in batch.video]:
            self._film(video)
        for batch in batches:
            for note in batch.notes:
                self._note(note)
            if batch.trail:
                self._at(batch.trail_time)
                self._rec.log("world/path", rr.LineStrips3D.from_fields(strips=[batch.trail]))
            if batch.floor is not None:
                self._floor(batch.floor)
        self._write_bytes()

    def close(self) -> None:
        """Write everything out and end the recording."""
        self._rec.flush(timeout_sec=5.0)
        self._write_bytes()
        self._rec.disconnect()
        if self._to is not None:
            self._to.close()

    def _write_bytes(self) -> None:
        if self._to is not None and (data := self._bytes.read()):
            self._to.append(data)

    def _columns(self, columns: CurveColumns) -> None:
        # A third of the time of np.array(rows), which inspects the shape of every row.
        values = np.fromiter(chain.from_iterable(columns.rows), np.float64)
        if columns.path not in self._styled:
            self._style_member(columns.path)
        values = values.reshape(len(columns.rows), -1)
        if columns.times != self._times:  # most curves of one message share theirs
            self._times, self._when = columns.times, np.array(columns.times, TIME)
        kept = _bends(values)
        when = rr.TimeColumn(TIMELINE, duration=self._when[kept])
        self._rec.send_columns(columns.path, [when], rr.Scalars.columns(scalars=values[kept]))

    def _style_member(self, path: str) -> None:
        """Style the curves of a new member of a family: as the family has it, or in the colour of a
        service."""
        self._styled.add(path)
        family, _, name = path.rpartition("/")
        if (look := self._families.get(family)) is not None:
            self._static(path, _line_style(look))
            return
        rgb = self._services.setdefault(name, MANY[len(self._services) % len(MANY)])
        colours = _colours([_rgba(rgb)])
        self._static(path, rr.SeriesLines(names=[name], colors=colours, widths=[1.5]))

    def _note(self, note: Note) -> None:
        self._at(note.time)
        if note.kind == "state":
            self._rec.log(note.path, rr.StateChange(state=note.text))
        elif note.kind == "log":
            self._rec.log(note.path, rr.TextLog(note.text, level=LEVELS[note.level]))
        else:
            page = rr.TextDocument(note.text, media_type=rr.MediaType.MARKDOWN)
            self._rec.log(note.path, page)

    def _frames(self, frames: list[Frame]) -> None:
        """Send many frames at once, because each send costs as much as a hundred frames."""
        when = [_index([frame.time for frame in frames])]
        places = [frame.position for frame in frames]
        pose = rr.Transform3D.columns(
            translation=places, quaternion=[_xyzw(frame.attitude) for frame in frames]
        )
        # The grids follow in whole metres, so that they look endless and at rest.
        here = [(float(round(north)), float(round(east)), 0.0) for north, east, _ in places]
        plumbs = [[(north, east, 0.0), (north, east, depth)] for north, east, depth in places]
        self._rec.send_columns("world/vehicle", when, pose)
        self._rec.send_columns("world/chase", when, rr.Transform3D.columns(translation=places))
        self._rec.send_columns("world/here", when, rr.Transform3D.columns(translation=here))
        self._rec.send_columns("world/plumb", when, rr.LineStrips3D.columns(strips=plumbs))
        self._arrows([frame for frame in frames if frame.thrust])
        # Two ghosts: the reference where the vehicle is, at its own depth and heading, and the
        # predicted present pose, ahead of the delayed one.
        wanted = [
            (frame.time, (*frame.position[:2], frame.wanted_depth), frame.wanted_heading)
            for frame in frames
            if frame.wanted_depth is not None and frame.wanted_heading is not None
        ]
        ahead = [(f.time, f.now, f.now_heading) for f in frames if f.now is not None]
        self._level("world/reference", wanted)
        self._level("world/predicted", ahead)

    def _arrows(self, frames: list[Frame]) -> None:
        if not frames:
            return
        thrusters = self._vehicle.thruster
        vectors = [
            _times(thruster.direction, METRES_PER_NEWTON * newton)
            for frame in frames
            for thruster, newton in zip(thrusters, frame.thrust, strict=True)
        ]
        columns = rr.Arrows3D.columns(vectors=vectors).partition([len(thrusters)] * len(frames))
        self._rec.send_columns(
            "world/vehicle/thrust", [_index([frame.time for frame in frames])], columns
        )

    def _level(self, entity: str, poses: list[tuple[int, Vec3, float]]) -> None:
        """Poses without roll and pitch: time, place, heading [rad]."""
        if poses:
            times, places, headings = zip(*poses, strict=True)
            turns = [_xyzw((cos(half), 0.0, 0.0, sin(half))) for half in (h / 2 for h in headings)]
            pose = rr.Transform3D.columns(translation=places, quaternion=turns)
            self._rec.send_columns(entity, [_index(list(times))], pose)

    def _film(self, video: list[VideoSample]) -> None:
        by_camera: dict[str, list[VideoSample]] = {}
        for sample in video:
            by_camera.setdefault(sample.camera, []).append(sample)
        self._show_cameras([camera for camera in by_camera if camera not in self._cameras])
        for camera, own in by_camera.items():
            when = [_index([sample.time for sample in own])]
            samples = rr.VideoStream.columns(sample=[sample.data for sample in own])
            self._rec.send_columns(camera_path(camera), when, samples)

    def _show_cameras(self, new: list[str]) -> None:
        """Nothing is said of a camera where there is none; the layout has the first one anyway."""
        self._cameras += new
        for camera in new:
            self._static(camera_path(camera), rr.VideoStream(codec=rr.VideoCodec.H264))
        if any(camera != FIRST for camera in new):
            further = [each for each in self._cameras if each != FIRST]
            self._rec.send_blueprint(blueprint(self._vehicle, further))

    def _at(self, time: int) -> None:
        self._rec.set_time(TIMELINE, duration=np.timedelta64(time, "ns"))

    def _prepare(self) -> None:
        """Send what never changes: layout, names, colours, the hull."""
        self._rec.send_blueprint(blueprint(self._vehicle))
        for look in self._looks:
            self._static(look.path, _line_style(look))
        for lane, colours in STATES.items():
            known = rr.StateConfiguration(values=list(colours), colors=_colours(colours.values()))
            self._static(f"state/{lane}", known)
        self._prepare_scene()

    def _prepare_scene(self) -> None:
        size = self._vehicle.size
        half = (size[0] / 2, size[1] / 2, size[2] / 2)
        nose_half = (0.02, half[1] * 0.6, half[2] * 0.35)
        hull = rr.Boxes3D(half_sizes=[half], colors=[HULL], fill_mode=FILL)
        nose = rr.Boxes3D(
            centers=[(half[0], 0.0, 0.0)],
            half_sizes=[nose_half],
            colors=[NOSE],
            fill_mode="solid",
        )
        ghost, now = _frame(half, REFERENCE, 1.25), _frame(half, PREDICTED, 1.5)
        ahead = rr.Arrows3D(
            vectors=[(1.2 * size[0], 0.0, 0.0)], colors=[_rgba(REFERENCE)], radii=[0.008]
        )
        arrows = rr.Arrows3D.from_fields(
            origins=[t.position for t in self._vehicle.thruster],
            colors=[FORCE],
            radii=[0.02],
        )
        self._static("world", rr.ViewCoordinates.FRD)
        self._static("world/vehicle/hull", hull)
        self._static("world/vehicle/nose", nose)
        self._static("world/vehicle/thrust", arrows)
        self._static("world/reference/ghost", ghost)
        self._static("world/reference/ahead", ahead)
        self._static("world/predicted/ghost", now)
        self._static("world/here/surface", _grid(0.0, SURFACE))
        for path, colour, points in (("world/path", PATH, 1.75), ("world/plumb", PLUMB, 0.75)):
            width = _on_screen(points)
            self._static(path, rr.LineStrips3D.from_fields(colors=[colour], radii=[width]))

    def _floor(self, place: Vec3) -> None:
        """Draw the sea floor for the whole recording."""
        depth, half = place[2], GRID_HALF
        corners = [(-half, -half, depth), (-half, half, depth), (half, half, depth)]
        sand = rr.Mesh3D(
            vertex_positions=[*corners, (half, -half, depth)],
            triangle_indices=[(0, 1, 2), (0, 2, 3), (2, 1, 0), (3, 2, 0)],
            albedo_factor=SAND,
        )
        self._static("world/here/floor", sand)
        self._static("world/here/floor_grid", _grid(depth - 0.01, SAND_LINES))

    def _static(self, path: str, what: rr.AsComponents) -> None:
        self._rec.log(path, what, static=True)


def _bends(values: npt.NDArray[np.float64]) -> npt.NDArray[np.bool_]:
    """Which rows are not equal to both their neighbours. Without the others the same line is
    drawn, and a third of all rows is saved."""
    kept = np.ones(len(values), np.bool_)
    same = np.all(values[1:] == values[:-1], axis=1)
    kept[1:-1] = ~(same[1:] & same[:-1])
    return kept


def _index(times: list[int]) -> rr.TimeColumn:
    return rr.TimeColumn(TIMELINE, duration=np.array(times, TIME))


def _line_style(look: Look) -> rr.SeriesLines:
    return rr.SeriesLines(
        names=list(look.names),
        colors=_colours(_rgba(rgb) for rgb in look.colours),
        widths=[look.width] * len(look.names),
    )


def _grid(depth: float, colour: int) -> rr.LineStrips3D:
    """Lines a metre apart at one depth, in short pieces: rerun draws a long line with one width,
    which would be too thick at its near end."""
    sides = range(-GRID_HALF, GRID_HALF + 1)
    along = [[(x, y, depth) for x in sides] for y in sides]
    across = [[(x, y, depth) for y in sides] for x in sides]
    return rr.LineStrips3D([*along, *across], colors=[colour], radii=[_on_screen(0.5)])


def _frame(half: Vec3, rgb: int, points: float) -> rr.Boxes3D:
    """A ghost: edges only, so that the hull is seen through it."""
    return rr.Boxes3D(
        half_sizes=[half],
        colors=[_rgba(rgb)],
        radii=[_on_screen(points)],
        fill_mode="majorwireframe",
    )


def _on_screen(points: float) -> float:
    """A radius in screen points, independent of distance: in rerun a negative radius."""
    return -points


def _colours(rgba: Iterable[int]) -> npt.NDArray[np.uint32]:
    return np.array([*rgba], dtype=np.uint32)  # four plain integers would be taken for one colour


def _rgba(rgb: int) -> int:
    return rgb << 8 | 0xFF


def _xyzw(q: Quaternion) -> Quaternion:
    """rerun's order: scalar last."""
    w, x, y, z = q
    return (x, y, z, w)


def _times(vector: Vec3, factor: float) -> Vec3:
    return (vector[0] * factor, vector[1] * factor, vector[2] * factor)
