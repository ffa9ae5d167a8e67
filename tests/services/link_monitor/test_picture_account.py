"""Pictures arrive whole or not at all, and their age is that of their light."""

import msgspec
import pytest
from hypothesis import given
from hypothesis import strategies as st

from messages.events import Outbox
from messages.units import Ns
from messages.video import HEADERS, PICTURE_STAGES, Assembler, VideoPart
from services.link_monitor.picture_account import Carried, PictureAccount

MS, S = 1_000_000, 1_000_000_000


def parts(picture: int, *, number: int = 4, keyframe: bool = True) -> list[VideoPart]:
    light = picture * 40 * MS
    return [
        VideoPart(
            seq=picture * number + part, stamp_ns=light, picture=picture, keyframe=keyframe,
            exact=True, part=part, parts=number, width=640, height=360, captured_ns=light + 3 * MS,
            encoded_ns=light + 5 * MS, budget_kbit=300.0, data=bytes([picture, part]) * 500,
        )
        for part in range(number)
    ]  # fmt: skip


def arrive(account: PictureAccount, sent: list[VideoPart], now: Ns, apart: Ns = MS) -> Ns:
    for part in sent:
        now += apart
        account.take(part, now)
    return now


@given(st.permutations(range(4)), st.integers(1, 8))
def test_parts_in_any_order_are_the_access_unit(order: list[int], twice: int) -> None:
    sent = parts(1)
    assembler = Assembler()
    units = [assembler.take(sent[k]) for k in [*order[:twice], *order]]
    whole = [unit for unit in units if unit is not None]
    assert [unit.data for unit in whole] == [b"".join(part.data for part in sent)]


@given(st.lists(st.tuples(st.integers(0, 5), st.integers(0, 3)), max_size=40))
def test_of_a_picture_that_is_not_whole_nothing_is_used(arrivals: list[tuple[int, int]]) -> None:
    assembler = Assembler()
    for picture, part in arrivals:
        unit = assembler.take(parts(picture)[part])
        if unit is not None:
            about = unit.about.picture
            assert unit.data == b"".join(each.data for each in parts(about))


@given(st.integers(0, 255), st.integers(1, 256), st.binary(max_size=50))
def test_absurd_parts_are_no_picture_and_end_nothing(part: int, number: int, data: bytes) -> None:
    assembler = Assembler()
    absurd = msgspec.structs.replace(parts(1)[0], part=part, parts=number, data=data)
    unit = assembler.take(absurd)
    assert unit is None or (number == 1 and unit.data == data)


def test_the_stages_add_up_to_the_age() -> None:
    account = PictureAccount(Outbox())
    arrive(account, parts(1), 40 * MS + 20 * MS)
    said = account.report(200 * MS)
    assert said.stages is not None
    assert said.total is not None
    assert [stage.name for stage in said.stages] == list(PICTURE_STAGES)
    assert [stage.p50_ms for stage in said.stages] == [3.0, 2.0, 19.0]
    assert said.total.p50_ms == sum(stage.p50_ms for stage in said.stages)
    assert said.age_ms == 160.0


def test_the_age_grows_while_nothing_arrives() -> None:
    account = PictureAccount(Outbox())
    assert not account.begun
    arrive(account, parts(1), 50 * MS)
    ages = [account.report(k * S).age_ms or 0.0 for k in range(1, 5)]
    assert ages == sorted(ages)
    assert ages[-1] - ages[0] == 3000.0


@pytest.mark.parametrize("kbit", [100.0, 1000.0, 20_000.0])
def test_the_room_is_the_pace_of_the_parts(kbit: float) -> None:
    account, apart = PictureAccount(Outbox()), round((1000 + HEADERS) * 8e6 / kbit)
    arrive(account, parts(1), 50 * MS, apart)
    room = account.report(10 * S).room_kbit
    assert room == pytest.approx(kbit, rel=0.01)


def test_after_a_lost_part_it_waits_for_a_keyframe_and_asks_for_it() -> None:
    account = PictureAccount(Outbox())
    now = arrive(account, parts(1), 50 * MS)
    assert not account.report(now).keyframe_wanted
    now = arrive(account, parts(2, keyframe=False)[:2], now)
    now = arrive(account, parts(3, keyframe=False), now)
    said = account.report(now)
    assert said.keyframe_wanted
    assert said.lost == pytest.approx(2 / 8)
    assert said.total is None
    arrive(account, parts(4), now)
    assert not account.report(now + S).keyframe_wanted


@given(st.permutations([*"aaaa", *"bbbb"]), st.floats(0.2, 20.0))
def test_the_pace_of_two_cameras_is_that_of_the_link(order: list[str], ms: float) -> None:
    """However their parts come among each other: the link carries one after another."""
    carried = Carried()
    accounts = {name: PictureAccount(Outbox(), carried) for name in "ab"}
    coming = {name: iter(parts(1)) for name in "ab"}
    now, apart = S, round(ms * MS)
    for name in order:
        now += apart
        accounts[name].take(next(coming[name]), now)
    pace = (1000 + HEADERS) * 8e6 / apart  # [kbit/s]
    for account in accounts.values():
        assert account.report(now).room_kbit == pytest.approx(pace)
