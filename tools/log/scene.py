"""`lindy log scene`: several recordings as one 3-D scene, for rerun."""

from pathlib import Path

from messages.text import harmless
from services.marine.vehicle import Vehicle
from services.runtime.config.errors import LindyError
from services.runtime.config.extras import how_to_install
from services.runtime.config.stack import BODY, Stack
from services.visualizer.fleet_scene import FlownTrack, track
from services.visualizer.scene import SCENE_KINDS
from tools.choices import NewFile
from tools.fresh import refuse_existing, write_fresh
from tools.recordings.dive_file import flown_section
from tools.recordings.recording import Recording, open_recording

COMPLETE, INCOMPLETE = 0, 3  # exit statuses


def scene(recordings: tuple[Path, ...], /, *, out: NewFile) -> int:
    """The drones of several recordings in one 3-D scene.

    RECORDINGS are dives' folders or MCAP files. The scene is a
    file for rerun. All share one time and one frame: where a drone does not know its position, it
    is drawn at (0, 0). Exit status 3: one is damaged or was not finished.

    Example: lindy log scene dives/class/rov1 dives/class/rov2 --out class.rrd
    """
    refuse_existing(out)
    try:
        from services.visualizer.io.fleet_writer import encoded
    except ModuleNotFoundError:
        raise LindyError(
            f"a scene needs rerun, which is not installed; {how_to_install('viewer')}"
        ) from None
    opened = [open_recording(path) for path in recordings]
    tracks = [track_of(recording) for recording in opened]
    write_fresh(out, encoded(tracks))
    damage = [words for recording in opened for words in recording.damage]
    lines = [f"{each.name}: {len(each.poses)} poses" for each in tracks]
    print(harmless("\n".join([*lines, f"{len(tracks)} drones in {out}", *damage])), flush=True)
    return INCOMPLETE if damage else COMPLETE


def track_of(recording: Recording) -> FlownTrack:
    """The way of the drone that was recorded."""
    about = recording.metadata("dive")
    name = about.get("drone") or about.get("vehicle") or recording.files[0].parent.name
    said = (
        (entry.log_ns, entry.message)
        for entry in recording
        if isinstance(entry.message, SCENE_KINDS)
    )
    vehicle = flown_section(recording, BODY, Vehicle) or Stack().section(BODY, Vehicle)
    return track(name, vehicle, said)
