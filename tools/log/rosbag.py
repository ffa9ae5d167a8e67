"""`lindy log export --as rosbag`: a bag of ROS 2, by the same table as the service `ros2`."""

from collections import Counter
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from messages import topics
from messages.text import harmless
from services.marine.vehicle import Vehicle
from services.ros2.core import Settings, namespace_of, ros_name
from services.runtime.config.disk import reason
from services.runtime.config.errors import LindyError
from services.runtime.config.extras import how_to_install
from tools.exit_status import DONE, LOST
from tools.fresh import refuse_existing
from tools.log.export import written_words
from tools.packages import require_package
from tools.recordings.dive_file import flown_section
from tools.recordings.progress import reading
from tools.recordings.recording import Recording, open_recording
from tools.text_table import counted

if TYPE_CHECKING:
    from rosbags.interfaces import Connection, Qos

    from services.ros2.mapping import RosMessage, RosMessages, ToJpeg

VERSION = 9  # of the format of bags, as ROS 2 Jazzy writes it


def write_bag(recording: Path, folder: Path) -> int:
    """Write a bag with the messages that `lindy ros2` shows live, at the time of their arrival at
    the recorder. Returns the exit status: 3 where a message could not be read, or the file is
    damaged or was not finished.

    Raises:
        LindyError: there is no recording, it is empty, or the folder is there or cannot be written.
    """
    require_package("rosbags", "ros2", "a bag")
    from services.ros2.mapping import RosMessages

    opened = open_recording(recording)
    if (origin := opened.origin_ns()) is None:
        raise opened.empty(recording)
    refuse_existing(folder)
    vehicle = flown_section(opened, "vehicle", Vehicle)
    settings = flown_section(opened, "ros2", Settings) or Settings()
    name = ros_name(opened.metadata("dive").get("vehicle", "drone"))
    mounting = None if vehicle is None else vehicle.mounting
    messages = RosMessages(name, namespace_of(settings, name), mounting, _jpegs())
    try:
        with reading("writing a bag", opened.size) as opened.advance:
            written, left_out = _fill(opened, origin, folder, messages)
    except OSError as error:
        said = f"cannot write {folder}: {reason(error)}"
        raise LindyError(
            f"{said}; the bag in it is not whole" if folder.is_dir() else said
        ) from None
    print(f"{written_words(written)} written to {folder}", flush=True)
    if left_out:
        print(harmless(f"not in ROS 2's words: {', '.join(sorted(left_out))}"), flush=True)
    for key, count in opened.unreadable.items():
        print(harmless(f"{counted(count, 'message')} left out: {key} cannot be read"), flush=True)
    said = opened.damage
    print(harmless("".join(f"{sentence}\n" for sentence in said)), end="", flush=True)
    return LOST if opened.unreadable or said else DONE


def _jpegs() -> "Callable[[], ToJpeg] | None":
    try:
        from services.ros2.io.jpeg import JpegOfVideo
    except ImportError:
        print(f"no JPEG of cameras: PyAV is not installed; {how_to_install('camera')}", flush=True)
        return None
    return JpegOfVideo


def _fill(
    recording: Recording, origin_ns: int, folder: Path, messages: "RosMessages"
) -> tuple[Counter[str], set[str]]:
    """Messages written, by topic, and the keys that have no place in ROS 2."""
    from rosbags.rosbag2 import CompressionFormat, CompressionMode, StoragePlugin, Writer

    from services.ros2.mapping import STORE

    written, left_out = Counter[str](), set[str]()
    known: dict[str, Connection] = {}
    bag = Writer(folder, version=VERSION, storage_plugin=StoragePlugin.MCAP)
    bag.set_compression(CompressionMode.STORAGE, CompressionFormat.ZSTD)

    def write(said: "RosMessage", log_ns: int, qos: "Sequence[Qos]" = ()) -> None:
        data = said.cdr()
        if said.topic not in known:
            known[said.topic] = bag.add_connection(
                said.topic, said.kind, typestore=STORE, offered_qos_profiles=qos
            )
        bag.write(known[said.topic], log_ns, data)
        written[said.topic] += 1

    with bag:
        if (static := messages.static(origin_ns)) is not None:
            write(static, origin_ns, [_latched()])
        for key, message, log_ns, publish_ns in recording:
            topic = topics.find(key)
            if topic is None or not messages.has(topic):
                left_out.add(key)
                continue
            for said in messages.of(topic, key, message, publish_ns):
                try:
                    write(said, log_ns)
                except ValueError:  # a value has no room in its field
                    recording.unreadable[key] += 1
    return written, left_out


def _latched() -> "Qos":
    """Whoever plays the bag is to say it to those who come later, too."""
    from rosbags import interfaces as bags

    never = bags.QosTime(9_223_372_036, 854_775_807)  # as rosbag2 writes an infinite time
    return bags.Qos(
        bags.QosHistory.KEEP_LAST,
        1,
        bags.QosReliability.RELIABLE,
        bags.QosDurability.TRANSIENT_LOCAL,
        never,
        never,
        bags.QosLiveliness.AUTOMATIC,
        never,
        avoid_ros_namespace_conventions=False,
    )
