"""A pad that stays connected and stops answering: what is known of it, and what is not."""

import os
from pathlib import Path

import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from services.gamepad.io.hid_reports import HidReports, product_of
from services.gamepad.pad_silence import BEAT_NS, PROOF_NS, STOP, PadSilence, held_by_a_hand

MS, S = 1_000_000, 1_000_000_000  # [ns]
STEP = 20 * MS  # a reading
DEAD_BAND, AFTER = 0.12, 5.0
NAMES = ("leftx", "lefty", "rightx", "righty")

travel = st.floats(-1.0, 1.0)
sticks = st.fixed_dictionaries(dict.fromkeys(NAMES, travel))
centred = st.fixed_dictionaries(dict.fromkeys(NAMES, st.floats(-DEAD_BAND, DEAD_BAND)))


def silence() -> PadSilence:
    return PadSilence(AFTER, DEAD_BAND)


def still(pad: PadSilence, controls: dict[str, float], start: int, end: int) -> int | None:
    """The first instant at which the pad counts as lost, if none of its controls changes."""
    for now in range(start, end, STEP):
        if pad.read(controls, False, now).lost:
            return now
    return None


@given(centred)
def test_a_pad_with_centred_sticks_is_never_lost(controls: dict[str, float]):
    pad = silence()
    assert still(pad, controls, 0, 20 * S) is None
    assert pad.read(controls, False, 3600 * S) == (0, False)


@given(sticks, st.integers(0, 20))
def test_a_pad_that_is_frozen_with_a_stick_in_a_hand_is_lost_within_silent_after(
    controls: dict[str, float], moves: int
):
    assume(held_by_a_hand(controls, DEAD_BAND))
    pad = silence()
    for n in range(moves):
        pad.read({**controls, "lefty": n / 100}, False, n * STEP)
    froze = moves * STEP
    lost = still(pad, controls, froze, froze + 10 * S)
    assert lost is not None
    assert AFTER * S - STEP <= lost - froze <= AFTER * S + STEP
    later = pad.read(controls, False, lost + 7 * S)
    assert later.lost
    assert later.age_ns >= 7 * S + AFTER * S - STEP  # it grows


@given(sticks, st.lists(st.integers(1, int(AFTER * 50) - 1), min_size=1, max_size=8))
def test_a_pad_that_jitters_by_one_count_is_never_lost(controls: dict[str, float], gaps: list[int]):
    pad, now = silence(), 0
    for n, gap in enumerate(gaps):
        moved = {**controls, "leftx": controls["leftx"] + (n % 2) / 32767}
        for _ in range(gap):
            assert not pad.read(moved, False, now).lost
            now += STEP


@given(st.floats(STOP, 1.0), st.sampled_from(NAMES), st.sampled_from([-1, 1]))
def test_a_stick_against_its_stop_may_be_held_for_ever(deflection: float, name: str, sign: int):
    assert still(silence(), {name: sign * deflection}, 0, 20 * S) is None


def test_a_pad_that_answers_again_is_no_longer_lost():
    pad, held = silence(), {"lefty": 0.5}
    assert still(pad, held, 0, 10 * S) is not None
    assert pad.read({"lefty": 0.51}, False, 10 * S) == (0, False)
    assert still(pad, {"lefty": 0.51}, 10 * S, 14 * S) is None


def beats(pad: PadSilence, controls: dict[str, float], every: int, end: int) -> int:
    for now in range(0, end, STEP):
        assert not pad.read(controls, now % every == 0, now).lost
    return end


@given(sticks)
def test_a_pad_that_sends_reports_all_the_time_is_lost_soon_after_they_end(
    controls: dict[str, float],
):
    pad = silence()
    end = beats(pad, controls, STEP, PROOF_NS + S)
    lost = still(pad, controls, end, end + 10 * S)
    assert lost is not None
    assert lost - end <= BEAT_NS
    assert pad.read(controls, True, end + 11 * S) == (0, False)


@given(sticks)
def test_a_stick_that_is_held_quite_still_is_not_lost_while_reports_arrive(
    controls: dict[str, float],
):
    beats(silence(), controls, 2 * S, 30 * S)


@given(centred)
def test_a_pad_that_reports_only_now_and_then_is_not_taken_for_one_that_does_all_the_time(
    controls: dict[str, float],
):
    pad = silence()
    end = beats(pad, controls, 200 * MS, 2 * PROOF_NS)
    assert still(pad, controls, end, end + 10 * S) is None


def test_reports_that_come_because_a_stick_moves_prove_nothing():
    pad = silence()
    for now in range(0, 3 * PROOF_NS, STEP):
        pad.read({"lefty": now / S / 100}, True, now)
    assert still(pad, {"lefty": 0.0}, 3 * PROOF_NS, 4 * PROOF_NS) is None


# Raw reports.

DUALSHOCK = "050000004c050000cc09000000810000"
HID_ID = "HID_ID=0005:0000054C:000009CC\n"


def node(folder: Path, name: str, hid_id: str = HID_ID) -> None:
    """A hidraw device: what the kernel says of it, and a pipe in its place."""
    (folder / "sys" / name / "device").mkdir(parents=True)
    (folder / "sys" / name / "device" / "uevent").write_text(f"DRIVER=sony\n{hid_id}")
    (folder / "dev").mkdir(exist_ok=True)
    os.mkfifo(folder / "dev" / name)


def test_raw_reports_are_noticed_once_and_their_end_is_no_error(tmp_path: Path):
    node(tmp_path, "hidraw0", "HID_ID=0003:00000001:00000002\n")
    node(tmp_path, "hidraw3")
    reports = HidReports(DUALSHOCK, tmp_path / "sys", tmp_path / "dev")
    assert not reports.arrived()
    with (tmp_path / "dev" / "hidraw3").open("wb", buffering=0) as pad:
        assert not reports.arrived()
        pad.write(b"\x01" * 64)
        assert reports.arrived()
        assert not reports.arrived()
    assert not reports.arrived()
    reports.close()
    assert not reports.arrived()


@pytest.mark.parametrize("nodes", [[], ["hidraw0", "hidraw1"]])
def test_without_one_device_that_must_be_it_there_are_no_reports(tmp_path: Path, nodes: list[str]):
    for name in nodes:
        node(tmp_path, name)
    reports = HidReports(DUALSHOCK, tmp_path / "sys", tmp_path / "dev")
    for name in nodes:
        with pytest.raises(OSError):  # nobody reads it
            os.open(tmp_path / "dev" / name, os.O_WRONLY | os.O_NONBLOCK)
    assert not reports.arrived()


@given(st.text(max_size=40))
def test_any_text_is_no_guid_or_one_with_ids(guid: str):
    assert product_of(guid) is None or len(guid.replace(" ", "")) == 32


def test_the_ids_are_read_from_a_guid():
    assert product_of(DUALSHOCK) == (0x054C, 0x09CC)
    assert product_of("0" * 32) is None
