"""One recording of each drone that is heard on a network, each in a folder of its own."""

import re
import time
from collections.abc import Mapping
from pathlib import Path

import msgspec

from messages import events
from messages.events import Level, Outbox
from messages.identity import SideIdentity
from messages.topic import AnyTopic
from services.marine.vehicle import Vehicle
from services.recorder.core import Intake, Settings
from services.recorder.foxglove.views import Views
from services.recorder.io.mcap_session import McapSession, RecordingCheckpoint
from services.recorder.io.parts import parts_in
from services.runtime.bus.envelope import Envelope
from services.runtime.config.errors import LindyError
from services.runtime.config.identity import identity_of
from services.runtime.config.stack import Stack
from tools.fresh import fresh_folder

VEHICLE = re.compile(r"[a-z0-9_]{1,64}")  # a name, and no path
LOST = (events.NOT_RECORDED(), events.OVERFLOWED(), events.DISK_ERROR())
SIDE = "topside"  # what leaves a drone is recorded, as on the topside


class FleetNode:
    """What a recording needs of a service's node, in a program that is none."""

    def __init__(self, drone: str) -> None:
        self.outbox = Outbox()
        self.wall_offset_ns = time.time_ns() - time.monotonic_ns()
        self.sides: Mapping[str, object] = {SIDE: None}
        self._drone = drone
        self._checkpoint: RecordingCheckpoint | None = None

    def now(self) -> int:
        return time.monotonic_ns()

    def log(self, level: Level, text: str) -> None:
        print(f"{self._drone}: {level}: {text}", flush=True)

    def restore_checkpoint(self, kind: type[RecordingCheckpoint]) -> RecordingCheckpoint | None:
        assert kind is RecordingCheckpoint
        return self._checkpoint

    def save_checkpoint(self, what: RecordingCheckpoint) -> None:
        self._checkpoint = what


class FleetRecording:
    """Of one drone."""

    def __init__(self, name: str, identity: SideIdentity, endpoint: str, folder: Path) -> None:
        """
        Args:
            folder: of all recordings.

        Raises:
            LindyError, OSError: nothing can be written there.
        """
        # A folder whose name begins with a dot would be hidden.
        own = f"_{name}" if name.startswith(".") else name
        self.folder = fresh_folder(folder / own, lambda path: any(parts_in(path)))
        self.messages = 0
        self._node = FleetNode(name)
        stack = Stack(name=name, link=endpoint, pilot="", apart=True, out=str(self.folder))
        known = vehicle_here(identity)
        self.knows_vehicle = known is not None
        stack = msgspec.structs.replace(stack, vehicle=known or stack.vehicle)
        views = Views(stack.section("vehicle", Vehicle)) if self.knows_vehicle else None
        attached = None if self.knows_vehicle else ()
        named = {"vehicle": identity.vehicle}
        # The drone's clock is not known here: what comes has the time of its arrival.
        self._intake = Intake(self._node.outbox, self._node.wall_offset_ns, _unknown, views)
        self._session = McapSession(self._node, stack, Settings(), attached, named)

    @property
    def lost(self) -> int:
        """Messages that are not in the file, as far as this program knows."""
        return sum(self._node.outbox.counts[event.name] for event in LOST)

    def take(self, key: str, envelope: Envelope, arrived: int) -> None:
        """A message of this drone.

        Args:
            key: within the drone's namespace.
            arrived: [ns]
        """
        found = self._intake.check(key, envelope.encoding, envelope.payload, arrived)
        if found is None:
            return
        self.messages += 1
        for row in self._intake.rows(key, found):
            self._session.write(row)

    def overflowed(self, messages: int) -> None:
        """So many came faster than they could be written."""
        self._node.outbox.tell(events.OVERFLOWED(), messages)

    def flush(self, now: int) -> None:
        self._session.flush(now)

    def close(self) -> None:
        self._session.close(self._intake.log_hash())


def _unknown(_: AnyTopic, _stamp_ns: int) -> int | None:
    return None


def vehicle_here(identity: SideIdentity) -> str | None:
    """Name of the shipped vehicle file that is the drone's own; None: it has another. What it says
    is a stranger's: nothing else of this machine is opened for it."""
    if VEHICLE.fullmatch(identity.vehicle) is None:
        return None
    try:
        ours = identity_of(Stack(vehicle=identity.vehicle), SIDE, 0)
    except LindyError:
        return None
    return identity.vehicle if ours.vehicle_hash == identity.vehicle_hash else None
