"""Several cameras of one drone, by name, and the streams of each.

The first camera has the keys that it had when it was the only one, `camera/video` and `camera/age`,
so that recordings, bags and programs from then are read without a change. Each further camera is a
member of a family: `camera/video/down`, `camera/age/down`.
"""

import re
from collections.abc import Iterable

from messages import topics
from messages.topic import Topic
from messages.video import PictureAge, VideoPart

FIRST = "front"  # name of the first camera
ALL = "all"  # no camera can have this name: it means every one of them
# Of one drone. Each is coded by a process of its own and decoded on every page; beside the large
# picture of a phone there is room for three small ones.
MOST = 4
NAME = re.compile(r"[a-z][a-z0-9_]{0,15}")


def mistake(further: Iterable[str]) -> str:
    """Why further cameras cannot have these names; empty: they can."""
    names = list(further)
    for name in names:
        if name in (FIRST, ALL):
            taken = "the first camera has it" if name == FIRST else "it means every camera"
            return f"a further camera cannot be called {name!r}: {taken}"
        if NAME.fullmatch(name) is None:
            return (
                f"a camera cannot be called {name!r}; allowed are a to z, 0 to 9 and _, from a "
                f"letter on, at most 16 of them"
            )
    if len(names) >= MOST:
        return f"there are {len(names) + 1} cameras; allowed are {MOST}, with the first one"
    return ""


def video(camera: str) -> Topic[VideoPart]:
    return topics.VIDEO if camera == FIRST else topics.FURTHER_VIDEO.of(camera)


def age(camera: str) -> Topic[PictureAge]:
    return topics.PICTURE_AGE if camera == FIRST else topics.FURTHER_AGE.of(camera)


def camera_of(key: str) -> str | None:
    """Whose video or age has this key; None: no camera's."""
    if key in (topics.VIDEO.key, topics.PICTURE_AGE.key):
        return FIRST
    further = topics.FURTHER_VIDEO.covers(key) or topics.FURTHER_AGE.covers(key)
    return key.rpartition("/")[2] if further else None


def called(camera: str, *, several: bool) -> str:
    """In a sentence: `camera` where there is one only, else such as `down camera`."""
    return f"{camera.replace('_', ' ')} camera" if several else "camera"
