"""Writes the ways of several drones as one rerun recording."""

from collections.abc import Sequence

import numpy as np
import rerun as rr
import rerun.blueprint as rrb

from services.visualizer.blueprint import TIMELINE
from services.visualizer.fleet_scene import COLOURS, FlownTrack, entities

WIDTH = -1.75  # [screen points] of a line; in rerun a negative radius


def encoded(tracks: Sequence[FlownTrack]) -> bytes:
    """The file's bytes."""
    recording = rr.RecordingStream("lindy")
    stream = recording.binary_stream()
    recording.send_blueprint(rrb.Blueprint(rrb.Spatial3DView(origin="world"), auto_views=False))
    recording.log("world", rr.ViewCoordinates.FRD, static=True)
    began = min((track.poses[0].time for track in tracks if track.poses), default=0)
    for number, (path, track) in enumerate(zip(entities(tracks), tracks, strict=True)):
        _drone(recording, path, track, COLOURS[number % len(COLOURS)], began)
    return stream.read() or b""


def _drone(
    recording: rr.RecordingStream, path: str, track: FlownTrack, rgb: int, began: int
) -> None:
    colour = rgb << 8 | 0xFF
    half = (track.size[0] / 2, track.size[1] / 2, track.size[2] / 2)
    hull = rr.Boxes3D(half_sizes=[half], colors=[colour], labels=[track.name], fill_mode="solid")
    recording.log(f"{path}/vehicle/hull", hull, static=True)
    if not track.poses:
        return
    places = [pose.position for pose in track.poses]
    recording.log(
        f"{path}/path", rr.LineStrips3D([places], colors=[colour], radii=[WIDTH]), static=True
    )
    times = np.array([pose.time - began for pose in track.poses], "timedelta64[ns]")
    turns = [(x, y, z, w) for w, x, y, z in (pose.attitude for pose in track.poses)]
    recording.send_columns(
        f"{path}/vehicle",
        [rr.TimeColumn(TIMELINE, duration=times)],
        rr.Transform3D.columns(translation=places, quaternion=turns),
    )
