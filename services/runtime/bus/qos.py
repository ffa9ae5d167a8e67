"""The four QoS profiles as Zenoh settings.

Nothing blocks: a `put` that waits for a slow reader would stall a control loop for seconds, so
even events are DROP and their senders repeat until answered. Batching stays on (express off),
because express with DROP loses messages under CPU load.
"""

from dataclasses import dataclass

from zenoh import CongestionControl, Priority

from messages.topic import Qos


@dataclass(frozen=True, slots=True)
class ZenohQos:
    """Zenoh's QoS of one envelope."""

    priority: Priority
    congestion_control: CongestionControl
    express: bool


QOS_PROFILES = {
    Qos.REALTIME: ZenohQos(Priority.REAL_TIME, CongestionControl.DROP, express=False),
    Qos.LIVE: ZenohQos(Priority.INTERACTIVE_HIGH, CongestionControl.DROP, express=False),
    Qos.EVENT: ZenohQos(Priority.DATA_HIGH, CongestionControl.DROP, express=False),
    Qos.BULK: ZenohQos(Priority.BACKGROUND, CongestionControl.DROP, express=False),
}
