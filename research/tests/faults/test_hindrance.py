"""A service on virtual time that is stopped or slow: late, but nothing is lost or out of order."""

from itertools import pairwise

from messages import topics
from messages.sensors import ImuSample
from tests.support.faults.hindrance import Hindrance
from tests.support.hindered_host import HinderedHost

MS = 1_000_000  # [ns]
HZ = 100


class Scene:
    """A talker at 100 Hz, and a listener that can be hindered."""

    def __init__(self) -> None:
        self.hindrance = Hindrance(lambda: self.host.now, 0)
        self.host = HinderedHost(lateness={"listener": self.hindrance})
        self.heard: list[tuple[int, int]] = []  # (said, handled) [ns]
        says = (talker := self.host.node("talker", ["drone"])).publisher(topics.IMU)
        talker.every(HZ, lambda now: says.put(self._sample(now)))
        listener = self.host.node("listener", ["drone"])
        listener.each(topics.IMU, lambda m, now: self.heard.append((m.stamp_ns, now)))

    @staticmethod
    def _sample(now: int) -> ImuSample:
        zero = (0.0, 0.0, 0.0)
        return ImuSample(stamp_ns=now, specific_force=zero, angular_rate=zero)

    def run(self, ms: int) -> None:
        self.host.run(self.host.now + ms * MS)


def test_unhindered_it_is_handled_at_once() -> None:
    scene = Scene()
    scene.run(500)
    assert len(scene.heard) == 50
    assert all(said == handled for said, handled in scene.heard)


def test_stopped_it_handles_nothing_and_then_everything_in_order() -> None:
    scene = Scene()
    scene.run(100)
    scene.hindrance.stop()
    scene.run(305)
    assert len(scene.heard) == 10
    scene.hindrance.go_on()
    scene.run(95)
    assert [said for said, _ in scene.heard] == [n * 10 * MS for n in range(1, 51)]
    assert scene.heard[10][1] - scene.heard[10][0] > 290 * MS


def test_slow_it_handles_in_bursts_no_closer_than_a_step_takes() -> None:
    scene = Scene()
    scene.run(100)
    scene.hindrance.slow(0.1)
    scene.run(1000)
    steps = sorted({handled for _, handled in scene.heard if handled > 100 * MS})
    assert all(b - a >= 100 * MS for a, b in pairwise(steps))
    assert len(scene.heard) > 90, "nothing is lost"
    scene.hindrance.slow(0.0)
    scene.run(200)
    assert scene.heard[-1][0] == scene.heard[-1][1], "at once again"
