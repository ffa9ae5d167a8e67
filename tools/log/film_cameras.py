"""Whose pictures of a recording are wanted."""

from typing import Annotated

from cyclopts import Parameter

from messages import cameras
from services.runtime.config.errors import LindyError
from services.runtime.config.settings import nearest
from tools.log.film_scenes import filmed_cameras
from tools.recordings.recording import Recording

Camera = Annotated[
    str, Parameter(help="of this camera, or `all`; default: the one that was large the longest")
]


def chosen(recording: Recording, camera: str = "") -> list[str]:
    """The cameras that are meant; the one that was large for the longest first.

    Args:
        camera: its name, `all`, or empty: the default.

    Raises:
        LindyError: the recording is empty, has no pictures, or none of this camera.
    """
    recording.require_messages()
    there = filmed_cameras(recording)
    if not there:
        raise LindyError(f"{recording.files[0]} holds no pictures")
    if camera in ("", cameras.ALL):
        return there
    if camera not in there:
        known = sorted(there)
        raise LindyError(
            f"{recording.files[0]} holds no pictures of {camera!r}{nearest(camera, known)}"
        )
    return [camera]
