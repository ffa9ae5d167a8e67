"""Collects what the screen shows of a dive, on the topside."""

from collections.abc import Callable, Iterable, Mapping, Sequence

import msgspec

from messages import events, topics
from messages.cameras import FIRST, age, called
from messages.health import Health, LogLine
from messages.link import Shown
from messages.message import Notice
from services.runtime.node.node import Node
from services.vehicle_view import ages
from services.vehicle_view.io.ports import LOOK_HZ, VehiclePorts
from services.vehicle_view.log_lines import LogLines
from services.vehicle_view.view import vehicle_view
from tools.live.dive_timeline import DiveTimeline
from tools.live.screen import MOST_LINES, ServiceView, View

OLD_MS = ages.PICTURE.gone_ns / 1e6  # [ms] a small picture may be a slide show


class Watch:
    """Subscribes to everything that the screen shows."""

    def __init__(
        self,
        node: Node,
        services: list[str],
        timeline: DiveTimeline,
        show: Callable[[LogLine, float | None], None],
        shared: Mapping[str, str] | None = None,
        cameras: Iterable[str] = (FIRST,),
    ) -> None:
        """
        Args:
            shared: the process of each service that is not alone in a process of its own name.
            cameras: names of the drone's.
        """
        self.lines = LogLines()
        self._timeline = timeline
        self._services, self._shared = services, shared or {}
        self._show = show
        self._begun: set[str] = set()  # services that were alive
        self._health: dict[str, Health] = {}
        self._sent_hz: dict[str, float] = {}
        self._vehicle = VehiclePorts(node)
        self._pilot = node.latest(topics.PILOT_COMMAND)
        node.each(topics.HEALTH, self._hear_health)
        node.each(topics.LOG, self._add)
        self._pictures = {camera: node.latest(age(camera)) for camera in cameras}
        self._shown = node.publisher(topics.SHOWN.of("screen"))
        # Nobody receives their own messages on the bus.
        node.show = lambda line: self._add(line, line.stamp_ns)
        node.every(LOOK_HZ, self._look)

    def view(
        self,
        title: str,
        now: int,
        missing: list[str],
        restarts: dict[str, int],
        silent: Sequence[str] = (),
    ) -> View:
        """The screen at `now` [ns].

        Args:
            missing: services that are not alive.
            silent: processes that run but do not answer.
        """
        timeline = self._timeline
        self._begun |= {name for name in self._services if name not in missing}
        newest = self._vehicle.newest(now)
        pilot = self._pilot.fresh(now)
        if (state := ages.shown(topics.STATE, newest.state, now)) is not None:
            self._shown.put(Shown(stamp_ns=now, sensor_ns=state.sensor_ns))
        seen = vehicle_view(newest, now)
        if newest.status is None:
            seen = msgspec.structs.replace(seen, notices=(Notice("no_status"),))
        return View(
            **msgspec.structs.asdict(seen),
            title=title,
            elapsed_s=timeline.elapsed_s(now),
            length_s=timeline.length_s,
            sticks=(pilot.surge, pilot.sway, pilot.heave, pilot.yaw) if pilot else None,
            silent=tuple(silent),
            picture=self._old_pictures(now),
            services=tuple(
                self._service(name, name not in missing, restarts) for name in self._services
            ),
            lines=tuple(self.lines.newest(MOST_LINES)),
        )

    def _old_pictures(self, now: int) -> str:
        """What is wrong with them; empty: nothing, or there are none."""
        wrong: list[str] = []
        for camera, port in self._pictures.items():
            said = port.fresh(now)
            if said is not None and said.age_ms is not None and said.age_ms > OLD_MS:
                name = called(camera, several=len(self._pictures) > 1)
                wrong.append(f"{name}: the picture is {said.age_ms / 1e3:.1f} s old")
        return " · ".join(wrong)

    def _service(self, name: str, alive: bool, restarts: dict[str, int]) -> ServiceView:
        health = self._health.get(name)
        return ServiceView(
            name=name,
            alive=alive,
            begun=name in self._begun,
            process=self._shared.get(name, ""),
            sent_hz=self._sent_hz.get(name),
            late_ms=health.lateness_p99_ms if health else None,
            cpu_percent=health.cpu_percent if health else None,
            restarts=restarts.get(name, 0),
            troubles=events.troubles(health.counts) if health else 0,
        )

    def _add(self, line: LogLine, now: int) -> None:
        """A log line that arrived, or was logged by this process, at `now` [ns]."""
        at_s = self._timeline.elapsed_s(now)
        self.lines.add(line, at_s)
        self._show(line, at_s)

    def _hear_health(self, health: Health, _: int) -> None:
        before = self._health.get(health.service)
        self._health[health.service] = health
        if before is None or health.sent < before.sent:  # the first one, or it was restarted
            return
        if (seconds := (health.stamp_ns - before.stamp_ns) / 1e9) > 0:
            self._sent_hz[health.service] = (health.sent - before.sent) / seconds

    def _look(self, now: int) -> None:
        self._vehicle.newest(now)
        for port in (self._pilot, *self._pictures.values()):
            port.newest(now)
