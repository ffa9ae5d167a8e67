from collections.abc import Callable
from typing import Any

import pytest

from messages import topics
from messages.link import DOWN_STAGES, UP_STAGES
from messages.message import Message
from messages.video import PICTURE_STAGES
from tests.support.messages import example

Sample = Callable[[str, int], Message]
MS = 1_000_000  # [ns]


def stages(names: tuple[str, ...]) -> list[dict[str, Any]]:
    return [{"name": name, "p50_ms": 1.0, "p99_ms": 2.0} for name in names]


@pytest.fixture
def sample() -> Sample:
    """A message of a row of the table, by key and stamp."""

    def make(key: str, now: int) -> Message:
        (topic,) = (topic for topic in topics.ALL if topic.key == key)
        return example(topic.message, now, **fields(now).get(key, {}))

    return make


def fields(now: int) -> dict[str, dict[str, Any]]:
    """By key, what matters."""
    motion = {"position": 1.0, "velocity": 0.5, "acceleration": 0.1, "jerk": 0.0}
    thrust = (1.0, 2.0, 3.0, 4.0)
    pictures = {"age_ms": 30.0, "stages": stages(PICTURE_STAGES)}
    leg = {"delay_p50_ms": 10.0, "delay_p99_ms": 20.0, "forwarded": 5, "dropped": 0, "queued": 1}
    miss = {"depth": 0.01, "heading": 0.01}
    return {
        topics.DVL.key: {"velocity": (0.5, 0.1, 0.0), "altitude": 3.0},
        topics.LEAK.key: {"wet": False},
        topics.AIDING.key: {"value": 1.0, "innovation": 0.1, "variance": 0.01, "test_ratio": 0.5},
        topics.HEALTH.key: {
            "service": "control", "lateness_p50_ms": 0.1, "lateness_p99_ms": 0.4,
            "cpu_percent": 5.0, "rss_mb": 40.0, "counts": {"stale:state": 2},
        },
        topics.LOG.key: {"service": "control"},
        topics.STATE.key: {"phase": "running"},
        topics.REFERENCE.key: {"armed": True, "depth": motion, "heading": motion},
        topics.THRUSTERS.key: {"thrust": thrust},
        topics.ACTUATION.key: {
            "thrust": thrust, "actuated_ns": now, "sensor_ns": now - 2 * MS,
            "pilot_ns": now - 40 * MS,
        },
        topics.STATUS.key: {"activity": "piloted", "armed": True},
        topics.ESTIMATE.key: {"roll": 0.1, "depth": 1.0, "angular_rate": (0.0, 0.0, 0.1)},
        topics.TRUTH.key: {"position": (now * 1e-9, 0.0, 1.0)},
        topics.LINK.key: {"up": True, "rtt_ms": 20.0, "down_link": leg, "up_link": leg},
        topics.BATTERY.key: {"voltage": 16.0},
        topics.LATENCY.key: {"down": stages(DOWN_STAGES), "up": stages(UP_STAGES)},
        topics.CLOCK.key: {"offset_ns": 5 * MS, "bound_ns": MS // 10, "rtt_ms": 2.0},
        topics.PREDICTION.key: {"missed": miss, "delayed": miss},
        topics.PICTURE_AGE.key: pictures,
        topics.FURTHER_AGE.key: pictures,
        topics.SHOWN.key: {"sensor_ns": now - 30 * MS},
    }  # fmt: skip
