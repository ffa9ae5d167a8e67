"""Bags of ROS 1 (a .bag file) and ROS 2 (a folder with metadata.yaml), by the library rosbags."""

from collections.abc import Generator, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

from services.runtime.config.errors import LindyError
from services.runtime.config.extras import how_to_install
from tools.importing.log_file import ROSBAG, LogRow, LogSource, Wanted, getter, refuse_other

if TYPE_CHECKING:
    from rosbags.highlevel import AnyReader

ROS1, METADATA = ".bag", "metadata.yaml"


def is_rosbag(path: Path) -> bool:
    """By its name; what is in it is read later."""
    return path.suffix == ROS1 or (path / METADATA).is_file() or path.suffix == ".db3"


class RosbagFile:
    """One bag."""

    default_map = "ros"
    getter = staticmethod(getter)

    def __init__(self, path: Path) -> None:
        """
        Raises:
            LindyError: rosbags is not installed, or it is no bag.
        """
        self.remarks: list[str] = []
        self._path = path
        if path.suffix == ".db3":
            raise LindyError(
                f"{path}: a bag of ROS 2 is the folder with {METADATA}; name that folder"
            )
        if path.is_file():
            refuse_other(path, ROSBAG, "a bag of ROS 1")

    def sources(self) -> dict[str, LogSource]:
        with self._opened() as reader:
            found: dict[str, LogSource] = {}
            for each in reader.connections:
                before = found[each.topic].messages if each.topic in found else 0
                found[each.topic] = LogSource(each.msgtype, before + each.msgcount)
        if not any(source.messages for source in found.values()):
            raise LindyError(f"{self._path} holds no messages")
        return found

    def rows(self, wanted: Wanted) -> Iterator[LogRow]:
        with self._opened() as reader:
            connections = [each for each in reader.connections if each.topic in wanted]
            for connection, at_ns, data in reader.messages(connections):
                fields: Any = reader.deserialize(data, connection.msgtype)
                yield LogRow(connection.topic, fields, at_ns)

    @contextmanager
    def _opened(self) -> Generator["AnyReader"]:
        """
        Raises:
            LindyError: rosbags is not installed, or the bag is damaged.
        """
        try:
            from rosbags.highlevel import AnyReader
            from rosbags.typesys import Stores, get_typestore
        except ModuleNotFoundError:
            raise LindyError(
                f"bags need rosbags, which is missing: {how_to_install('import')}"
            ) from None
        try:
            typestore = get_typestore(Stores.ROS2_HUMBLE)
            reader = AnyReader([self._path], default_typestore=typestore)
            with reader:
                yield reader
        except Exception as error:  # of whatever kind: where bytes are wrong, rosbags does not say
            why = (str(error) or "a record cannot be read").rstrip(".")
            raise LindyError(
                f"{self._path} is damaged, was not finished or has types that are not in it: "
                f"{why}; `rosbag reindex` or `ros2 bag reindex` mends what can be read"
            ) from None
