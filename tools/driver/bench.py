"""A vehicle side alone, with somebody who commands its thrusters and hears what it says."""

import threading
import time
from collections import Counter, defaultdict
from collections.abc import Callable, Generator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import msgspec
import numpy as np

from messages import topics
from messages.control import ThrusterCommand
from messages.health import Health
from messages.pilot import PilotRequest
from messages.topic import AnyTopic
from messages.vehicle import Actuation
from services.estimation.settings import Settings as EstimationSettings
from services.marine.vehicle import Vehicle, wrench_per_newton
from services.runtime.bus.envelope import Say
from services.runtime.bus.zenoh_bus import open_bus
from services.runtime.config.stack import Stack
from services.runtime.hosts.registry import Registry
from services.runtime.hosts.virtual_host import VirtualHost
from services.runtime.launch.local_stack import local_stack
from services.runtime.launch.process_plan import Dive
from services.runtime.node.checkpoint import VolatileCheckpoint
from services.runtime.node.node import Node
from tools.checks import known_tables

S = 1_000_000_000  # [ns]
# Without these nothing flies; the others are said by a vehicle that has them.
ALWAYS: tuple[AnyTopic, ...] = (topics.IMU, topics.PRESSURE, topics.ACTUATION)
SAID: tuple[AnyTopic, ...] = (
    *ALWAYS, topics.MAGNETOMETER, topics.DVL, topics.USBL, topics.BATTERY, topics.LEAK,
    topics.TEMPERATURE,
)  # fmt: skip
PATIENCE_S = 10.0  # [s] for a board that has to be checked first
START_S = 30.0  # [s] for the processes
SHARE = 0.6  # [-] of the limits that a command asks for


class BrokenRuleError(Exception):
    """A promise is not kept: what was seen, and what was expected."""


class Bench:
    """What the vehicle side says is kept; what it is commanded is set by `ask`."""

    def __init__(
        self,
        now: Callable[[], int],
        run: Callable[[float], object],
        node: Node,
        say: Say,
        stack: Stack,
        *,
        virtual: bool = True,
    ) -> None:
        """
        Args:
            now: [ns] on virtual or real time.
            run: lets it go on for so long [s].
        """
        self.now, self.run, self.virtual = now, run, virtual
        self.vehicle = stack.section("vehicle", Vehicle)
        self.estimation = stack.section("estimation", EstimationSettings)
        self.heard: defaultdict[str, list[tuple[int, Any]]] = defaultdict(list)  # arrival, message
        self.counts: Counter[str] = Counter()  # of the vehicle side
        self.commanding: Callable[[int], None] | None = None
        self.say = say
        self._requests = node.publisher(topics.PILOT_REQUEST)
        for topic in SAID:
            node.each(topic, self._keep(topic))
        node.each(topics.HEALTH, self._health)
        node.every(topics.THRUSTERS.hz, self._command)

    def _keep(self, topic: AnyTopic) -> Callable[[Any, int], None]:
        return lambda message, now: self.heard[topic.key].append((now, message))

    def _health(self, health: Health, _: int) -> None:
        self.counts.update(Counter(health.counts) - self.counts)

    def _command(self, now: int) -> None:
        if self.commanding is not None:
            self.commanding(now)

    def settle(self) -> None:
        """Until the side is up.

        Raises:
            BrokenRuleError: it does not come up.
        """
        end = self.now() + round(PATIENCE_S * S)
        while silent := [topic.key for topic in ALWAYS if not self.all(topic)]:
            if self.now() > end:
                missing = " and ".join(silent)
                raise BrokenRuleError(f"nothing came on {missing} within {PATIENCE_S:.0f} s")
            self.run(0.2)

    def all(self, topic: AnyTopic, since: int = 0) -> list[Any]:
        """Messages stamped at `since` [ns] or later."""
        return [m for _, m in self.heard[topic.key] if m.stamp_ns >= since]

    # What it is told.

    def disarm(self, epoch: int) -> None:
        """As the pilot does."""
        now = self.now()
        self._requests.put(PilotRequest(stamp_ns=now, id=f"{now}", kind="disarm", epoch=epoch))

    def ask(
        self,
        thrust: tuple[float, ...],
        *,
        armed: bool = True,
        epoch: int = 1,
        armed_ns: int | None = None,
    ) -> None:
        """This thrust [N] a hundred times a second from now on."""

        def command(now: int) -> None:
            asked = ThrusterCommand(
                stamp_ns=now, sensor_ns=now - 1, pilot_ns=now - 2, thrust=thrust,
                armed=armed, epoch=epoch, armed_ns=armed_ns,
            )  # fmt: skip
            self.put(msgspec.structs.asdict(asked))

        self.commanding = command

    def put(self, fields: dict[str, Any]) -> None:
        """A command, whatever is in it."""
        self.say(msgspec.msgpack.encode(fields))

    def be_silent(self) -> None:
        self.commanding = None

    def along(self, axis: int, share: float = SHARE) -> tuple[float, ...]:
        """[N] Per thruster, for a force or moment along an axis, within a share of the limits."""
        columns = np.array([wrench_per_newton(t) for t in self.vehicle.thruster]).T
        thrust = np.linalg.pinv(columns) @ np.eye(6)[axis]
        limits = [t.limits for t in self.vehicle.thruster]
        most = max(
            f / (high if f > 0 else low) for f, (low, high) in zip(thrust, limits, strict=True) if f
        )
        return tuple((share / most * thrust).tolist())

    # What it did.

    def produced(self, since: int = 0) -> list[Actuation]:
        return self.all(topics.ACTUATION, since)

    def acts(self) -> bool:
        """Does any thruster push, by the newest report?"""
        return any(self.produced()[-1].thrust)

    def decay_s(self) -> float:
        """[s] Until a thruster with a lag has come to rest."""
        return 12.0 / min(-mode.pole.real for t in self.vehicle.thruster for mode in t.modes)

    def at_rest_again(self, since: int) -> bool:
        """Do all thrusters produce nothing from this time [ns] on, by what the side says?"""
        reports = self.produced(since)
        most = [0.01 * t.max_thrust for t in self.vehicle.thruster]
        return bool(reports) and all(
            abs(f) <= limit for a in reports for f, limit in zip(a.thrust, most, strict=True)
        )

    @property
    def refused(self) -> int:
        """Commands that the side has counted as refused."""
        return sum(n for name, n in self.counts.items() if name.endswith(":control/thrusters"))


def alone(stack: str, vehicle: str, folder: Path, *, virtual: bool) -> tuple[Registry, Stack]:
    """The vehicle side alone, checked as a dive is before it starts."""
    services = Registry.read(stack)
    services = services.only({name: services[name] for name in services.vehicle_side})
    made = Stack(vehicle=vehicle, out=str(folder), virtual=virtual)
    made.check(known_tables(services))
    return services, made


def on_virtual_time(host: VirtualHost, node: Node, say: Say, stack: Stack) -> Bench:
    return Bench(
        lambda: host.now, lambda seconds: host.run(host.now + round(seconds * S)), node, say, stack
    )


def virtual_bench(stack: str, vehicle: str, folder: Path) -> Bench:
    """Raises NeedsRealTimeError: the driver cannot run on virtual time."""
    services, made = alone(stack, vehicle, folder, virtual=True)
    host = VirtualHost()
    node = host.node("contract", ["drone"])
    say = host.side("drone").say(topics.THRUSTERS)
    bench = on_virtual_time(host, node, say, made)
    host.add_all(services, made)
    return bench


@contextmanager
def real_bench(stack: str, vehicle: str, folder: Path) -> Generator[Bench]:
    """As a process."""
    services, made = alone(stack, vehicle, folder, virtual=False)
    with local_stack(Dive(made, services)) as local:
        local.start_services()

        def look() -> bool:
            local.pump()
            return True

        local.wait_alive(START_S, look)
        woken = threading.Event()
        with open_bus(local.plan.endpoints["drone"], made.vehicle_name) as bus:
            node = Node("contract", {"drone": bus}, time.monotonic_ns, VolatileCheckpoint())
            node.wake = woken.set
            clock = time.monotonic_ns

            def run(seconds: float) -> None:
                end = clock() + round(seconds * S)
                while clock() < end:
                    node.step()
                    wait = (min(end, node.deadline()) - clock()) / 1e9
                    if wait > 0:
                        woken.wait(wait)
                    woken.clear()
                local.pump()

            yield Bench(clock, run, node, bus.say(topics.THRUSTERS), made, virtual=False)
