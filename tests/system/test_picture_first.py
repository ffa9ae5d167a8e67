"""On a link with little room the picture comes first; state and commands keep their rates."""

from collections import Counter
from pathlib import Path

import msgspec
import pytest

pytest.importorskip("av")

from messages import topics
from messages.video import VideoPart
from services.runtime.bus.envelope import Envelope
from services.runtime.config.stack import Stack
from services.runtime.hosts.registry import Registry
from services.runtime.hosts.virtual_host import VirtualHost

S = 1_000_000_000
SETTLED, END = 12 * S, 24 * S  # [ns]
SECONDS = (END - SETTLED) / S
LEFT_OUT = ("recorder", "visualizer")
NEAR = 0.95  # [-] the state's rate, as it is seen


class Narrow:
    """A dive with a camera over a link of so many kilobits a second up."""

    def __init__(self, folder: Path, kbit: float) -> None:
        path = folder / "narrow.toml"
        path.write_text(f"[down]\ndelay_ms = 1.0\n[up]\ndelay_ms = 1.0\nrate_kbit = {kbit}\n")
        services = Registry.read("camera")
        kept = {name: spec for name, spec in services.items() if name not in LEFT_OUT}
        overrides = ["simulator.floor_depth=8"]
        stack = Stack(
            link=str(path), pilot="script:first_dive", seed=1, virtual=True, overrides=overrides
        )
        self.host = VirtualHost()
        self.host.add_all(services.only(kept), stack)
        self.count = Counter[str]()
        self.video_bytes = 0
        self.pictures = list[int]()  # [ns] when each was there
        self._decode = msgspec.msgpack.Decoder(VideoPart).decode
        for topic, side in (
            (topics.STATE, "topside"),
            (topics.VIDEO, "topside"),
            (topics.PILOT_COMMAND, "drone"),
        ):
            self.host.side(side).hear(topic.key, self._hear)
        self.host.run(END)

    def _hear(self, envelope: Envelope) -> None:
        now, settled = self.host.now, self.host.now >= SETTLED
        self.count[envelope.key] += settled
        if envelope.key == topics.VIDEO.key:
            part = self._decode(envelope.payload)
            self.video_bytes += settled * len(envelope.payload)
            if part.part == part.parts - 1:
                self.pictures.append(now)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("kbit", "picture", "state"),
    [(2000.0, 1400.0, 10.0), (600.0, 350.0, 10.0), (200.0, 90.0, 9.0)],
)
def test_the_picture_has_most_of_a_narrow_link(
    tmp_path: Path, kbit: float, picture: float, state: float
) -> None:
    seen = Narrow(tmp_path, kbit)
    assert seen.video_bytes * 8e-3 / SECONDS >= picture
    assert seen.count[topics.STATE.key] / SECONDS >= NEAR * state
    assert seen.count[topics.PILOT_COMMAND.key] / SECONDS >= topics.PILOT_COMMAND.hz - 1.0


@pytest.mark.slow
def test_the_narrowest_link_has_a_picture_every_two_seconds(tmp_path: Path) -> None:
    seen = Narrow(tmp_path, 60.0)
    assert seen.pictures[0] < 3 * S
    later = [at for at in seen.pictures if at >= SETTLED]
    assert all(b - a <= 2 * S for a, b in zip([SETTLED, *later], [*later, END], strict=True))
