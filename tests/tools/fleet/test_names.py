"""What drones may be called, which one a pilot means, and where they meet with which keys."""

from datetime import UTC, datetime
from pathlib import Path
from socket import gethostname

import pytest
from hypothesis import given
from hypothesis import strategies as st

from services.runtime.bus.spaces import (
    LONGEST,
    Here,
    checked_name,
    here_key,
    here_of,
    name_in,
    namespace,
)
from services.runtime.config.errors import LindyError
from services.runtime.config.stack import Stack
from tools.__main__ import main
from tools.fleet.network import Meeting, drones_credentials, drones_name, own_name
from tools.keys.authority import KeyAuthority
from tools.keys.credentials import parse

LETTERS = "[A-Za-z0-9_.-]"
NAME = st.from_regex(rf"{LETTERS}{{0,27}}[A-Za-z0-9]{LETTERS}{{0,27}}", fullmatch=True)
SIDE = st.sampled_from(["drone", "topside"])
INSTANCE = st.from_regex(r"[0-9a-f]{1,16}", fullmatch=True)


@given(NAME, SIDE, INSTANCE)
def test_a_name_is_read_from_its_keys_as_it_was_written(name: str, side: str, start: str) -> None:
    assert checked_name(name, "--name") == name
    token = here_key(namespace(name), side, start)
    assert here_of(token) == Here(name, side, start)
    assert name_in(token) == name_in(f"{namespace(name)}/state") == name


@given(st.one_of(st.text(max_size=80), st.sampled_from([*"*$?#/@._-", "..", "..."])))
def test_what_is_no_name_is_refused_in_one_sentence_and_is_in_no_key(text: str) -> None:
    needed = set("abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789")
    allowed = needed | set("-_.")
    if 1 <= len(text) <= LONGEST and set(text) <= allowed and set(text) & needed:
        assert checked_name(text, "--name") == text
        return
    with pytest.raises(
        LindyError, match=r"--name .*1 to 55 of them; a name has a letter or digit"
    ) as refused:
        checked_name(text, "--name")
    assert "\n" not in str(refused.value)
    assert here_of(here_key(namespace(text), "drone", "1")) is None
    assert name_in(f"{namespace(text)}/state") != text or not text


@given(st.text(max_size=200))
def test_a_strangers_key_is_no_hub_of_ours(key: str) -> None:
    here = here_of(key)
    assert here is None or here_key(namespace(here.name), here.side, here.instance) == key
    assert len(name_in(key)) <= LONGEST


@given(st.from_regex(r"[a-z0-9][a-z0-9_]{0,79}", fullmatch=True), st.text(max_size=100))
def test_every_computer_gives_its_drone_a_good_name(vehicle: str, host: str) -> None:
    name = own_name(vehicle, host)
    assert checked_name(name, "") == name
    assert name.startswith(vehicle[:LONGEST])


def test_a_drone_is_named_by_its_type_and_the_computers_own_name() -> None:
    assert own_name("pioneer", "boat.example.org") == "pioneer-boat"
    assert own_name("pioneer", "Käpt'n's rov") == "pioneer-K-pt-n-s-rov"
    assert own_name("pioneer", "") == "pioneer"


NOW = datetime.now(UTC)
LISTEN, ROUTER = "tls/127.0.0.1:7447", "tls/127.0.0.1:7448"


@pytest.fixture(scope="module")
def keys(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("keys")
    KeyAuthority(folder).make(NOW)
    for name in ("drone:boat", "pilot:ann", "router:base"):
        KeyAuthority(folder).add(parse(name), NOW, 10)
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
        (["fly", "a*b"], "a drone's name"),
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
