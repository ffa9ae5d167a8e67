"""Golden dives: a short recorded dive for each vehicle, with what the services on board made of it.

A file holds every message that came to estimation, reference and control from elsewhere, numbers
rounded to `DIGITS`, and what the three publish on that, thinned to every `KEPT`th of the fast
topics. It is a recording like any other, which `lindy replay` plays.
"""

from collections.abc import Sequence
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, cast

import msgspec

from messages import topics
from messages.topic import AnyTopic
from services.recorder.foxglove.channel import foxglove_schema
from services.recorder.io.mcap_file import McapFile
from services.recorder.io.mcap_session import about
from services.runtime.config.stack import Stack
from services.runtime.hosts.registry import Registry
from services.runtime.hosts.virtual_host import VirtualHost
from tools.recordings.recording import Raw
from tools.replay.differences import Told, Tolerance
from tools.replay.on_board import OnBoard
from tools.replay.source import THINNED, open_source

FOLDER = Path(__file__).parent
CHAIN = ("estimation", "reference", "control")
VEHICLES = ("pioneer", "bluerov2_heavy", "minerva")
SECONDS = 11.0  # [s] the whole dive
SCRIPT = """t,surge,sway,heave,yaw
0,0,0,0,0
0.5,0,0,0.7,0.2
2.5,0.6,0,0,0
4,0.3,0.4,0,-0.3
5.5,0,0,0,0
30,0,0,0,0
"""
OVERRIDES = ["estimation.calibration.still_time=3"]  # [s] less to wait for
OUT_DIGITS = 9  # of the numbers that come out
DIGITS = 6  # of the numbers that go in: fewer bytes, and no sample is equal to the one before
KEPT = 20  # one of so many messages of a topic at 100 Hz
SERVICES = ("simulator", "estimation", "reference", "control", "tether", "gamepad", "recorder")
NEEDED = (  # what comes to the three from elsewhere
    *(topics.IMU, topics.MAGNETOMETER, topics.PRESSURE, topics.DVL, topics.USBL),
    *(topics.BATTERY, topics.LEAK, topics.TEMPERATURE, topics.ACTUATION),
    *(topics.PILOT_COMMAND, topics.PILOT_REQUEST, topics.CLOCK_PING),
)
# Floats are not the same to the last bit on every version of Python: from 3.12 on `sum` compensates
# its rounding, and mathematical functions come from the platform's library. A changed gain, sign or
# message is many orders of magnitude more.
TOLERANCES = (
    Tolerance("*_ns"),
    Tolerance("*.seq"),
    Tolerance("*", absolute=1e-6, relative=1e-6),
)


def golden(vehicle: str) -> Path:
    return FOLDER / f"{vehicle}.mcap"


def make(vehicle: str, path: Path) -> None:
    """Fly the dive with today's code, and write its golden file."""
    with TemporaryDirectory() as place:
        folder = Path(place)
        stack = flown(vehicle, folder)
        inputs = [_rounded(raw) for raw in open_source(folder).raw() if _is_needed(raw.key)]
        _write(folder / "inputs.mcap", stack, inputs)
        rows = sorted([*inputs, *_outputs(folder / "inputs.mcap")], key=lambda raw: raw.log_ns)
        _write(path, stack, rows)


def flown(
    vehicle: str,
    folder: Path,
    names: Sequence[str] = SERVICES,
    seed: int = 0,
    seconds: float = SECONDS,
) -> Stack:
    """Fly the script, recorded into a folder."""
    (folder / "script.csv").write_text(SCRIPT)
    stack = Stack(
        vehicle=vehicle,
        link="tether",  # with a delay: no answer of the pilot comes at the instant of its cause
        pilot=f"script:{folder / 'script.csv'}",
        out=str(folder),
        seed=seed,
        virtual=True,
        overrides=OVERRIDES,
    )
    services = Registry.read()
    host = VirtualHost()
    host.add_all(services.only({name: services[name] for name in names}), stack)
    host.run(round(seconds * 1e9))
    host.close()
    return stack


def _is_needed(key: str) -> bool:
    return any(topic.covers(key) for topic in NEEDED) or (
        key.startswith("health/") and key.removeprefix("health/") not in CHAIN
    )


def _outputs(path: Path) -> list[Raw]:
    """What the three publish on these inputs, thinned."""
    source, services = open_source(path), Registry.read()
    with source.stack() as stack:
        replay = OnBoard(source, CHAIN, services, stack)
        replay.run(source.span[1])
    told = [t for key in replay.outputs.keys for t in replay.outputs.of(key) if _is_kept(t)]
    return [Raw(t.key, _fewer_digits(t.data, OUT_DIGITS), t.stamp_ns, t.stamp_ns) for t in told]


def _is_kept(told: Told) -> bool:
    topic = topics.find(told.key)
    return topic is None or topic.hz < 100 or told.seq % KEPT == 0


def _rounded(raw: Raw) -> Raw:
    return raw._replace(data=_fewer_digits(raw.data, DIGITS))


def _fewer_digits(data: bytes, digits: int) -> bytes:
    return msgspec.json.encode(_rounded_in(msgspec.json.decode(data), digits))


def _rounded_in(tree: Any, digits: int) -> Any:
    if isinstance(tree, float):
        return float(f"{tree:.{digits}g}")
    if isinstance(tree, list):
        return [_rounded_in(each, digits) for each in cast(list[Any], tree)]
    if isinstance(tree, dict):
        return {k: _rounded_in(value, digits) for k, value in cast(dict[str, Any], tree).items()}
    return tree


def _write(path: Path, stack: Stack, rows: list[Raw]) -> None:
    """A recording as the recorder writes it."""
    file = McapFile(path)
    file.metadata("dive", {**about(stack), "pilot": "script:golden"})
    file.metadata("clock", {"utc_minus_stamp_ns": "0"})
    file.metadata(THINNED, {"outputs": f"every {KEPT}th at 100 Hz", "digits": str(DIGITS)})
    file.attach(stack.vehicle_path.name, "application/toml", stack.vehicle_path.read_bytes())
    for raw in rows:
        if not file.has_channel(raw.key):
            kind = cast(AnyTopic, topics.find(raw.key)).message
            file.open_channel(raw.key, kind.__name__, foxglove_schema(kind))
        seq = msgspec.json.decode(raw.data)["seq"]
        file.write(raw.key, raw.data, raw.log_ns, raw.publish_ns, seq)
    file.finish()
