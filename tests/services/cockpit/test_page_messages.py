"""What a page may send, and who may connect."""

import json

import pytest
from hypothesis import given
from hypothesis import strategies as st

from services.cockpit.handshake import Access
from services.cockpit.page_messages import PageSticks, parsed


@pytest.mark.parametrize(
    "raw",
    [
        b"", b"{}", b"[]", b"nonsense", b"\xff\xfe", '{"kind":"sticks"}', "[" * 900, "x" * 2000,
        '{"kind":"sticks","seen":1,"held_ms":0,"surge":null,"sway":0,"heave":0,"yaw":0}',
        '{"kind":"sticks","seen":1,"held_ms":0,"surge":NaN,"sway":0,"heave":0,"yaw":0}',
        '{"kind":"sticks","seen":1,"held_ms":0,"surge":1e999,"sway":0,"heave":0,"yaw":0}',
        '{"kind":"sticks","seen":1,"held_ms":0,"surge":1.01,"sway":0,"heave":0,"yaw":0}',
        '{"kind":"sticks","seen":-1,"held_ms":0,"surge":1,"sway":0,"heave":0,"yaw":0}',
        '{"kind":"wish","seen":1,"held_ms":0,"what":"explode"}',
        '{"kind":"wish","seen":1,"held_ms":0,"what":"stop","why":"newer page"}',
    ],
)  # fmt: skip
def test_what_a_page_cannot_have_said_is_none(raw: str | bytes):
    assert parsed(raw) is None


NUMBERS = st.floats(allow_nan=True, allow_infinity=True) | st.none() | st.integers() | st.text()


@given(surge=NUMBERS, held_ms=NUMBERS)
def test_sticks_are_within_their_range_or_none(surge: object, held_ms: object):
    fields = {"surge": surge, "sway": 0, "heave": 0, "yaw": 0, "seen": 1, "held_ms": held_ms}
    message = parsed(json.dumps({"kind": "sticks", **fields}))
    if message is not None:
        assert isinstance(message, PageSticks)
        assert -1.0 <= message.surge <= 1.0
        assert 0.0 <= message.held_ms < 1e10


HERE = Access("http", "127.0.0.1", 8767, local=True)
AWAY = Access("https", "10.0.0.2", 8767, local=False, token="secret")


@pytest.mark.parametrize(
    ("target", "host", "origin", "why"),
    [
        ("/ws/pilot?version=1", "127.0.0.1:8767", "http://127.0.0.1:8767", ""),
        ("/ws/pilot", "localhost:8767", "http://localhost:8767", ""),
        ("/ws/pilot", "[::1]:8767", "http://[::1]:8767", ""),
        ("/main.js", "localhost:8767", None, ""),
        ("/ws/pilot", "127.0.0.1:8767", "http://evil.example", "Origin"),
        ("/ws/pilot", "127.0.0.1:8767", "http://localhost:8767", "Origin"),
        ("/ws/pilot", "127.0.0.1:8767", "null", "Origin"),
        ("/ws/pilot", "127.0.0.1:8767", None, "Origin"),
        ("/ws/pilot", "evil.example:8767", "http://evil.example:8767", "Host"),  # DNS rebinding
        ("/main.js", "evil.example:8767", None, "Host"),
        ("/ws/pilot", None, "http://127.0.0.1:8767", "Host"),
    ],
)  # fmt: skip
def test_only_the_page_itself_may_connect(
    target: str, host: str | None, origin: str | None, why: str
):
    refused = HERE.refusal(target, [host] if host else [], [origin] if origin else [])
    assert (why in refused) if why else refused == ""


@pytest.mark.parametrize(
    ("target", "why"),
    [
        ("/ws/pilot?token=secret", ""),
        (f"/ws/watch?token={AWAY.watch_token}", ""),
        (f"/ws/pilot?token={AWAY.watch_token}", "token"),
        ("/ws/watch?token=secret", "token"),
        ("/ws/video?token=secret", ""),
        (f"/ws/video?token={AWAY.watch_token}", ""),
        ("/ws/pilot", "token"),
        ("/ws/pilot?token=\u2026", "token"),
        ("/ws/pilot?%ff=%zz&token=%", "token"),
        ("/", ""),
    ],
)  # fmt: skip
def test_where_other_machines_reach_it_a_token_is_asked_for(target: str, why: str):
    refused = AWAY.refusal(target, ["rov.local:8767"], ["https://rov.local:8767"])
    assert (why in refused) if why else refused == ""


@pytest.mark.parametrize(
    ("host", "opens"),
    [
        ("192.168.2.2:8767", True), ("[fe80::1]:8767", True), ("blueos.local:8767", True),
        ("blueos:8767", True), ("rov.lan", True), ("BlueOS.Local:8767", True),
        ("evil.example:8767", False), ("192.168.2.2.evil.example", False), ("", False),
        ("[evil", False), ("blueos.local.evil.example", False),
    ],
)  # fmt: skip
def test_where_no_token_is_asked_for_a_page_of_another_site_gets_nothing(host: str, opens: bool):
    """It can let its own name lead to this machine (DNS rebinding), and then says that name."""
    anyone = Access("http", "0.0.0.0", 8767, local=False)
    refused = anyone.refusal("/ws/pilot", [host], [f"http://{host}"])
    assert (refused == "") == opens


def test_the_addresses_that_are_printed():
    assert HERE.pilot_url == "http://127.0.0.1:8767/"
    assert HERE.watch_url == "http://127.0.0.1:8767/watch"
    assert AWAY.pilot_url == "https://10.0.0.2:8767/#secret"
    assert "secret" not in AWAY.watch_url
