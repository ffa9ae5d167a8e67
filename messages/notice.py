"""What a pilot has to know now, as a code with numbers: each screen makes a sentence of it."""

from typing import Annotated

import msgspec

from messages.units import Finite, Name, Names, Text

Numbers = Annotated[dict[Name, Finite], msgspec.Meta(max_length=8)]


class Notice(msgspec.Struct, frozen=True, omit_defaults=True):
    """`messages.events.told` has the English of it."""

    code: Name  # an event of the event table, such as `notice:leak`, or a code of `events.TOLD`
    numbers: Numbers = {}  # by their names, which say what they are: `events.AMOUNTS`
    about: Names = ()  # services, or events, that it is about
    more: Text = ""  # English text of what has no code


Notices = Annotated[tuple[Notice, ...], msgspec.Meta(max_length=64)]  # the gravest first
