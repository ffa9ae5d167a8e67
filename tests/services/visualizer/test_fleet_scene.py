"""Several drones in one scene: each in a part of its own, at one time."""

import itertools
from pathlib import Path

from hypothesis import given
from hypothesis import strategies as st
from msgspec.structs import replace

from messages.vehicle import Truth
from services.marine.vehicle import Vehicle
from services.runtime.config.stack import Stack
from services.visualizer.fleet_scene import STEP_NS, FlownTrack, entities, track
from services.visualizer.io.fleet_writer import encoded
from tools.__main__ import main

GOLDEN = Path(__file__).parents[2] / "golden"
VEHICLE = Stack().section("vehicle", Vehicle)
TRUTH = Truth(
    stamp_ns=0, position=(0.0, 0.0, 0.0), attitude=(1.0, 0.0, 0.0, 0.0), velocity=(0.0, 0.0, 0.0),
    angular_rate=(0.0, 0.0, 0.0), depth_rate=0.0, roll=0.0, pitch=0.0, heading=0.0, on_floor=False,
)  # fmt: skip


@given(st.lists(st.text(max_size=70), max_size=12))
def test_every_drone_has_a_part_of_its_own_whatever_it_is_called(names: list[str]) -> None:
    paths = entities([FlownTrack(name, (1.0, 1.0, 1.0), []) for name in names])
    assert len(set(paths)) == len(names)
    assert all(path.count("/") == 1 and path.startswith("world/") for path in paths)


@given(st.lists(st.integers(0, 3 * STEP_NS), max_size=40))
def test_a_way_has_its_poses_in_order_and_none_too_soon_after_another(steps: list[int]) -> None:
    time, said = 0, list[tuple[int, Truth]]()
    for number, step in enumerate(steps):
        time += step
        said.append((time, replace(TRUTH, stamp_ns=time, position=(float(number), 0.0, 1.0))))
    poses = track("a", VEHICLE, said).poses
    assert bool(poses) == bool(said)
    assert all(b.time - a.time >= STEP_NS for a, b in itertools.pairwise(poses))
    assert {(pose.time, pose.position[0]) for pose in poses} <= {
        (time, message.position[0]) for time, message in said
    }


def test_two_recordings_are_one_file_with_both_and_nothing_is_written_over(tmp_path: Path) -> None:
    out = tmp_path / "all.rrd"
    words = ["log", "scene", *(str(GOLDEN / f"{n}.mcap") for n in ("pioneer", "minerva"))]
    assert main([*words, "--out", str(out)]) == 0
    data = out.read_bytes()
    assert data.startswith(b"RRF2")
    assert main([*words, "--out", str(out)]) == 1
    assert out.read_bytes() == data


def test_a_drone_that_never_said_where_it_is_has_a_hull_and_no_way() -> None:
    still = encoded([FlownTrack("a", (1.0, 0.5, 0.5), [])])
    moved = encoded([track("a", VEHICLE, [(0, TRUTH)])])
    assert still.startswith(b"RRF2")
    assert len(moved) > len(still)
