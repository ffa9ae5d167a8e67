"""The wiring, in the virtual host, with a test that plays the pilot and the vehicle."""

import re
from pathlib import Path

import pytest

from messages import topics
from messages.control import ThrusterCommand, Wrench
from messages.reference import Motion, Reference
from services.runtime.config.errors import LindyError
from services.runtime.config.stack import Stack
from services.runtime.hosts.stack_file import ServiceSpec
from services.runtime.hosts.virtual_host import VirtualHost
from services.runtime.node.node import Node
from tests.support import said

ROW = ServiceSpec(sides=["drone"])
S = 1_000_000_000  # [ns]
LATERAL = 2


class Bench:
    """The control service, and a node that says state and reference."""

    def __init__(self) -> None:
        self.host = VirtualHost()
        self.service = self.host.add("control", ROW, Stack())
        self.wrenches = list[Wrench]()
        self.commands = list[ThrusterCommand]()
        vehicle = self.host.node("vehicle", ["drone"])
        vehicle.each(topics.WRENCH, lambda wrench, _: self.wrenches.append(wrench))
        self.play(vehicle)

    def play(self, vehicle: Node) -> None:
        state, reference = vehicle.publisher(topics.STATE), vehicle.publisher(topics.REFERENCE)

        def move(now: int) -> None:
            state.put(said.state(now, depth=3.0))
            reference.put(sideways(now))

        vehicle.each(topics.THRUSTERS, lambda command, _: self.commands.append(command))
        vehicle.every(100, move)

    def run(self, seconds: float) -> Wrench:
        self.host.run(self.host.now + round(seconds * S))
        return self.wrenches[-1]


def sideways(now: int) -> Reference:
    return Reference(
        stamp_ns=now,
        sensor_ns=now,
        pilot_ns=now,
        armed=True,
        depth=Motion(3.0, 0.0, 0.0, 0.0),
        heading=Motion(0.0, 0.0, 0.0, 0.0),
        surge_force=0.0,
        sway_force=10.0,
    )


def test_each_reference_becomes_a_wrench_and_a_command() -> None:
    bench = Bench()
    last = bench.run(1.0)
    assert (last.wanted[1], last.achieved[1]) == pytest.approx((10.0, 10.0))
    assert len(bench.commands) == len(bench.wrenches) > 90
    assert bench.commands[-1].thrust[LATERAL] == pytest.approx(10.0)


@pytest.mark.parametrize(
    ("wrong", "sentence"),
    [
        (r'name = "vertical"(.*?)direction = \[0.0, 0.0, 1.0\]', "cannot drive heave"),
        (r'name = "lateral"(.*?)direction = \[0.0, 1.0, 0.0\]', "direction must not be"),
    ],
)
def test_a_vehicle_that_cannot_be_flown_is_refused_by_the_name_of_its_file(
    tmp_path: Path, wrong: str, sentence: str
) -> None:
    sound = Stack().vehicle_path.read_text()
    name = wrong.split('"')[1]
    becomes = "[0.0, 1.0, 0.0]" if name == "vertical" else "[0.0, 0.0, 0.0]"
    replacement = rf'name = "{name}"\1direction = {becomes}'
    broken = tmp_path / "broken.toml"
    broken.write_text(re.sub(wrong, replacement, sound, count=1, flags=re.DOTALL))
    stack = Stack(vehicle=str(broken))
    with pytest.raises(LindyError, match=rf"broken\.toml(:\d+)?: .*{sentence}"):
        VirtualHost().add("control", ROW, stack)
