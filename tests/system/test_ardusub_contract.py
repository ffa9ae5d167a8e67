"""The contract of every vehicle side, kept by the service for ArduSub with the double as its board.

On virtual time. The contract itself is tests/contract/test_vehicle_side.py.
"""

import importlib.util
import inspect
from collections.abc import Callable
from functools import partial
from pathlib import Path
from types import ModuleType
from typing import Any

import pytest

from messages import topics
from services.ardusub.service import wire_to
from services.marine.vehicle import Vehicle
from services.runtime.hosts.virtual_host import VirtualHost
from services.simulator.core import Settings
from tests.support.ardusub_double.board import BoardDouble
from tests.support.ardusub_double.memory import BoardOnHost

CONTRACT = Path(__file__).parents[1] / "contract" / "test_vehicle_side.py"


def contract() -> ModuleType:
    spec = importlib.util.spec_from_file_location("vehicle_side_contract", CONTRACT)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


KEPT = contract()
PROMISES = [
    name
    for name, test in vars(KEPT).items()
    if name.startswith("test_") and "bench" in inspect.signature(test).parameters
]


def bench_on_a_board(folder: Path, version: str) -> Any:
    """The bench of the contract, with this vehicle side alone."""
    services, stack = KEPT.stack_of(("ardusub", "bluerov2_heavy"), folder, virtual=True)
    host = VirtualHost()
    vehicle, place = stack.section("vehicle", Vehicle), stack.section("simulator", Settings)
    board = BoardOnHost(host, BoardDouble(vehicle, place, version=version))
    node = host.node("contract", ["drone"])
    bench = KEPT.Bench(KEPT.Virtual(host), node, host.side("drone").say(topics.THRUSTERS), stack)
    host.add_all(services, stack, {"ardusub": partial(wire_to, board.link)})
    bench.settle()
    return bench


def test_the_whole_contract_is_there() -> None:
    assert len(PROMISES) >= 8


@pytest.mark.slow
@pytest.mark.parametrize("promise", PROMISES)
@pytest.mark.parametrize("version", ["4.5", "4.8"])
def test_it_is_kept(tmp_path: Path, promise: str, version: str) -> None:
    test: Callable[..., None] = getattr(KEPT, promise)
    more = {"still": False} if "still" in inspect.signature(test).parameters else {}
    test(bench=bench_on_a_board(tmp_path, version), **more)
