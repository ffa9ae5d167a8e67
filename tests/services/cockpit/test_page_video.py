"""Which of the camera's pictures a page is sent: whatever is lost or slow, it can decode them."""

from typing import NamedTuple

from hypothesis import given
from hypothesis import strategies as st

from messages.events import Outbox
from messages.video import VideoPart
from services.cockpit.video import (
    HEADER,
    KEYFRAME,
    LATE_NS,
    MOST_KEPT,
    VERSION,
    PageUnit,
    PageVideo,
    PictureStream,
    RecentUnits,
)

MS = 1_000_000  # [ns]


class Sent(NamedTuple):
    parts: int
    keyframe: bool
    lost: frozenset[int]  # its parts that do not arrive


pictures = st.lists(
    st.builds(
        Sent,
        parts=st.integers(1, 3),
        keyframe=st.booleans(),
        lost=st.frozensets(st.integers(0, 2), max_size=1) | st.just(frozenset[int]()),
    ),
    max_size=40,
)


def parts_of(sent: list[Sent]) -> list[VideoPart]:
    """What arrives. The data of a picture is its number."""
    arriving = list[VideoPart | None]()
    for number, picture in enumerate(sent):
        for part in range(picture.parts):
            message = VideoPart(
                seq=len(arriving), stamp_ns=1000 + number * 40 * MS, picture=number,
                keyframe=picture.keyframe, part=part, parts=picture.parts,
                width=64, height=64, captured_ns=0, encoded_ns=0,
                budget_kbit=100.0, data=bytes([number, part]),
            )  # fmt: skip
            arriving.append(None if part in picture.lost else message)
    return [message for message in arriving if message is not None]


@given(pictures)
def test_only_what_can_be_decoded_is_sent_and_all_of_it(sent: list[Sent]):
    stream = PictureStream(Outbox())
    units = [unit for part in parts_of(sent) if (unit := stream.take(part)) is not None]
    wanted, decodable = list[int](), False
    for number, picture in enumerate(sent):
        whole = not any(part < picture.parts for part in picture.lost)
        decodable = whole and (decodable or picture.keyframe)
        if decodable:
            wanted.append(number)
    assert [unit.message[HEADER.size] for unit in units] == wanted
    assert [unit.number for unit in units] == list(range(1, len(units) + 1))


def test_a_message_says_when_the_light_arrived():
    stream = PictureStream(Outbox())
    (part,) = parts_of([Sent(1, True, frozenset())])
    unit = stream.take(part)
    assert unit is not None
    version, flags, number, light_ms = HEADER.unpack_from(unit.message)
    assert (version, flags, number, light_ms) == (VERSION, KEYFRAME, 1, 0.001)
    assert unit.message[HEADER.size :] == part.data


# A page that confirms what it was sent so much later [ms], and how long until the next picture.
steps = st.lists(st.tuples(st.booleans(), st.integers(0, 1500), st.integers(5, 100)), max_size=150)


@given(steps)
def test_nothing_waits_for_a_slow_page_and_what_it_gets_it_can_decode(
    steps: list[tuple[bool, int, int]],
):
    page, now = PageVideo(), 0
    due = list[tuple[int, int]]()  # when which number is confirmed; in order, as over TCP
    last, sent_at = 0, dict[int, int]()  # the newest picture that it was sent; when, by number
    for number, (keyframe, takes, pause) in enumerate(steps, 1):
        while due and due[0][0] <= now:
            assert page.confirmed(due.pop(0)[1])
        oldest = due[0][1] if due else None
        admitted = page.admits(PageUnit(number, keyframe, b""), now)
        if admitted:
            assert keyframe or number == last + 1
            assert oldest is None or sent_at[oldest] + LATE_NS >= now
        else:
            assert not keyframe or (oldest is not None and sent_at[oldest] + LATE_NS < now)
        if admitted:
            last, sent_at[number] = number, now
            due.append((max([now + takes * MS, *(at for at, _ in due)]), number))
        now += pause * MS
    assert not page.confirmed(len(steps) + 1)


def test_a_page_that_confirms_in_time_gets_every_picture_after_the_first_keyframe():
    page = PageVideo()
    got = list[int]()
    for number in range(1, 101):
        if page.admits(PageUnit(number, number % 50 == 5, b""), number * 40 * MS):
            got.append(number)
        if got and number > got[0] + 10:
            assert page.confirmed(number - 10)  # 0.4 s later
    assert got == list(range(5, 101))


def test_a_page_that_is_opened_gets_what_there_is_since_the_keyframe():
    recent = RecentUnits()
    for number, keyframe in enumerate((False, True, False, True, False, False), 1):
        recent.add(PageUnit(number, keyframe, b"x"))
    assert [unit.number for unit in recent] == [4, 5, 6]
    recent.add(PageUnit(7, False, bytes(MOST_KEPT)))
    recent.add(PageUnit(8, False, b"x"))
    assert not list(recent)
    recent.add(PageUnit(9, True, b"x"))
    assert [unit.number for unit in recent] == [9]
