"""Laws of the rule that shares the link among cameras."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from messages import events
from messages.link import Stage
from messages.video import CameraChoice, CameraShares, PictureAge
from services.camera.core import SHARES_NS, Camera, OneCamera, Settings
from services.camera.pacing import ENOUGH_KBIT, SMALL, Range, shares

S = 1_000_000_000
NAMES: tuple[str, ...] = ("front", "down", "gripper", "aft")
sides = st.tuples(st.floats(4.0, 500.0), st.floats(4.0, 500.0))
ranges = sides.map(lambda ends: Range(min(ends), max(ends)))
totals = st.floats(1.0, 600.0) | st.floats(1.0, 1e5)


@st.composite
def drones(draw: st.DrawFn) -> tuple[dict[str, Range], str]:
    """Cameras, and which of them is large."""
    names = NAMES[: draw(st.integers(1, 4))]
    return {name: draw(ranges) for name in names}, draw(st.sampled_from(names))


@given(drones(), totals)
def test_the_sum_is_all_of_it_and_the_large_one_keeps_its_part(
    drone: tuple[dict[str, Range], str], total: float
) -> None:
    every, large = drone
    given_kbit = shares(total, large, every)
    assert list(given_kbit) == list(every)
    assert sum(given_kbit.values()) == pytest.approx(total)
    assert given_kbit[large] >= (1.0 - SMALL) * total * (1.0 - 1e-9)
    for name in every.keys() - {large}:
        kbit, (least, most) = given_kbit[name], every[name]
        assert kbit == 0.0 or least * (1.0 - 1e-9) <= kbit <= most * (1.0 + 1e-9)


@given(st.integers(2, 4), st.floats(4.0, 40.0), st.floats(1.0, 500.0))
def test_small_ones_thin_before_the_large_one_has_less_than_enough(
    number: int, least: float, total: float
) -> None:
    """Where the large one has less than enough, each small one has its least or nothing."""
    given_kbit = shares(total, "front", dict.fromkeys(NAMES[:number], Range(least, 2000.0)))
    if given_kbit.pop("front") < ENOUGH_KBIT * (1.0 - 1e-9):
        assert {*given_kbit.values()} <= {0.0, least}


@given(drones(), totals)
def test_the_last_named_stop_first(drone: tuple[dict[str, Range], str], total: float) -> None:
    every, large = drone
    given_kbit = shares(total, large, every)
    sends = [given_kbit[name] > 0.0 for name in every if name != large]
    assert sends == sorted(sends, reverse=True)


@given(totals, totals)
def test_more_room_is_never_less_for_the_large_one_of_equal_cameras(a: float, b: float) -> None:
    """But for the least of the small ones that may then send again."""
    every = dict.fromkeys(NAMES, Range(16.0, 2000.0))
    less, more = sorted((a, b))
    again = 16.0 * (len(NAMES) - 1)
    assert shares(more, "front", every)["front"] >= shares(less, "front", every)["front"] - again


def drone(*further: str) -> Settings:
    return Settings(more={name: OneCamera() for name in further})


def report(now: int, room: float) -> PictureAge:
    return PictureAge(
        stamp_ns=now, stages=(Stage("crossed", 20.0, 20.0),), per_second=20.0, heard_kbit=100.0,
        room_kbit=room, newest=0,
    )  # fmt: skip


def on_a_link(room: float, seconds: float = 4.0) -> tuple[dict[str, Camera], int]:
    """Three cameras that have heard each other over a link with room [kbit/s]."""
    settings = drone("down", "gripper")
    every = {name: Camera(settings, name) for name in settings.by_name}
    return every, flown(every, 0, room, seconds)


def flown(every: dict[str, Camera], begin: int, room: float, seconds: float) -> int:
    now = begin
    while now < begin + seconds * S:
        now += S // 5
        for camera in every.values():
            camera.heard(report(now, room), now)
            if (said := camera.shares(now)) is not None:
                for other in every.values():
                    if other is not camera:
                        other.told(said)
    return now


@given(st.floats(20.0, 1e5))
def test_together_the_cameras_send_no_more_than_one_would(room: float) -> None:
    every, now = on_a_link(room)
    alone = Camera(Settings(most_kbit=6000.0))
    flown({"front": alone}, 0, room, 4.0)
    together = sum(camera.budget(now) for camera in every.values())
    assert together <= alone.budget(now) * (1.0 + 1e-9)
    large = every["front"].budget(now)
    assert large >= min(2000.0, (1.0 - SMALL) * alone.budget(now)) * (1.0 - 1e-9)


@given(st.floats(20.0, 1e5), st.sampled_from(["down", "gripper"]))
def test_whoever_becomes_large_has_what_the_one_before_had(room: float, chosen: str) -> None:
    every, now = on_a_link(room)
    before = every["front"].budget(now)
    for camera in every.values():
        camera.chosen(CameraChoice(stamp_ns=now, camera=chosen))
    said = every[chosen].shares(now)
    assert said is not None
    assert said.large == chosen
    for name, camera in every.items():
        if name != chosen:
            camera.told(said)
    assert [name for name, camera in every.items() if camera.is_large] == [chosen]
    assert every[chosen].budget(now) == pytest.approx(before)
    assert sum(camera.budget(now) for camera in every.values()) <= said.total_kbit * (1 + 1e-9)


def test_a_camera_without_room_sends_nothing_until_there_is_some() -> None:
    every, now = on_a_link(30.0)
    down = every["down"]
    assert down.budget(now) == 0.0
    assert down.order(now, now) == events.LEFT_OUT_PICTURE()
    now = flown(every, now, 3000.0, 8.0)
    assert down.budget(now) > 100.0


def test_a_small_camera_whose_large_one_is_dead_sends_a_slide_show() -> None:
    every, now = on_a_link(3000.0)
    down = every["down"]
    assert down.budget(now) > 100.0
    assert down.budget(now + SHARES_NS + S) == 16.0
    down.chosen(CameraChoice(stamp_ns=now, camera="down"))
    assert down.budget(now + SHARES_NS + S) > 100.0  # the pilot has made it the large one


def test_a_camera_that_was_started_anew_learns_which_is_large() -> None:
    every, now = on_a_link(1000.0)
    for camera in every.values():
        camera.chosen(CameraChoice(stamp_ns=now, camera="down"))
    anew = Camera(drone("down", "gripper"), "front")
    assert anew.is_large  # as if nobody had chosen
    said = every["down"].shares(now)
    assert said is not None
    anew.told(said)
    assert not anew.is_large
    wrong = anew.shares(now)
    assert wrong is None
    every["down"].told(CameraShares(stamp_ns=now, large="front", total_kbit=300.0, kbit={}))
    assert every["down"].is_large  # the pilot's word counts


def test_a_name_that_no_camera_has_changes_nothing() -> None:
    camera = Camera(drone("down"))
    camera.chosen(CameraChoice(stamp_ns=0, camera="sonar"))
    assert camera.is_large


@pytest.mark.parametrize(
    ("names", "sentence"),
    [
        (["front"], "the first camera has it"),
        (["all"], "it means every camera"),
        (["Down"], "allowed are a to z"),
        (["a" * 17], "at most 16"),
        ([f"c{k}" for k in range(8)], "there are 9 cameras; allowed are 4"),
    ],
)
def test_names_and_numbers_that_cannot_be_are_one_sentence(names: list[str], sentence: str) -> None:
    with pytest.raises(ValueError, match=sentence):
        drone(*names)
