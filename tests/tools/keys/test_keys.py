"""`lindy keys`, and what a side says about keys that are no good before it starts."""

import errno
import shutil
from collections.abc import Callable
from datetime import UTC, datetime, timedelta
from pathlib import Path
from unittest.mock import Mock

import pytest
from hypothesis import given
from hypothesis import strategies as st

from services.runtime.config.errors import LindyError
from services.runtime.node.checkpoint import write_safely
from tools.__main__ import main
from tools.keys.authority import KeyAuthority, own_keys
from tools.keys.credentials import is_local, needs_keys, parse

NOW = datetime.now(UTC)
ADMITTED = "admitted.txt"


def keys(place: Path, *words: str) -> int:
    return main(["keys", *words, "--keys", str(place)])


@pytest.fixture
def place(tmp_path: Path) -> Path:
    folder = tmp_path / "keys"
    KeyAuthority(folder).make(NOW)
    for name in ("drone:pioneer", "pilot:ann"):
        KeyAuthority(folder).add(parse(name), NOW, 10)
    return folder


def names(place: Path, bundle: str) -> list[str]:
    lines = (place / bundle / ADMITTED).read_text().splitlines()
    return [line for line in lines if not line.startswith("#")]


def contents(place: Path) -> dict[Path, bytes]:
    return {path: path.read_bytes() for path in place.rglob("*") if path.is_file()}


def said(capsys: pytest.CaptureFixture[str]) -> str:
    """The one sentence on stderr."""
    captured = capsys.readouterr()
    assert len(captured.err.splitlines()) == 1
    assert "Traceback" not in captured.err
    return captured.err


def test_new_makes_keys_for_a_drone_and_a_pilot_that_nobody_else_can_read(tmp_path: Path) -> None:
    place = tmp_path / "keys"
    assert keys(place, "new", "pioneer", "ann") == 0
    for path in (place, *place.rglob("*")):
        assert path.stat().st_mode & 0o777 == (0o700 if path.is_dir() else 0o600), path
    drone, drones = own_keys(place, ("drone",), NOW)
    assert (str(drone.who), drones.admitted) == (
        "drone:pioneer",
        ("pilot:ann",),
    )
    pilot, pilots = own_keys(place, ("pilot",), NOW)
    assert (str(pilot.who), pilots.admitted) == (
        "pilot:ann",
        ("drone:pioneer",),
    )
    assert 729 <= (drone.ends - NOW).days <= 730


def test_who_was_revoked_is_not_taken_for_the_pilot(place: Path) -> None:
    assert keys(place, "add", "pilot", "bob") == 0
    with pytest.raises(LindyError, match="more than one pilot"):
        own_keys(place, ("pilot",), NOW)
    assert keys(place, "revoke", "pilot:ann") == 0
    assert str(own_keys(place, ("pilot",), NOW)[0].who) == "pilot:bob"
    assert keys(place, "revoke", "pilot:bob") == 0
    with pytest.raises(LindyError, match="no keys of pilot in"):
        own_keys(place, ("pilot",), NOW)


def test_nothing_that_is_there_is_ever_overwritten(
    place: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    before = contents(place)
    assert keys(place, "new") == 1
    assert "is there already, and keys are never overwritten" in said(capsys)
    assert keys(place, "add", "pilot", "ann") == 1
    assert "pilot:ann has keys already, or had once; choose another name" in said(capsys)
    (place / "pilot-bob").mkdir()
    assert keys(place, "add", "pilot", "bob") == 1
    assert "is there already" in said(capsys)
    after = contents(place)
    assert {path: after[path] for path in before if path.name != "signed.txt"} == {
        path: data for path, data in before.items() if path.name != "signed.txt"
    }


@pytest.mark.parametrize("whole", [0, 1, 2])
def test_keys_that_could_not_be_written_whole_can_be_made_again(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, whole: int
) -> None:
    written = list[Path]()

    def full(path: Path, data: bytes, mode: int) -> None:
        written.append(path)
        if len(written) > whole:
            raise OSError(errno.ENOSPC, "no space is left")
        write_safely(path, data, mode)

    with monkeypatch.context() as patched:
        patched.setattr("tools.keys.authority.write_safely", full)
        with pytest.raises(LindyError, match="the disk is full"):
            KeyAuthority(tmp_path).make(NOW)
    assert not [*tmp_path.iterdir()]
    KeyAuthority(tmp_path).make(NOW)


def test_who_is_added_is_named_to_those_who_have_a_use_for_it(place: Path) -> None:
    assert keys(place, "add", "observer", "eve", "--days", "5") == 0
    assert keys(place, "add", "drone", "two") == 0
    assert names(place, "drone-pioneer") == ["pilot:ann", "observer:eve"]
    assert names(place, "drone-two") == ["pilot:ann", "observer:eve"]
    assert (
        names(place, "pilot-ann") == names(place, "observer-eve") == ["drone:pioneer", "drone:two"]
    )


def test_who_is_revoked_is_on_no_list_and_never_comes_back(
    place: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert keys(place, "revoke", "pilot:ann") == 0
    assert names(place, "drone-pioneer") == []
    capsys.readouterr()
    assert keys(place, "list") == 0
    assert "pilot:ann" in (shown := capsys.readouterr().out)
    assert shown.splitlines()[1].endswith("revoked")
    shutil.rmtree(place / "pilot-ann")
    assert keys(place, "add", "pilot", "ann") == 1  # the old certificate would be good again
    assert "or had once" in said(capsys)
    assert keys(place, "add", "drone", "two") == 0
    assert names(place, "drone-two") == []


def test_on_the_drone_itself_revoking_needs_no_authority(
    place: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    on_board = tmp_path / "on_board"
    shutil.copytree(place / "drone-pioneer", on_board / "drone-pioneer")
    assert keys(on_board, "revoke", "pilot:ann") == 0
    assert own_keys(on_board, ("drone",), NOW)[1].admitted == ()
    capsys.readouterr()
    assert keys(on_board, "revoke", "pilot:ann") == 1
    assert "pilot:ann is on no list in" in said(capsys)
    assert keys(on_board, "add", "pilot", "bob") == 1
    assert "there is no authority in" in said(capsys)


@pytest.mark.parametrize("times", [1, 3])
def test_a_certificate_that_has_ended_is_renewed_for_the_same_key(place: Path, times: int) -> None:
    later, before = NOW + timedelta(days=11), contents(place)
    with pytest.raises(LindyError, match="`lindy keys add drone pioneer --again`"):
        own_keys(place, ("drone",), later)
    renewed = [KeyAuthority(place).renew(parse("drone:pioneer"), later, 20) for _ in range(times)]
    made = renewed[-1]
    found = own_keys(place, ("drone",), later + timedelta(days=9))[0]
    assert str(found.who) == "drone:pioneer"
    assert abs(found.ends - later - timedelta(days=20)) < timedelta(seconds=2)
    after = contents(place)
    assert after[made] != before[made]
    assert after.keys() == before.keys()
    assert {path: after[path] for path in before if path != made} == {
        path: data for path, data in before.items() if path != made
    }


def test_who_was_revoked_or_is_of_another_authority_is_not_renewed(
    place: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    other = place.with_name("other")
    KeyAuthority(other).make(NOW)
    KeyAuthority(other).add(parse("drone:pioneer"), NOW, 10)
    copy(other / "drone-pioneer", place / "drone-pioneer/certificate.pem")
    assert keys(place, "add", "drone", "pioneer", "--again") == 1
    assert "is from another authority" in said(capsys)
    assert keys(place, "revoke", "pilot:ann") == 0
    capsys.readouterr()
    assert keys(place, "add", "pilot", "ann", "--again") == 1
    assert "pilot:ann was revoked, and its name is never given again" in said(capsys)
    assert keys(place, "add", "pilot", "ann") == 1
    assert "--again" not in said(capsys)


@pytest.mark.parametrize(
    ("words", "sentence"),
    [
        (["add", "king", "ann"], "unknown role 'king', expected drone, pilot, observer, router"),
        (["add", "pilot", "Ann!"], "'Ann!' is no name: it may have letters without"),
        (["add", "pilot", "bob", "--days", "731"], "--days is 731, expected 1 to 730"),
        (["add", "pilot", "bob", "--days", "0"], "--days is 0, expected 1 to 730"),
        (["revoke", "ann"], "'ann' is not ROLE:NAME, such as pilot:ann"),
        (["revoke", "pilot:zed"], "has no keys of pilot:zed"),
        (["add", "pilot", "ann"], "make them last: `lindy keys add pilot ann --again`"),
        (["add", "pilot", "zed", "--again"], "has no keys of pilot:zed"),
        (["add", "pilot", "ann", "--again", "--days", "731"], "--days is 731, expected 1 to 730"),
    ],
)
def test_a_mistake_is_one_sentence_and_changes_nothing(
    place: Path, words: list[str], sentence: str, capsys: pytest.CaptureFixture[str]
) -> None:
    before = contents(place)
    assert keys(place, *words) == 1
    assert sentence in said(capsys)
    assert contents(place) == before


# What a side says before it starts.


def copy(source: Path, *to: Path) -> None:
    for path in to:
        shutil.copy(source if source.is_file() else source / path.name, path)


def a_folder(path: Path) -> None:
    path.unlink()
    path.mkdir()


def of_another_authority(place: Path, drone: Path) -> None:
    other = place.with_name("other")
    KeyAuthority(other).make(NOW)
    copy(other / "authority", drone / "ca.pem")


SPOILT: dict[str, Callable[[Path, Path], object]] = {  # of all keys, and of the drone's
    "ca.pem": lambda _, drone: (drone / "ca.pem").unlink(),
    "certificate.pem": lambda _, drone: (drone / "certificate.pem").unlink(),
    "key.pem": lambda _, drone: (drone / "key.pem").unlink(),
    ADMITTED: lambda _, drone: (drone / ADMITTED).unlink(),
    "foreign": of_another_authority,
    "self-signed": lambda place, drone: copy(place / "authority/ca.pem", drone / "certificate.pem"),
    "role": lambda place, drone: copy(
        place / "pilot-ann", drone / "certificate.pem", drone / "key.pem"
    ),
    "another's key": lambda place, drone: copy(place / "pilot-ann", drone / "key.pem"),
    "open": lambda _, drone: (drone / "key.pem").chmod(0o644),
    "anybody's list": lambda _, drone: (drone / ADMITTED).chmod(0o666),
    "anybody's folder": lambda _, drone: drone.chmod(0o777),
    "folder": lambda _, drone: a_folder(drone / "key.pem"),
    "list": lambda _, drone: (drone / ADMITTED).write_text("pilot:ann\neverybody\n"),
    "two": lambda place, _: KeyAuthority(place).add(parse("drone:two"), NOW, 10),
    "none": lambda _, drone: shutil.rmtree(drone),
    "all": lambda place, _: shutil.rmtree(place),
}


@pytest.mark.parametrize(
    ("how", "sentence"),
    [
        ("ca.pem", "ca.pem is missing: copy the whole folder"),
        ("certificate.pem", "certificate.pem is missing: copy the whole folder"),
        ("key.pem", "key.pem is missing: copy the whole folder"),
        (ADMITTED, "admitted.txt is missing: copy the whole folder"),
        ("foreign", "certificate.pem: is from another authority than that of ca.pem"),
        ("self-signed", "certificate.pem: 'lindy keys' is not ROLE:NAME, such as pilot:ann"),
        ("role", "certificate.pem is that of pilot:ann, allowed: of drone"),
        ("another's key", "key.pem: does not belong to certificate.pem"),
        ("open", "key.pem can be read by others on this computer: chmod 600"),
        ("anybody's list", "admitted.txt can be written by others on this computer: chmod o-w"),
        ("anybody's folder", "drone-pioneer can be written by others on this computer: chmod"),
        ("folder", "key.pem: is a directory"),
        ("list", "admitted.txt: line 2: 'everybody' is not ROLE:NAME, such as pilot:ann"),
        ("two", "more than one drone (drone-pioneer, drone-two); name one: --keys"),
        ("none", "no keys of drone in"),
        ("all", "no keys of drone in"),
    ],
)
def test_keys_that_are_no_good_are_one_sentence_before_anything_starts(
    place: Path, tmp_path: Path, how: str, sentence: str, capsys: pytest.CaptureFixture[str]
) -> None:
    SPOILT[how](place, place / "drone-pioneer")
    out = tmp_path / "out"
    for verb in (["up", "drone"], ["dive"]):
        words = [*verb, "--listen", "tls/127.0.0.1:1", "--keys", str(place), "--out", str(out)]
        assert main(words) == 1
        assert sentence in said(capsys)
    assert not out.exists()


@pytest.mark.parametrize(
    ("later", "sentence"),
    [(timedelta(days=-3000), "set the clock"), (timedelta(days=11), "was valid until")],
)
def test_a_certificate_out_of_its_time_is_one_sentence(
    place: Path, later: timedelta, sentence: str
) -> None:
    with pytest.raises(LindyError, match=sentence):
        own_keys(place, ("drone",), NOW + later)


def test_without_the_library_the_sentence_says_how_to_install_it(
    place: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr("tools.packages.find_spec", Mock(return_value=None))
    for words in (["keys", "list"], ["up", "topside", "--connect", "tls/127.0.0.1:1"]):
        assert main([*words, "--keys", str(place)]) == 1
        assert "needs cryptography, which is not installed" in said(capsys)


# Where keys are needed.

HOST = st.one_of(
    st.ip_addresses(v=4).map(str),
    st.ip_addresses(v=6).map(lambda ip: f"[{ip}]"),
    st.from_regex(r"[a-z]{1,8}(\.[a-z]{2,4})?", fullmatch=True),
)
MORE = st.sampled_from(["", "#iface=eth0", "?prio=1", "#a=127.0.0.1:1"])
ENDPOINT = st.builds(
    "{}/{}:7447{}".format, st.sampled_from(["tcp", "udp", "quic", "ws"]), HOST, MORE
)


@given(ENDPOINT)
def test_over_the_network_there_are_keys_or_it_was_said_that_there_are_none(endpoint: str) -> None:
    host = endpoint.partition("/")[2].rpartition(":7447")[0].strip("[]")
    loopback = host in ("localhost", "::1") or host.startswith("127.")
    assert is_local(endpoint) == loopback
    assert needs_keys(endpoint, "--listen", insecure=True) is False
    if loopback:
        assert needs_keys(endpoint, "--listen", insecure=False) is False
    else:
        with pytest.raises(LindyError, match="goes over the network without keys"):
            needs_keys(endpoint, "--listen", insecure=False)


@given(HOST, MORE)
def test_tls_always_has_keys(host: str, more: str) -> None:
    endpoint = f"tls/{host}:7447{more}"
    assert needs_keys(endpoint, "--connect", insecure=False)
    with pytest.raises(LindyError, match="tls always has keys"):
        needs_keys(endpoint, "--connect", insecure=True)


@pytest.mark.parametrize(
    ("endpoint", "local"),
    [("unixsock-stream//tmp/a.sock", True), ("tcp/localhost:1", True), ("tcp/[::1]:1", True),
     ("tcp/127.8.8.8:1", True), ("tcp/0.0.0.0:1", False), ("tcp/[::]:1", False),
     ("serial//dev/ttyS0", False), ("vsock/1:1", False), ("tcp/localhost.example:1", False)],
)  # fmt: skip
def test_what_only_this_machine_can_reach(endpoint: str, local: bool) -> None:
    assert is_local(endpoint) == local


@pytest.mark.parametrize(
    "words",
    [["up", "drone", "--listen"], ["up", "topside", "--connect"], ["dive", "--listen"], ["hub"],
     ["up", "topside", "--gateway", "--connect"]],
)  # fmt: skip
def test_no_verb_opens_a_port_of_the_network_without_keys(
    words: list[str], capsys: pytest.CaptureFixture[str]
) -> None:
    assert main([*words, "tcp/192.0.2.1:7447"]) == 1
    assert "or add --insecure" in said(capsys)
