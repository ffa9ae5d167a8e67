"""`lindy record`: one program that records every drone of a network, each in a file of its own."""

import time
from collections import Counter, deque
from collections.abc import Collection
from datetime import UTC, datetime
from itertools import count
from pathlib import Path
from typing import Annotated, NamedTuple

from cyclopts import Parameter

from messages import topics
from messages.topic import AnyTopic, Direction
from services.runtime.bus.envelope import Envelope
from services.runtime.bus.network import open_network
from services.runtime.bus.spaces import checked_name, name_in, namespace
from services.runtime.config.disk import reason
from services.runtime.config.errors import LindyError
from tools.choices import HERE, Insecure, KeysFolder, Router, UntilCtrlC, named
from tools.fleet.drones import WATCHERS
from tools.fleet.gaps import SILENT_NS, Gaps
from tools.fleet.look import PATIENCE_S
from tools.fleet.recordings import FleetRecording
from tools.fleet.roster import MOST, ROWS, Roster
from tools.keys.credentials import credentials
from tools.live.dive_folder import out_folder, require_room_for_recording
from tools.live.stop_signals import StopSignals

CLEAN, DATA_LOST = 0, 3  # exit statuses
STEP_S = 0.1  # [s] between two looks at what has arrived
FIRST_LOOK_S = 10.0  # [s] who was not heard by then is named, once
STEPS_A_FLUSH = 2  # of a disk: at most 0.2 s is lost when this program is killed
LISTED = 10  # names in one line, at most
KEPT = 100_000  # messages between two looks; some ten seconds of twenty drones
# Heavy, and no camera sends it unless somebody asks for it.
SKIPPED = (topics.VIDEO, topics.FURTHER_VIDEO)
RECORDED: tuple[AnyTopic, ...] = tuple(
    topic
    for topic in topics.ALL
    if topic.way in (Direction.UP, Direction.BOTH)
    and topic not in (*topics.WITHIN_ONE_MACHINE, *SKIPPED)
)


class ArrivedMessage(NamedTuple):
    envelope: Envelope
    at: int  # [ns]


class Arrivals:
    """What has come and was not looked at yet. Filled on Zenoh's thread."""

    def __init__(self) -> None:
        self.waiting: deque[ArrivedMessage] = deque()
        self.tokens: deque[tuple[str, bool]] = deque(maxlen=KEPT)
        self.left: deque[tuple[str, int]] = deque(maxlen=KEPT)  # drones, and when [ns]
        self._overflowed: Counter[str] = Counter()  # by drone

    def store(self, envelope: Envelope) -> None:
        if len(self.waiting) >= KEPT:
            self._overflowed[name_in(envelope.key)] += 1
        else:
            self.waiting.append(ArrivedMessage(envelope, time.monotonic_ns()))

    def leave(self, name: str) -> None:
        """A drone ends."""
        self.left.append((name, time.monotonic_ns()))

    def take_overflowed(self) -> Counter[str]:
        found, self._overflowed = self._overflowed, Counter()
        return found


class FleetRecorder:
    """The recordings of all drones that were heard."""

    def __init__(self, endpoint: str, folder: Path, only: Collection[str]) -> None:
        """
        Args:
            only: names of the drones to record; empty: all.
        """
        self.recordings: dict[str, FleetRecording] = {}
        self._gaps: dict[str, Gaps] = {}  # of those that are recorded
        self._left_at: dict[str, str] = {}  # time of day, of those that ended
        self.roster = Roster()
        self._endpoint, self._folder, self._only = endpoint, folder, only
        self._rows = {topic.key for topic in ROWS}
        self._failed: set[str] = set()  # drones that are not recorded
        self._others: set[str] = set()  # drones that were heard, and are not of `only`
        self.beyond = 0  # messages of those beyond `MOST`

    def look(self, arrivals: Arrivals) -> None:
        """Take in what has arrived."""
        while arrivals.tokens:
            self.roster.token(*arrivals.tokens.popleft())
        for _ in range(len(arrivals.waiting)):
            self._take(*arrivals.waiting.popleft())
        while arrivals.left:
            self._leave(*arrivals.left.popleft())
        for name, messages in arrivals.take_overflowed().items():
            if (recording := self.recordings.get(name)) is not None:
                recording.overflowed(messages)

    def notice_silence(self, now: int) -> None:
        """Say which drones are not heard any more."""
        for name, gaps in self._gaps.items():
            if gaps.look(now):
                seconds = f"{SILENT_NS / 1e9:.0f} s"
                print(f"{name} is not heard any more: nothing came for {seconds}", flush=True)

    def _leave(self, name: str, now: int) -> None:
        if (gaps := self._gaps.get(name)) is not None:
            gaps.leave(now)
            self._left_at[name] = f"{datetime.now(UTC):%H:%M:%S} UTC"
            print(f"{name} left at {self._left_at[name]}", flush=True)

    def flush(self) -> None:
        for recording in self.recordings.values():
            recording.flush(time.monotonic_ns())

    def close(self) -> None:
        for recording in self.recordings.values():
            recording.close()

    def summary(self) -> list[str]:
        """A line for each drone, and what was not recorded."""
        lines = [
            f"{name}: {recording.messages} messages in {recording.folder}"
            + (f", {recording.lost} lost" if recording.lost else "")
            + (f", {words}" if (words := self._gaps[name].words) else "")
            + (f", left at {self._left_at[name]}" if self._gaps[name].left_ns else "")
            for name, recording in sorted(self.recordings.items())
        ]
        beyond = f"{self.beyond} messages of drones beyond the first {MOST}, not recorded"
        remarks = [*([beyond] if self.beyond else []), *self.roster.remarks]
        return [*lines, *([self.unheard] if self.unheard else []), *remarks]

    @property
    def unheard(self) -> str:
        """Which of the wanted drones never said what they are; empty: all did."""
        heard = self._failed.union(self.recordings)
        if not self._only:
            return "" if heard else "no drone was heard"
        missing = sorted(set(self._only) - heard)
        others = sorted(self._others)
        beside = f"; heard, and not asked for: {_listed(others)}" if others else ""
        return f"never heard: {', '.join(missing)}{beside}" if missing else ""

    @property
    def lost(self) -> bool:
        """Is there something, a time, or a drone that is not recorded?"""
        gaps = any(one.count for one in self._gaps.values())
        lost = any(one.lost for one in self.recordings.values())
        return bool(self._failed or self.beyond or gaps or lost or self.unheard)

    def _take(self, envelope: Envelope, arrived: int) -> None:
        name = name_in(envelope.key)
        row = envelope.key.removeprefix(f"{namespace(name)}/")
        if row in self._rows:
            self.roster.row(envelope.key, envelope.payload)
        recording = self.recordings.get(name) or self._begin(name)
        if recording is not None:
            gaps = self._gaps.setdefault(name, Gaps(arrived))
            had_left = gaps.left_ns is not None
            if gap := gaps.hear(arrived):
                print(f"{name} is heard again after {gap / 1e9:.0f} s", flush=True)
            if had_left and gaps.left_ns is None:
                print(f"{name} is there again", flush=True)
            recording.take(row, envelope, arrived)

    def _begin(self, name: str) -> FleetRecording | None:
        """A drone that has said what it is gets a recording. A name alone anybody can announce."""
        drone = self.roster.drones.get(name)
        if drone is None or drone.identity is None or drone.status is None:
            return None
        if self._only and name not in self._only:
            if len(self._others) < MOST:
                self._others.add(name)
            return None
        if name in self._failed:
            return None
        if len(self.recordings) + len(self._failed) >= MOST:
            self.beyond += 1
            return None
        try:
            recording = FleetRecording(name, drone.identity, self._endpoint, self._folder)
        except (LindyError, OSError) as error:
            why = _why(error, self._folder / name) if isinstance(error, OSError) else str(error)
            self._failed.add(name)
            print(f"{name} is not recorded: {why}", flush=True)
            return None
        self.recordings[name] = recording
        without = "" if recording.knows_vehicle else ", without its vehicle file: it has another"
        print(f"{name} → {recording.folder}{without}", flush=True)
        return recording


def _listed(names: list[str]) -> str:
    more = len(names) - LISTED
    return ", ".join(names[:LISTED]) + (f" and {more} more" if more > 0 else "")


def _why(error: OSError, folder: Path) -> str:
    """Which path it is, and what is wrong with it."""
    return f"{error.filename or folder}: {reason(error)}"


def record(
    *,
    router: Router = HERE,
    out: Annotated[
        Path | None,
        Parameter(
            converter=named,
            help="folder for the recordings, one folder each; default: dives/ and the time (UTC)",
        ),
    ] = None,
    drone: Annotated[
        tuple[str, ...], Parameter(help="record this one only; repeatable; default: all")
    ] = (),
    keys: KeysFolder = None,
    insecure: Insecure = False,
    seconds: UntilCtrlC = None,
) -> int:
    """Record every drone that can be reached.

    All that leaves a drone but its video, a file for each drone. Each file is a recording like any
    other, of which `lindy log cut` cuts a dive out. Exit status 3: something that came is in none
    of them, a drone was not heard for more than 3 s, a drone of --drone was never heard, or,
    without --drone, none was.

    Example: lindy record --router tls/192.168.2.1:7447 --out dives/class
    """
    for name in drone:
        checked_name(name, "--drone")
    way = credentials(router, "--router", WATCHERS, keys, insecure=insecure)
    arrivals = Arrivals()
    with (
        open_network(router, PATIENCE_S, keys=None if way is None else way.keys) as network,
        StopSignals() as stop,
    ):
        folder = out_folder(out)
        require_room_for_recording(folder)
        recorder = FleetRecorder(router, folder, drone)
        network.watch(lambda key, there: arrivals.tokens.append((key, there)), arrivals.leave)
        for topic in RECORDED:
            network.collect(topic, arrivals.store)
        who = ", ".join(dict.fromkeys(drone)) or "every drone"
        how_long = "until Ctrl-C" if seconds is None else f"for {seconds:g} s, or until Ctrl-C"
        print(f"records {who} at {router} → {folder}, {how_long}", flush=True)
        end = time.monotonic() + (float("inf") if seconds is None else seconds)
        answered = True
        for step in count(1):
            time.sleep(STEP_S)  # messages come on Zenoh's thread
            now = time.monotonic_ns()
            recorder.look(arrivals)
            recorder.notice_silence(now)
            if step == round(FIRST_LOOK_S / STEP_S) and recorder.unheard:
                print(f"after {FIRST_LOOK_S:g} s: {recorder.unheard}", flush=True)
            if network.answers != answered:
                answered = not answered
                how = "answers again" if answered else "does not answer"
                print(f"the router at {router} {how}", flush=True)
            if step % STEPS_A_FLUSH == 0:
                recorder.flush()
            if stop.asked or time.monotonic() > end:
                break
    recorder.look(arrivals)
    recorder.close()
    print("\n".join(recorder.summary()), flush=True)
    return DATA_LOST if recorder.lost else CLEAN
