"""`lindy log rosbag`: a recording as a bag of ROS 2, by the same table as the service `ros2`."""

from collections import Counter
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from cyclopts import Parameter

from messages import topics
from messages.text import harmless
from services.marine.vehicle import Vehicle
from services.ros2.core import Settings
from services.ros2.names import namespace_of, ros_name
from services.runtime.config.disk import reason
from services.runtime.config.errors import LindyError
from services.runtime.config.extras import how_to_install
from tools.choices import named
from tools.fresh import refuse_existing
from tools.recordings.dive_file import flown_dive, flown_section
from tools.recordings.progress import reading
from tools.recordings.recording import Recording, open_recording

if TYPE_CHECKING:
    from rosbags.interfaces import Connection

    from services.ros2.mapping import RosMessages

CLEAN, DATA_LOST = 0, 3  # exit statuses
VERSION = 9  # of the format of bags, as ROS 2 Jazzy writes it


def rosbag(
    recording: Path,
    *,
    out: Annotated[
        Path | None,
        Parameter(converter=named, help="a new folder; default: rosbag beside the recording"),
    ] = None,
) -> int:
    """As a bag of ROS 2 (rosbag2, MCAP), with standard messages.

    RECORDING is a dive's folder or its MCAP file. The messages are those that `lindy ros2` shows
    live, at the time of their arrival at the recorder. Exit status 3: a message could not be read,
    or the file is damaged or was not finished.

    Example: lindy log rosbag dives/latest --out bag
    """
    try:
        from services.ros2.mapping import RosMessages
    except ImportError:
        raise LindyError(
            f"a bag needs rosbags, which is missing: {how_to_install('ros2')}"
        ) from None
    opened = open_recording(recording)
    beside = recording if recording.is_dir() else recording.parent
    folder = out or beside / "rosbag"
    refuse_existing(folder)
    vehicle = flown_section(opened, "vehicle", Vehicle)
    settings = flown_section(opened, "ros2", Settings) or Settings()
    flown = flown_dive(opened)
    name = "drone" if flown is None else ros_name(Path(flown.stack.vehicle).stem)
    mounting = None if vehicle is None else vehicle.mounting
    messages = RosMessages(name, namespace_of(settings, name), mounting)
    try:
        with reading("writing a bag", opened.size) as opened.advance:
            written, left_out = _fill(opened, folder, messages)
    except OSError as error:
        said = f"cannot write {folder}: {reason(error)}"
        raise LindyError(
            f"{said}; the bag in it is not whole" if folder.is_dir() else said
        ) from None
    print(f"{written.total()} messages of {len(written)} topics written to {folder}", flush=True)
    if left_out:
        print(harmless(f"not in ROS 2's words: {', '.join(sorted(left_out))}"), flush=True)
    for key, count in opened.unreadable.items():
        print(harmless(f"{count} messages left out: {key} cannot be read"), flush=True)
    said = opened.damage
    print(harmless("".join(f"{sentence}\n" for sentence in said)), end="", flush=True)
    return DATA_LOST if opened.unreadable or said else CLEAN


def _fill(
    recording: Recording, folder: Path, messages: "RosMessages"
) -> tuple[Counter[str], set[str]]:
    """Messages written, by topic, and the keys that have no place in ROS 2."""
    from rosbags.rosbag2 import CompressionFormat, CompressionMode, StoragePlugin, Writer

    from services.ros2.mapping import STORE

    written, left_out = Counter[str](), set[str]()
    of_topic: dict[str, Connection] = {}
    bag = Writer(folder, version=VERSION, storage_plugin=StoragePlugin.MCAP)
    bag.set_compression(CompressionMode.STORAGE, CompressionFormat.ZSTD)
    with bag:
        for key, message, log_ns, publish_ns in recording:
            topic = topics.find(key)
            if topic is None or not messages.has(topic):
                left_out.add(key)
                continue
            for said in messages.of(topic, key, message, publish_ns):
                try:
                    data = said.cdr()
                except ValueError:
                    recording.unreadable[key] += 1
                    continue
                connection = of_topic.get(said.topic)
                if connection is None:
                    connection = bag.add_connection(said.topic, said.kind, typestore=STORE)
                    of_topic[said.topic] = connection
                bag.write(connection, log_ns, data)
                written[said.topic] += 1
    return written, left_out
