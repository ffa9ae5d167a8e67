"""Every stamp of a message is moved, and nothing else is touched."""

from typing import Any, cast

import msgspec
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from msgspec import inspect

from messages import topics
from messages.message import Message
from messages.topic import Direction
from messages.units import DURATION, STAMP, DurationNs, Stamp, Text
from services.runtime.node.clock_offset import mover
from tests.support.messages import values

SHIFTS = st.integers(-(10**15), 10**15)


class Several(Message, frozen=True, kw_only=True):
    """Stamps at all places where one may stand."""

    maybe_ns: Stamp | None = None
    lasted_ns: DurationNs = 9
    text: Text = ""


def is_stamp(kind: inspect.Type) -> bool:
    return isinstance(kind, inspect.Metadata) and kind.extra == STAMP


def holds_stamps(kind: inspect.Type) -> bool:
    """Somewhere, however deep."""
    match kind:
        case inspect.Metadata():
            return kind.extra == STAMP or holds_stamps(kind.type)
        case inspect.UnionType():
            return any(map(holds_stamps, kind.types))
        case inspect.TupleType():
            return any(map(holds_stamps, kind.item_types))
        case inspect.VarTupleType() | inspect.ListType():
            return holds_stamps(kind.item_type)
        case inspect.DictType():
            return holds_stamps(kind.value_type)
        case inspect.StructType():
            return any(holds_stamps(field.type) for field in kind.fields)
        case _:
            return False


def expected(kind: inspect.StructType, data: dict[str, Any], ahead: int) -> dict[str, Any]:
    """Plain data with the stamps moved."""
    stamps = {
        field.encode_name
        for field in kind.fields
        if is_stamp(field.type)
        or (isinstance(field.type, inspect.UnionType) and any(map(is_stamp, field.type.types)))
    }
    return {
        name: value - ahead if name in stamps and value is not None else value
        for name, value in data.items()
    }


def plain(message: Message) -> Any:
    return msgspec.json.decode(msgspec.json.encode(message))


def kinds() -> list[type[Message]]:
    return [*dict.fromkeys(topic.message for topic in topics.ALL), Several]


@pytest.mark.parametrize("kind", kinds(), ids=lambda kind: kind.__name__)
@given(st.data(), SHIFTS)
@settings(max_examples=20, deadline=None)
def test_every_stamp_is_moved_and_nothing_else(
    kind: type[Message], data: st.DataObject, ahead: int
) -> None:
    info = inspect.type_info(kind)
    assert isinstance(info, inspect.StructType)
    sent = msgspec.convert(data.draw(values(info)), kind)
    before = plain(sent)
    mover(kind)(sent, ahead)
    assert plain(sent) == expected(info, before, ahead)
    mover(kind)(sent, -ahead)
    assert plain(sent) == before


def test_no_message_whose_clock_is_converted_has_a_stamp_deeper_than_a_field() -> None:
    """The link's status holds the sounder's newest word, and crosses in both directions: it is not
    converted."""
    deeper = {
        topic.key
        for topic in topics.ALL
        for field in cast(inspect.StructType, inspect.type_info(topic.message)).fields
        if holds_stamps(field.type)
        and not is_stamp(field.type)
        and not (isinstance(field.type, inspect.UnionType) and any(map(is_stamp, field.type.types)))
    }
    assert deeper == {topics.LINK.key}
    assert topics.LINK.way is Direction.BOTH


def whole_numbers(kind: inspect.Type, name: str = "") -> list[tuple[str, inspect.Type]]:
    """Every whole number within a type, with the name of its field."""
    match kind:
        case inspect.IntType():
            return [(name, kind)]
        case inspect.Metadata():
            return [(name, kind)]
        case inspect.UnionType():
            return [found for each in kind.types for found in whole_numbers(each, name)]
        case inspect.TupleType():
            return [found for each in kind.item_types for found in whole_numbers(each, name)]
        case inspect.VarTupleType() | inspect.ListType():
            return whole_numbers(kind.item_type, name)
        case inspect.DictType():
            return whole_numbers(kind.value_type, name)
        case inspect.StructType():
            return [found for f in kind.fields for found in whole_numbers(f.type, f.name)]
        case _:
            return []


def test_nanoseconds_say_whether_they_are_a_moment_or_a_duration() -> None:
    for topic in topics.ALL:
        numbers = whole_numbers(inspect.type_info(topic.message))
        assert ("stamp_ns", inspect.type_info(Stamp)) in numbers
        for name, kind in numbers:
            told = isinstance(kind, inspect.Metadata) and kind.extra in (STAMP, DURATION)
            assert told == name.endswith("_ns"), name
