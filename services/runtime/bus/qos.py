"""The four stances in Zenoh's words.

Nothing blocks: a `put` that waits for a slow reader would stall a control loop for seconds, so
even events are DROP and their senders repeat until answered. Batching stays on (express off),
because express with DROP loses messages under CPU load.
"""

from dataclasses import dataclass

from zenoh import CongestionControl, Priority

from messages.topic import Qos


@dataclass(frozen=True, slots=True)
class Travel:
    """How one envelope travels, in Zenoh's terms."""

    priority: Priority
    congestion_control: CongestionControl
    express: bool


STANCES = {
    Qos.REALTIME: Travel(Priority.REAL_TIME, CongestionControl.DROP, express=False),
    Qos.LIVE: Travel(Priority.INTERACTIVE_HIGH, CongestionControl.DROP, express=False),
    Qos.EVENT: Travel(Priority.DATA_HIGH, CongestionControl.DROP, express=False),
    Qos.BULK: Travel(Priority.BACKGROUND, CongestionControl.DROP, express=False),
}
