"""Small faults where one part meets another: each once went unnoticed by every test.

A law has property tests, whose arguments the test makes; who makes them in the service is easily
forgotten. `tests/test_long.py` puts each of these into a copy of the code, and the tests named
beside it must fail.
"""

from typing import NamedTuple


class Seam(NamedTuple):
    name: str  # what breaks
    file: str
    before: str  # exactly once in the file
    after: str
    tests: tuple[str, ...]


FAILSAFE = "services/reference/failsafe/table.py"
ROWS = ("tests/services/reference/failsafe/test_every_row.py",)
ALTITUDE = "tests/services/reference/guidance/test_altitude_hold.py"
GENERATOR = "tests/services/reference/test_reference_generator.py"
BOTTOM = "services/reference/guidance/bottom.py"
CORE = "services/reference/core.py"
LINK = ("tests/services/tether/test_link_laws.py",)
GATE = "services/vehicle/actuator_gate.py"

SEAMS = (
    Seam(
        "an ascent for a leak ends with a restart",
        FAILSAFE, "if leak is None or leak.wet is None else ()", "if False else ()", ROWS,
    ),
    Seam("too deep is never said", FAILSAFE, "TOO_DEEP = 0.5", "TOO_DEEP = 50.0", ROWS),
    Seam(
        "a jump of a clock is never said",
        FAILSAFE, '"clock": events.JUMPED_CLOCK', '"clock": events.SILENT_BOARD', ROWS,
    ),
    Seam(
        "a full disk is never said",
        FAILSAFE, '"recorder": events.DISK_ERROR', '"recorder": events.SILENT_BOARD', ROWS,
    ),
    Seam(
        "the link is lost while commands come",
        FAILSAFE, "None if self.command is not None else self.pinged_ns", "self.pinged_ns", ROWS,
    ),
    Seam(
        "an altimeter warns of no bottom",
        FAILSAFE, "newest.altimeter or newest.dvl", "newest.dvl", ROWS,
    ),
    Seam(
        "an empty battery gets no worse",
        FAILSAFE, "level = int(", "level = 0 * int(", ROWS,
    ),
    Seam(
        "it is never too hot",
        FAILSAFE, ">= s.hot", ">= 2.0 * s.hot", ROWS,
    ),
    Seam(
        "a pressure jump does not move the bottom",
        "services/reference/guidance/guidance.py",
        "self.bottom.shift(moved - before)", "pass",
        (f"{ALTITUDE}::test_a_jump_of_the_pressure_moves_the_bottom_with_the_depth",),
    ),
    Seam("no look-ahead over a slope", BOTTOM, "AHEAD_S = 1.5", "AHEAD_S = 0.0",
        (f"{ALTITUDE}::test_the_faster_it_goes_the_higher_a_stick_that_leads_down_ends",)),
    Seam(
        "a stop on a path says up for down",
        "services/reference/guidance/guidance.py",
        "there.down - here.down", "here.down - there.down",
        (f"{GENERATOR}::test_a_stop_on_a_path_that_slopes_says_how_far_down_it_goes",),
    ),
    Seam(
        "an old disarm ends a later arming",
        CORE, 'request.kind == "disarm" and request.stamp_ns >= self._armed_ns',
        'request.kind == "disarm"',
        (f"{GENERATOR}::test_a_disarm_that_control_hands_on_late_does_not_end_a_later_arming",),
    ),
    Seam(
        "home stays lost after an arming",
        CORE, "if guidance.home.lost:", "if False:",
        (f"{GENERATOR}::test_a_home_that_was_lost_is_where_the_drone_is_armed_next",),
    ),
    Seam(
        "the place is held for ten times as long as promised without a position",
        "services/reference/guidance/guidance.py",
        "PLACE_PATIENCE_S = ", "PLACE_PATIENCE_S = 10.0 * ",
        ("tests/services/reference/guidance/test_modes.py"
         "::test_a_place_not_measured_for_too_long_is_let_go_and_said",),
    ),
    Seam(
        "one command of a great epoch locks control out",
        GATE, "LATCH_NS = 1_000_000_000", "LATCH_NS = 60_000_000_000",
        ("tests/services/vehicle/test_actuator_gate.py",),
    ),
    Seam(
        "the round trip on the screen is one way",
        "services/tether/core.py", "(one_way[0] or 0.0) + (one_way[1] or 0.0)",
        "(one_way[0] or 0.0)", LINK,
    ),
    Seam(
        "both directions lose the same messages",
        "services/tether/core.py", "default_rng(seed + 1)", "default_rng(seed)", LINK,
    ),
    Seam(
        "headers of a message take no time on the line",
        "services/tether/link_model.py", "size + self._profile.overhead_bytes", "size",
        ("tests/services/tether/test_link_exact.py", *LINK),
    ),
    Seam(
        "a disarm keeps the current that was known",
        "services/control/laws.py",
        "self._water = None\n        if self._coupling", "if self._coupling",
        ("tests/services/control/test_horizontal_law.py"
         "::test_a_current_that_was_known_before_a_disarm_pushes_nothing_after_it",),
    ),
    Seam(
        "a recording does not say how the clocks differ",
        "services/recorder/io/mcap_session.py",
        'self._file.metadata("clock_offset", _clock_offset(self._clock))', "pass",
        ("tests/services/recorder/test_recorder_service.py"
         "::test_with_two_clocks_every_publish_time_is_by_the_recorders",),
    ),
    Seam(
        "a film that the disk did not take counts as recorded",
        "services/cockpit/cameras.py", "elif answer.accepted:", "else:",
        ("tests/services/cockpit/test_filming.py",),
    ),
    Seam(
        "the Pioneer's lateral thruster pushes the other way",
        "deploy/vehicles/pioneer.toml",
        "direction = [0.0, 1.0, 0.0]", "direction = [0.0, -1.0, 0.0]",
        ("tests/services/marine/test_vehicle_files.py",),
    ),
)  # fmt: skip
