"""Keys, tokens and attachments are those of rmw_zenoh's design document."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from services.ros2.mapping import type_hash
from services.ros2.rmw_zenoh import Attachment, RosNode, id_of, key_of
from tests.support import ros_document as document

names = st.from_regex(r"[A-Za-z][A-Za-z0-9_]{0,8}", fullmatch=True)
places = st.lists(names, max_size=3).map(lambda found: "".join(f"/{name}" for name in found))
int64 = st.integers(-(2**63), 2**63 - 1)


def test_the_examples_of_the_document_are_made_to_the_letter() -> None:
    described = type_hash("std_msgs/msg/String")
    assert described == document.STRING
    assert key_of(0, "/chatter", "std_msgs/msg/String", described) == document.CHATTER
    inside = key_of(0, "/robot1/chatter", "std_msgs/msg/String", described)
    assert inside == document.IN_A_NAMESPACE
    session = "aac3178e146ba6f1fc6e6a4085e77f21"
    node = RosNode(2, session, "", "listener", _entities=9)
    assert node.token() == document.LISTENER
    made = node.entity("MS", "/chatter", "std_msgs/msg/String", described)
    assert made == document.SUBSCRIPTION


@given(places, names, places, st.integers(0, 232))
def test_every_token_can_be_taken_apart_again(
    namespace: str, name: str, topic: str, domain: int
) -> None:
    node = RosNode(domain, "1f", namespace, name)
    read = document.read_token(node.token())
    assert (read.domain, read.namespace, read.name) == (domain, namespace or "/", name)
    seen = set[int]()
    for kind in ("MP", "MS"):
        whole = f"{topic}/leaf"
        read = document.read_token(node.entity(kind, whole, "sensor_msgs/msg/Joy", "RIHS01_0"))
        assert (read.topic, read.kind, read.depth) == (whole, kind, "10")
        assert read.type == "sensor_msgs::msg::dds_::Joy_"
        seen.add(read.entity)
    assert len(seen) == 2
    assert 0 not in seen


@given(int64, int64, st.binary(min_size=16, max_size=16))
def test_an_attachment_is_as_the_document_says_both_ways(
    sequence: int, utc_ns: int, publisher: bytes
) -> None:
    made = Attachment(sequence, utc_ns, publisher).packed()
    assert document.read_attachment(made) == (sequence, utc_ns, publisher)
    assert Attachment.read(document.attachment(sequence, utc_ns, publisher)) == (
        sequence,
        utc_ns,
        publisher,
    )


@given(st.binary(max_size=40))
def test_any_other_attachment_is_refused_in_words(data: bytes) -> None:
    if len(data) == 33 and data[16] == 16:
        return
    with pytest.raises(ValueError, match="bytes, found"):
        Attachment.read(data)


def test_two_publishers_have_two_ids_and_each_always_the_same() -> None:
    assert len(id_of("a")) == 16
    assert id_of("a") == id_of("a") != id_of("b")
