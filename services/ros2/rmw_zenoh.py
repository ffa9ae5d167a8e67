"""How rmw_zenoh uses Zenoh: keys, liveliness tokens, the attachment of a message. Pure.

Source: docs/design.md of https://github.com/ros2/rmw_zenoh, as of its release 0.2.4 for ROS 2 Jazzy
(April 2025); earlier ones had another attachment.

    key         <domain>/<topic>/<type>/<type hash>
    token       @ros2_lv/<domain>/<session>/<node>/<entity>/<kind>/<enclave>/<namespace>/<name>
                … /<topic>/<type>/<type hash>/<QoS> for a publisher (MP) or a subscription (MS)
    latched     an AdvancedPublisher of Zenoh with a cache, as of release 0.2.2
    attachment  int64 sequence number, int64 time [ns] UTC, uint8 16, 16 bytes of the publisher's id
"""

import struct
from dataclasses import dataclass
from hashlib import blake2b
from typing import Literal, NamedTuple

ATTACHMENT = struct.Struct("<qqB16s")  # little-endian, without padding
ID_BYTES = 16
# Reliable, volatile and the last ten: what differs from rmw_zenoh's defaults is written, between
# reliability : durability : history , depth : deadline : lifespan : liveliness.
QOS = "::,10:,:,:,,"
LATCHED = ":1:,1:,:,:,,"  # transient-local, the last one: who comes later gets it, too
Kind = Literal["NN", "MP", "MS"]  # node, publisher, subscription


class Attachment(NamedTuple):
    sequence: int
    utc_ns: int
    publisher: bytes

    def packed(self) -> bytes:
        return ATTACHMENT.pack(self.sequence, self.utc_ns, ID_BYTES, self.publisher)

    @classmethod
    def read(cls, data: bytes) -> "Attachment":
        """
        Raises:
            ValueError: it is none.
        """
        if len(data) != ATTACHMENT.size:
            raise ValueError(f"an attachment has {ATTACHMENT.size} bytes, found {len(data)}")
        sequence, utc_ns, length, publisher = ATTACHMENT.unpack(data)
        if length != ID_BYTES:
            raise ValueError(f"a publisher's id has {ID_BYTES} bytes, found {length}")
        return cls(sequence, utc_ns, publisher)


def dds_name(kind: str) -> str:
    """`sensor_msgs/msg/Imu` as DDS calls it."""
    package, _, name = kind.split("/")
    return f"{package}::msg::dds_::{name}_"


def key_of(domain: int, topic: str, kind: str, type_hash: str) -> str:
    """
    Args:
        topic: its whole name, from a / on.
        kind: such as `sensor_msgs/msg/Imu`.
    """
    return f"{domain}/{topic.strip('/')}/{dds_name(kind)}/{type_hash}"


def id_of(token: str) -> bytes:
    """A publisher's id: any 16 bytes that nobody else has. That of rmw_zenoh is another hash."""
    return blake2b(token.encode(), digest_size=ID_BYTES).digest()


def _mangled(name: str) -> str:
    return name.replace("/", "%") or "%"


@dataclass(slots=True)
class RosNode:
    """One node of ROS 2 in one session of Zenoh: its tokens, with their numbers."""

    domain: int
    session: str  # Zenoh's id of it
    namespace: str  # empty, or from a / on
    name: str
    _entities: int = 0

    def token(self) -> str:
        return self._token("NN", 0)

    def entity(self, kind: Kind, topic: str, of: str, type_hash: str, qos: str = QOS) -> str:
        """The token of one more publisher or subscription."""
        self._entities += 1
        more = (_mangled(topic), dds_name(of), type_hash, qos)
        return "/".join((self._token(kind, self._entities), *more))

    def _token(self, kind: Kind, entity: int) -> str:
        place = ("%", _mangled(self.namespace), self.name)
        return "/".join(
            ("@ros2_lv", str(self.domain), self.session, "0", str(entity), kind, *place)
        )
