"""The status screen as text: nothing wraps, nothing is lost, unknown is said so."""

from io import StringIO

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from msgspec.structs import replace
from rich.console import Console
from rich.text import Text

from messages.events import note, told
from messages.health import LogLine
from messages.message import Notice
from services.vehicle_view import words
from services.vehicle_view.log_lines import LogEntry, LogLines
from tools.live.screen import LINES, ServiceView, View, drawn_anew, plain, render

NAMES = ["simulator", "estimation", "reference", "control", "tether", "gamepad", "recorder"]
WIDTHS = pytest.mark.parametrize("width", [80, 120])


def text_of_line(n: int) -> str:
    return f"line {n} [ms] " + "long " * 40


RISEN = Notice("link.rtt", {"from": 1234, "to": 12345})
FULL = View(
    title="pioneer · wifi_buoy · script first_dive",
    elapsed_s=83.0,
    length_s=95.0,
    activity="piloted",
    doing="stopping",
    armed=True,
    failsafe="pilot_lost",
    since_s=17.0,
    next_s=43.0,
    acting=(Notice("failsafe:pilot_lost"),),
    notices=(Notice("calibrating"),),
    depth_m=12.345,
    depth_wanted_m=12.4,
    heading_deg=359.9,
    heading_wanted_deg=0.1,
    sticks=(0.5, -1.0, 1.0, -0.25),
    down_ms=112.3,
    up_ms=108.9,
    rtt_ms=221.2,
    lost_s=1234.5,
    silent=("link_monitor_drone", "hub_drone"),
    alarms=(RISEN,),
    flight_mode="station_keeping",
    light=0.5,
    battery_v=15.94,
    used_wh=123.4,
    charge=0.46,
    services=(
        *(ServiceView(name, True, 444.4, 12.34, 99.9, 0, 1234567, "onboard") for name in NAMES),
        ServiceView("visualizer", False, 1.0, 10.0, 20.0, 3, 0),
    ),
    lines=tuple(
        LogEntry(
            LogLine(stamp_ns=n, service="control", level="error", text=text_of_line(n)), 1, n, n
        )
        for n in range(LINES + 3)
    ),
)


def text_of(view: View, width: int, height: int | None = None) -> list[str]:
    console = Console(width=width, color_system=None)
    with console.capture() as capture:
        console.print(render(view, height))
    return capture.get().removesuffix("\n").split("\n")


@WIDTHS
def test_a_full_screen_fits_and_has_as_many_lines_as_one_of_unknowns(width: int):
    long = (Notice("x" * 73),)  # too long for the row of the state
    blank = View(
        title="x",
        alarms=long,
        failsafe="leak",
        acting=(Notice("x"),),
        silent=("x",),
        notices=long,
        services=FULL.services,
    )
    full, empty = text_of(FULL, width), text_of(blank, width)
    assert max(map(len, full)) <= width
    assert len(full) == len(empty)


@WIDTHS
def test_every_value_is_shown_whole(width: int):
    text = "\n".join(text_of(FULL, width))
    for value in (
        "12.35 m", "12.40 m", "359.9°", "0.1°", "112.3 ms", "108.9 ms", "221.2 ms", "lost 1234.5 s",
        "01:23 of 01:35", "ARMED", "stopping", "FAILSAFE pilot lost for 17 s, rises in 43 s",
        "+0.50", "-1.00", "-0.25",
        "visualizer gone", "1234567", told(RISEN), "station keeping", "50 %", "15.9 V",
        "46 %", "late p99 [ms]", "CPU [%]", "SILENT link_monitor_drone +1",
    ):  # fmt: skip
        assert value in text
    assert "DISARMED" not in text


@settings(max_examples=60, deadline=None)
@given(st.integers(14, 40), st.integers(0, 14), st.booleans())
def test_whatever_the_height_nothing_that_a_pilot_needs_is_cut(
    height: int, services: int, alarm: bool
):
    rows = tuple(ServiceView(f"service_{n}", n != services - 1) for n in range(services))
    view = replace(FULL, services=rows, alarms=FULL.alarms if alarm else ())
    lines = text_of(view, 80, height)
    text = "\n".join(lines)
    assert len(lines) <= height
    assert "ARMED" in text
    assert "12.35 m" in text
    assert "15.9 V" in text
    assert "lost 1234.5 s" in text
    assert (told(RISEN) in text) == alarm
    assert words.acting(FULL) in text
    if height >= 13 + alarm + 1 + LINES:  # there is room for every log line
        assert all(f"line {n} [ms]" in text for n in range(3, LINES + 3))
    if height >= 13 + alarm + 1 + LINES + 4 and services:  # … and for a service or two
        assert f"service_{services - 1} gone" in text


def test_what_is_not_known_is_shown_as_a_dash_and_not_as_zero():
    text = "\n".join(text_of(View(title="x", services=(ServiceView("control", True),)), 80))
    assert "– m" in text
    assert "0.00" not in text
    assert "--:--" in text


def test_one_plain_line_says_the_same():
    line = plain(FULL)
    assert "\n" not in line
    for value in ("01:23", "armed stopping", "12.35 m", "359.9°", "221.2 ms", "FAILSAFE", "3"):
        assert value in line


@pytest.mark.parametrize("known", [True, False])
def test_the_state_of_a_drone_that_is_not_heard_is_said_to_be_the_last_known(known: bool) -> None:
    view = replace(FULL, silent_s=4.0 if known else None, doing="rising")
    state, *_ = text_of(view, 80)[1:]
    (drone,) = [line for line in text_of(view, 80) if line.startswith("DRONE")]
    assert state.startswith("last known:  ARMED ") == known
    assert ("last known: pilot lost" in drone) == known
    assert "the drone rises" in drone


WORST = replace(
    FULL,
    silent_s=1234.0,
    failsafe="imu_lost",
    acting=(Notice("failsafe:imu_lost"),),
    returns="resume",
    notices=(),
    age_ms=2_950.0,
    depth_m=123.45,
    depth_wanted_m=123.46,
    heading_wanted_deg=359.8,
    alarms=(Notice("alarm:peers", more="the other side runs Lindy 0.1.0, not 0.2.0"), RISEN),
    silent=("recorder", "control", "estimation"),
    lines=(),
)


def test_everything_at_once_is_shown_whole_on_80_by_24():
    """One row is left free for the cursor."""
    log = LogLines()
    for n, text in enumerate(["water in the enclosure", "tether pulled", "battery low"]):
        log.add(LogLine(stamp_ns=n, service="reference", level="warning", text=text), float(n))
    for n in range(50):
        log.add(LogLine(stamp_ns=n, service=f"toy{n}", level="info", text="all is well"), 60.0)
    lines = text_of(replace(WORST, lines=tuple(log.newest(LINES))), 80, 23)
    text = " ".join(" ".join(lines).split())
    assert len(lines) <= 23
    assert max(map(len, lines)) <= 80
    for whole in (
        "last known: ARMED", "FAILSAFE IMU lost for 17 s, rises in 43 s",
        words.acting(WORST),
        "no status from the drone for 1234 s",
        note(WORST.alarms), "SILENT recorder +2",
        "123.45 m", "123.46 m", "359.9°", "359.8°", "3.0 s old",
        "station keeping", "50 %", "15.9 V, 46 %", "+0.50", "lost 1234.5 s",
        "2.0 s reference: battery low", "1.0 s reference: tether pulled",
        "0.0 s reference: water in the enclosure", "toy49: all is well",
    ):  # fmt: skip
        assert whole in text


@pytest.mark.parametrize("height", [None, 23])
def test_what_is_wrong_with_the_picture_is_said_on_screen_and_in_a_line(height: int | None):
    view = replace(WORST, picture="no picture for 4 s")
    rows = text_of(view, 80, height)
    assert "CAMERA no picture for 4 s" in " ".join(rows)
    assert height is None or len(rows) <= height
    assert "CAMERA no picture for 4 s" in plain(view)
    assert "CAMERA" not in plain(WORST)


@pytest.mark.parametrize(
    ("alive", "begun", "said"), [(0, 0, "starting"), (0, 1, "gone"), (1, 1, "")]
)
def test_a_service_is_gone_only_if_it_was_there(alive: int, begun: int, said: str) -> None:
    service = ServiceView("visualizer", bool(alive), begun=bool(begun))
    lines = text_of(replace(FULL, services=(service,)), 80)
    assert any(line.split()[:2] == ["visualizer", said or "–"] for line in lines)


CLEARED = "\x1b[2J\x1b[H"


def test_a_terminal_of_another_size_is_cleared_once_before_it_is_drawn_on() -> None:
    console = Console(file=StringIO(), force_terminal=True, width=80, height=24)
    file = console.file
    assert isinstance(file, StringIO)
    with drawn_anew(console) as draw:

        def drawn(width: int, height: int) -> str:
            console.size = (width, height)
            begin = len(file.getvalue())
            draw(lambda size: Text(f"{size.width} x {size.height}"))
            return file.getvalue()[begin:]

        for width, height, cleared in (
            (80, 24, 0),
            (80, 24, 0),
            (200, 50, 1),
            (200, 50, 0),
            (80, 50, 1),
        ):
            said = drawn(width, height)
            assert f"{width} x {height}" in said
            assert said.count(CLEARED) == cleared
            assert said.rindex(f"{width} x {height}") > said.rfind(CLEARED)
