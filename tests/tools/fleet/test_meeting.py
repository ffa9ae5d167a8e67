"""Where a drone meets its pilots, by which name and with which keys; and a router's file."""

from datetime import UTC, datetime
from pathlib import Path
from socket import gethostname

import pytest

from services.runtime.config.errors import LindyError
from services.runtime.config.stack import Stack
from tools.__main__ import main
from tools.fleet.meeting import Meeting, drones_credentials, drones_name
from tools.fleet.names import own_name
from tools.keys import authority
from tools.keys.roles import parse

NOW = datetime.now(UTC)
LISTEN, ROUTER = "tls/127.0.0.1:7447", "tls/127.0.0.1:7448"


@pytest.fixture(scope="module")
def keys(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("keys")
    authority.new(folder, NOW)
    for name in ("drone:boat", "pilot:ann", "router:base"):
        authority.add(folder, parse(name), NOW, 10)
    return folder


def test_a_drone_is_called_what_is_said_else_as_its_keys_else_by_its_computer(keys: Path) -> None:
    credentials = drones_credentials(LISTEN, None, keys, insecure=False)
    tcp = drones_credentials("tcp/127.0.0.1:1", None, keys, insecure=False)
    assert tcp is None
    with_keys, without = Meeting(LISTEN, None, credentials), Meeting("tcp/127.0.0.1:1", None, None)
    assert drones_name(Stack(name="x"), without) == "x"
    assert drones_name(Stack(), with_keys) == "boat"
    assert drones_name(Stack(), without) == own_name("pioneer", gethostname())


@pytest.mark.parametrize(("listen", "router"), [(LISTEN, None), (None, ROUTER)])
def test_with_keys_a_drone_has_the_name_of_its_keys(
    keys: Path, listen: str | None, router: str | None
) -> None:
    meeting = Meeting(listen, router, drones_credentials(listen, router, keys, insecure=False))
    assert drones_name(Stack(name="boat"), meeting) == drones_name(Stack(), meeting) == "boat"
    with pytest.raises(LindyError, match="keys are those of drone:boat, and it is believed by"):
        drones_name(Stack(name="x"), meeting)


def test_both_ways_in_have_keys_or_none_has(keys: Path) -> None:
    both = drones_credentials(LISTEN, ROUTER, keys, insecure=False)
    assert both is not None
    assert Meeting(LISTEN, ROUTER, both).link == f"{LISTEN} and {ROUTER}"
    with pytest.raises(LindyError, match="both with tls, or none of them"):
        drones_credentials("tcp/127.0.0.1:7447", ROUTER, keys, insecure=False)


@pytest.mark.parametrize(
    ("words", "why"),
    [
        (["up", "topside", "--connect", "tcp/127.0.0.1:1", "--router", "tcp/127.0.0.1:2"],
         "one of them is enough"),
        (["fly", "a*b"], "a drone's name"),
        (["fly", "a", "--name", "b"], "is said once"),
        (["up", "drone", "--router", "tcp/192.168.2.2:7447"], "over the network without keys"),
    ],
)  # fmt: skip
def test_a_command_that_means_two_things_or_none_is_one_sentence(
    words: list[str], why: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(words) == 1
    complaint = capsys.readouterr().err
    assert why in complaint
    assert complaint.count("\n") == 1
