"""How each service is doing. From every service, once a second."""

from typing import Literal

from messages.message import Message
from messages.units import Count, Counts, Name, NotNegative, Text

LATE_MS = 40.0  # [ms] of `lateness_p99_ms`: a service above is late; four periods of control


class Health(Message, frozen=True, kw_only=True):
    """The last second of a service, and its counts since start."""

    service: Name
    loop_hz: NotNegative  # [1/s] handler calls over the last period
    lateness_p50_ms: NotNegative | None  # [ms] handled after it was due or arrived
    lateness_p99_ms: NotNegative | None  # [ms]
    # Of its whole process, with Zenoh's threads; of a service that shares its process, of its own
    # handlers alone: what Zenoh's threads of that process need is then in nobody's figure.
    cpu_percent: NotNegative | None  # [%] of one core; None on virtual time
    rss_mb: NotNegative | None  # [MB] resident memory of its process; None on virtual time
    sent: Count  # messages since start
    received: Count  # messages since start
    counts: Counts  # every dropped, stale, malformed, saturated … thing since start
    side: Name = ""  # its home
    pid: Count = 0  # of its process; 0 on virtual time
    instance: Count = 0  # drawn by its process at its start: tells two of one name apart


class LogLine(Message, frozen=True, kw_only=True):
    """One line for people."""

    service: Name
    level: Literal["info", "warning", "error"]
    text: Text
    event: Name = ""  # of the row of the event table it is of; empty: of none
