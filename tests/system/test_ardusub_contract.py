"""The contract of every vehicle side, kept by the service for ArduSub with the double as its board.

On virtual time. The contract itself is tools/driver/rules.py.
"""

from functools import partial
from pathlib import Path

import pytest

from messages import topics
from services.ardusub.service import wire_to
from services.marine.vehicle import Vehicle
from services.runtime.hosts.virtual_host import VirtualHost
from services.simulator.core import Settings
from tests.support.ardusub_double.board import BoardDouble
from tests.support.ardusub_double.memory import BoardOnHost
from tools.driver.bench import Bench, VirtualPlace, alone
from tools.driver.rules import RULES, Rule


def bench_on_a_board(folder: Path, version: str) -> Bench:
    """The bench of the contract, with this vehicle side alone."""
    services, stack = alone("ardusub", "bluerov2_heavy", folder, virtual=True)
    host = VirtualHost()
    vehicle, place = stack.section("vehicle", Vehicle), stack.section("simulator", Settings)
    board = BoardOnHost(host, BoardDouble(vehicle, place, version=version))
    node, say = host.node("contract", ["drone"]), host.side("drone").say(topics.THRUSTERS)
    bench = Bench(VirtualPlace(host), node, say, stack)
    host.add_all(services, stack, {"ardusub": partial(wire_to, board.link)})
    bench.settle()
    return bench


@pytest.mark.slow
@pytest.mark.parametrize("rule", RULES, ids=lambda rule: rule.__name__)
@pytest.mark.parametrize("version", ["4.5", "4.8"])
def test_it_is_kept(tmp_path: Path, rule: Rule, version: str) -> None:
    rule(bench_on_a_board(tmp_path, version))
