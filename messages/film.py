"""What the pilot films: marks in the recording, which has every picture anyway. From the pilot's
page; the recorder on board answers whether it records."""

from typing import Literal

from messages.message import Answer, Request
from messages.units import Name, Stamp, Text

FilmKind = Literal["begin", "end", "snapshot"]


class FilmRequest(Request, frozen=True, kw_only=True):
    """Repeated with the same id until a `FilmAnswer` names that id."""

    kind: FilmKind
    light_ns: Stamp  # [ns] stamp of the newest picture that the pages had been sent
    source: Name = ""  # who films
    camera: Name = ""  # of which camera; empty: there is one only


class FilmAnswer(Answer, frozen=True, kw_only=True):
    """`accepted`: the recorder on board has the request, and the pictures about it."""

    reason: Text = ""  # why it records nothing now
