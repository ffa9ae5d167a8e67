"""What rmw_zenoh reads, written from its design document alone (docs/design.md of ros2/rmw_zenoh)
and from none of Lindy's code."""

from typing import NamedTuple

STRING = "RIHS01_df668c740482bbd48fb39d76a70dfd4bd59db1288021743503259e948f6b1a18"
CHATTER = f"0/chatter/std_msgs::msg::dds_::String_/{STRING}"
IN_A_NAMESPACE = f"0/robot1/chatter/std_msgs::msg::dds_::String_/{STRING}"
LISTENER = "@ros2_lv/2/aac3178e146ba6f1fc6e6a4085e77f21/0/0/NN/%/%/listener"
SUBSCRIPTION = (
    "@ros2_lv/2/aac3178e146ba6f1fc6e6a4085e77f21/0/10/MS/%/%/listener/%chatter/"
    f"std_msgs::msg::dds_::String_/{STRING}/::,10:,:,:,,"
)


class ReadToken(NamedTuple):
    """A liveliness token, taken apart."""

    domain: int
    session: str
    node: int
    entity: int
    kind: str
    enclave: str
    namespace: str
    name: str
    topic: str = ""
    type: str = ""
    type_hash: str = ""
    depth: str = ""  # of its QoS
    durability: str = ""  # empty: volatile; 1: transient-local


def demangled(name: str) -> str:
    return name.replace("%", "/")


def read_token(token: str) -> ReadToken:
    parts = token.split("/")
    assert all(parts), "an empty chunk is no key of Zenoh"
    admin, domain, session, node, entity, kind, enclave, namespace, name, *more = parts
    assert admin == "@ros2_lv"
    assert kind in ("NN", "MP", "MS", "SS", "SC")
    of_node = int(domain), session, int(node), int(entity), kind
    named = demangled(enclave), demangled(namespace), name
    if kind == "NN":
        assert node == entity
        assert not more
        return ReadToken(*of_node, *named)
    topic, dds, described, qos = more
    reliability, durability, history, deadline, lifespan, liveliness = qos.split(":")
    assert (reliability, deadline, lifespan, liveliness) == ("", ",", ",", ",,")
    policy, depth = history.split(",")
    assert policy == ""
    return ReadToken(*of_node, *named, demangled(topic), dds, described, depth, durability)


class ReadAttachment(NamedTuple):
    sequence: int
    utc_ns: int
    publisher: bytes


def read_attachment(data: bytes) -> ReadAttachment:
    """8 bytes of sequence number and 8 of time, little-endian; 1 of length; the publisher's id."""
    sequence = int.from_bytes(data[:8], "little", signed=True)
    utc_ns = int.from_bytes(data[8:16], "little", signed=True)
    assert data[16] == 16
    assert len(data) == 33
    return ReadAttachment(sequence, utc_ns, data[17:])


def attachment(sequence: int, utc_ns: int, publisher: bytes) -> bytes:
    head = sequence.to_bytes(8, "little", signed=True) + utc_ns.to_bytes(8, "little", signed=True)
    return head + b"\x10" + publisher
