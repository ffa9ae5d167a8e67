"""What every calibration is: samples in, the next instruction and in the end settings of a vehicle
file with their deviations out; the same for a recording and for a vehicle whose sensors are on the
bus now.
"""

import threading
import time
import tomllib
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple, Protocol

import msgspec

from messages import topics
from messages.message import Message
from messages.topic import AnyTopic
from services.marine.vehicle import Vehicle
from services.runtime.bus.zenoh_bus import open_bus
from services.runtime.config.errors import LindyError
from services.runtime.config.running import Running
from services.runtime.config.settings import convert
from services.runtime.node.checkpoint import VolatileCheckpoint
from services.runtime.node.node import Node
from tools.identify.results import Numbers, read_vehicle, toml, with_lines
from tools.recordings.recording import Recording

CALIBRATION_TABLE = "vehicle.calibration"


class CalibrationError(LindyError):
    """The samples do not tell what was asked for; the sentence says what is missing."""


class Setting(NamedTuple):
    """One line of a table."""

    key: str
    value: Numbers
    std: tuple[float, ...]  # 1σ of each number, in order; empty: not known
    unit: str
    about: str = ""
    table: str = CALIBRATION_TABLE

    @property
    def toml(self) -> str:
        """Without the comment."""
        return f"{self.key} = {toml(self.value, 6)}"

    @property
    def line(self) -> str:
        known = f" ± {', '.join(f'{std:.2g}' for std in self.std)}" if self.std else ""
        return f"{self.toml}  # [{self.unit}]{known}{': ' if self.about else ''}{self.about}"


class SensorFound(NamedTuple):
    """Of one sensor."""

    settings: tuple[Setting, ...]
    remarks: tuple[str, ...]  # sentences for the user


def table(settings: Sequence[Setting]) -> str:
    """As they stand in a vehicle file."""
    lines = list[str]()
    for name, those in _by_table(settings).items():
        lines += ["", f"[{name}]", *(setting.line for setting in those)]
    return "\n".join(lines[1:])


def with_settings(name: str, text: str, settings: Sequence[Setting], why: str) -> str:
    """The text of a vehicle file with these settings in it; all else stays as it is.

    Raises:
        LindyError: the file is laid out in a way that cannot be rewritten.
    """
    by_table = _by_table(settings)
    tree: dict[str, Any] = msgspec.to_builtins(read_vehicle(name, text))
    for heading, those in by_table.items():
        inner = tree
        for part in heading.split(".")[1:]:
            inner = inner[part]
        inner.update(tomllib.loads("\n".join(setting.toml for setting in those)))
    wanted = convert(tree, Vehicle, f"{name}: vehicle")
    lines = {
        (heading, 0): {setting.key: f"{setting.line}; {why}" for setting in those}
        for heading, those in by_table.items()
    }
    return with_lines(name, text, lines, wanted)


def _by_table(settings: Sequence[Setting]) -> dict[str, list[Setting]]:
    found = dict[str, list[Setting]]()
    for setting in settings:
        found.setdefault(setting.table, []).append(setting)
    return found


SENSORS: tuple[AnyTopic, ...] = (topics.IMU, topics.MAGNETOMETER, topics.PRESSURE, topics.DVL)
KEYS = {topic.key for topic in SENSORS}
SAID_HZ = 1.0  # [1/s] a new instruction is shown at most this often


class CalibrationGuide(Protocol):
    """A state machine; time is that of the samples' stamps."""

    def see(self, sample: Message) -> None:
        """Take in a raw sample of any sensor."""
        ...

    @property
    def done(self) -> bool:
        """There is enough for a result."""
        ...

    @property
    def prompt(self) -> str:
        """What the user should do now, and how far it is."""
        ...

    def result(self) -> SensorFound:
        """
        Raises:
            CalibrationError: the samples do not tell.
        """
        ...


def replay(recording: Recording, guide: CalibrationGuide) -> None:
    """Show the guide every sample of a recording."""
    for raw in recording.raw(KEYS.__contains__):
        if (sample := recording.decode(raw)) is not None:
            guide.see(sample)


def listen(node: Node, guide: CalibrationGuide, say: Callable[[str], None]) -> Callable[[], int]:
    """Show the guide what a node hears, and say its instructions when they change. Returns what
    says how many samples were heard."""
    said, heard = "", 0

    def see(sample: Message, _: int) -> None:
        nonlocal heard
        heard += 1
        guide.see(sample)

    def speak(_: int) -> None:
        nonlocal said
        if (prompt := guide.prompt) != said:
            said = prompt
            say(prompt)

    for topic in SENSORS:
        node.each(topic, see)
    node.every(SAID_HZ, speak)
    return lambda: heard


DRONE = "drone"  # the side on which raw samples are
SILENT_S = 5.0  # [s] without a sample at the start


def guide_live(running: Running, guide: CalibrationGuide, say: Callable[[str], None]) -> None:
    """Until the guide has enough; Ctrl-C ends it sooner.

    Raises:
        LindyError: this machine is not the drone's, or nothing is heard.
    """
    if DRONE not in running.endpoints:
        raise LindyError(
            "raw samples stay on the drone: run this on the drone's computer, or give a recording"
        )
    woken = threading.Event()
    with open_bus(running.endpoints[DRONE], running.vehicle) as bus:
        node = Node("calibrate", {DRONE: bus}, time.monotonic_ns, VolatileCheckpoint())
        node.wake = woken.set
        heard = listen(node, guide, say)
        began = time.monotonic()
        while not guide.done:
            woken.wait(max(0.0, (node.deadline() - time.monotonic_ns()) / 1e9))
            woken.clear()
            node.step()
            if not heard() and time.monotonic() - began > SILENT_S:
                raise LindyError(
                    f"no sensor sample in {SILENT_S:.0f} s; does the drone's side run?"
                )
