"""`lindy top`: what each service of a running dive costs, and how late it is."""

import time
from collections.abc import Mapping

from messages import topics
from messages.events import troubles
from messages.health import LATE_MS, Health
from messages.message import Message
from messages.units import Ns
from tools.choices import RunningDive, UntilCtrlC
from tools.text_table import aligned
from tools.topic.figures import UNKNOWN

SILENT_NS = 3_000_000_000  # [ns] of a message that comes once a second
HEADING = (
    *("service", "side", "process", "processor %", "memory MB", "calls 1/s"),
    *("late p50 ms", "late p99 ms", "sent", "received", "counted", ""),
)


def top(*, seconds: UntilCtrlC = None, dive: RunningDive = None) -> int:
    """Show what each service costs, and how late it is.

    From the health that each service says once a second. `counted` is all that was dropped, stale,
    refused or limited in its last second; the memory is that of its process, which services with
    the same number share. On a terminal every second, else once at the end.

    Example: lindy top --seconds 10
    """
    from tools.ask import dive_in
    from tools.topic.listening import listen, side_of

    running = dive_in(dive)
    heard = dict[str, tuple[Health, Health | None, Ns]]()

    def take(_key: str, health: Message, _size: int, now: Ns) -> None:
        assert isinstance(health, Health)
        before = heard.get(health.service, (None, None, 0))[0]
        same = before is not None and before.instance == health.instance
        heard[health.service] = (health, before if same else None, now)

    def draw() -> list[str]:
        return table(heard, time.monotonic_ns())

    side = side_of(running, [topics.HEALTH])
    listen(running, side, [topics.HEALTH], take, draw, count=None, seconds=seconds)
    return 0


def table(heard: Mapping[str, tuple[Health, Health | None, Ns]], now: Ns) -> list[str]:
    """A line for each service, the dearest first.

    Args:
        heard: by service: its newest health, the one before it of the same process, and when [ns]
            the newest came.
    """
    ranked = sorted(heard.items(), key=lambda each: (-(each[1][0].cpu_percent or 0.0), each[0]))
    return aligned([HEADING, *(_line(*health, now) for _, health in ranked)])


def _line(health: Health, before: Health | None, at: Ns, now: Ns) -> tuple[str, ...]:
    silent, late = now - at > SILENT_NS, (health.lateness_p99_ms or 0.0) > LATE_MS
    remark = f"silent for {(now - at) / 1e9:.0f} s" if silent else "late" if late else ""
    counted = None if before is None else troubles(health.counts) - troubles(before.counts)
    return (
        *(health.service, health.side or UNKNOWN, str(health.pid)),
        *(_number(health.cpu_percent), _number(health.rss_mb), _number(health.loop_hz)),
        *(_number(health.lateness_p50_ms), _number(health.lateness_p99_ms)),
        *(str(health.sent), str(health.received)),
        *(UNKNOWN if counted is None else str(counted), remark),
    )


def _number(value: float | None) -> str:
    return UNKNOWN if value is None else f"{value:.1f}"
