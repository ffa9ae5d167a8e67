"""Settings: a mistake gets one sentence with the file, the line, the key and what is allowed."""

import re
from pathlib import Path
from typing import Annotated, Any

import msgspec
import pytest
from hypothesis import given
from hypothesis import strategies as st

from services.camera.core import Settings as Camera
from services.runtime.bus.spaces import EXAMPLE, checked_endpoint
from services.runtime.config.errors import LindyError
from services.runtime.config.settings import (
    convert,
    deploy_file,
    line_of,
    override,
    read,
    read_toml,
)
from services.runtime.config.stack import Stack
from services.runtime.hosts.registry import Registry
from services.simulator.core import Settings as Simulator
from tools.checks import known_tables


class Depth(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    kp: Annotated[float, msgspec.Meta(gt=0.0)] = 1.0
    kd: float = 0.0
    # [m/s] what stands above the field counts as well
    speed: Annotated[
        float,
        msgspec.Meta(le=5.0),
    ] = 1.0
    rest: Annotated[float, msgspec.Meta(ge=0.5)] = 1.0  # [s] at the bottom


class Part(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    name: str
    size: float = 1.0


class Some(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    depth: Depth = Depth()
    name: str = ""
    part: list[Part] = []
    places: list[tuple[float, float]] = []

    def __post_init__(self) -> None:
        if len({part.name for part in self.part}) < len(self.part):
            raise ValueError("part number 1 and part number 2 are the same")


TWO_PARTS = "[[part]]\nname = 'a'\n[[part]]  # another\nname = 'b'"


def file(folder: Path, text: str) -> Path:
    path = folder / "some.toml"
    path.write_text(text)
    return path


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        ("[depth]\nkp = 2.0\nkpp = 1.0", r"some.toml:3: depth.kpp: unknown key; did you mean 'kp'"),
        ("depth.speed = 9", "depth.speed: expected a number <= 5.0 m/s, found 9"),
        ("depth.rest = 0.1", "depth.rest: expected a number >= 0.5 s, found 0.1"),
        ("[depth]\nkp = -2.0", r"some.toml:2: depth.kp: expected a number > 0.0, found -2.0"),
        ("name = 3", r"some.toml:1: name: expected text, found 3"),
        ("[depth\nkp = 1", r"some.toml: not valid TOML: .*line 1"),
        (
            "[deep]\nkp = 1.0",
            r"some.toml:1: deep: unknown key; did you mean 'depth'\? known: depth",
        ),
        (
            "name = 'a'\n\n[[part]]\nsize = 2.0",
            r"toml:3: part number 1: the key name is missing; known: name, size",
        ),
        (f"{TWO_PARTS}\nsize = 'x'", r"toml:5: part number 2, size: expected a number, found 'x'"),
        (f"{TWO_PARTS}\n[depth.kp]", r"toml:5: depth.kp: expected a number"),
        (
            "places = [\n  [0, 1],\n  [0],\n]",
            r"toml:1: places number 2: expected an array of length 2",
        ),
        (
            "[[part]]\nname='a'\n[[part]]\nname='a'",
            r"this file: part number 1 and part number 2 are the same",
        ),
        ("depth = 3", r"toml:1: depth: expected a table, found 3; its keys: kd, kp"),
    ],
)
def test_a_mistake_is_named(tmp_path: Path, text: str, sentence: str) -> None:
    with pytest.raises(LindyError, match=sentence):
        read(file(tmp_path, text), Some)


@pytest.mark.parametrize(
    ("assignment", "sentence"),
    [
        ("simulator.waves={hieght=0.3,period=4}", r"simulator.waves.hieght: .*mean 'height'\?"),
        ("simulator.hull.masss=1", r"unknown key; did you mean 'mass'\? known: added_mass"),
        (
            "simulator.vibration=-1",
            r"expected a table, found -1; its keys: blades, force, knock, rate, speed",
        ),
        ("simulator.waves={height=0.3}", r"the key period is missing; known: begins, .*period"),
        ("simulator.waves.height=0.3", r": simulator.waves: the key period is missing"),
    ],
)
def test_a_mistake_in_an_optional_table_says_what_it_knows(assignment: str, sentence: str) -> None:
    with pytest.raises(LindyError, match=sentence) as refused:
        Stack(overrides=[assignment]).section("simulator", Simulator)
    assert str(refused.value).startswith(f"--set {assignment}: ")


@pytest.mark.parametrize("bad", ["depth", "=3", "name.first=3"])
def test_a_malformed_override_is_refused(bad: str) -> None:
    with pytest.raises(LindyError, match=f"--set {bad}"):
        override({"name": "x"}, [bad])


@pytest.mark.parametrize("path", ["/tmp", "/dev/null", "./mine"])
def test_a_path_that_is_no_file_of_the_kind_is_said(path: str) -> None:
    with pytest.raises(LindyError, match=rf"^{path} is no .toml file: give a name in deploy/veh"):
        deploy_file("vehicles", path)


@pytest.mark.parametrize(
    ("assignments", "guilty", "why"),
    [
        (["more.Down.tilt=1"], 0, r"cannot be called 'Down'; allowed are a to z, 0 to 9 and _"),
        (["width=320", "more.Down.tilt=1", "rate=10"], 1, "cannot be called 'Down'"),
        (["least_kbit=900", "most_kbit=500"], 1, "least_kbit is 900, expected at most most_kbit"),
    ],
)
def test_a_mistake_of_a_whole_table_is_of_the_option_that_made_it(
    assignments: list[str], guilty: int, why: str
) -> None:
    overrides = [f"camera.{assignment}" for assignment in assignments]
    with pytest.raises(LindyError, match=rf"^--set {overrides[guilty]}: camera: .*{why}"):
        Stack(overrides=overrides).section("camera", Camera)


def test_a_mistake_of_a_table_in_the_file_is_the_file_s(tmp_path: Path) -> None:
    pioneer = deploy_file("vehicles", "pioneer").read_text()
    path = file(tmp_path, f"{pioneer}\n[camera]\nleast_kbit = 900\nmost_kbit = 500\n")
    with pytest.raises(LindyError, match=r"some.toml:\d+: camera: least_kbit is 900"):
        Stack(vehicle=str(path), overrides=["camera.rate=10"]).section("camera", Camera)


def test_an_unknown_table_is_refused_with_its_option_or_its_line(tmp_path: Path) -> None:
    known = known_tables(Registry.read())
    option = r"^--set contol\.depth\.kp=3: contol: unknown table .* did you mean 'control'"
    with pytest.raises(LindyError, match=option):
        Stack(overrides=["contol.depth.kp=3"]).check(known)
    pioneer = deploy_file("vehicles", "pioneer").read_text()
    last = len(pioneer.splitlines())
    path = file(tmp_path, f"{pioneer}\n[contol]\nx = 1\n")
    with pytest.raises(LindyError, match=rf"some.toml:{last + 2}: contol: unknown table"):
        Stack(vehicle=str(path), overrides=["contol.y=3"]).check(known)


def test_two_thrusters_of_one_name_are_refused(tmp_path: Path) -> None:
    pioneer = deploy_file("vehicles", "pioneer").read_text()
    path = file(tmp_path, pioneer.replace('name = "starboard"', 'name = "port"'))
    with pytest.raises(LindyError, match=r"number 1 and .* 2 are both called 'port'"):
        Stack(vehicle=str(path)).check(known_tables(Registry.read()))


@pytest.mark.parametrize(
    ("text", "said"),
    [(f"a = {'[' * 100_000}", "tables or arrays too deep"),
     ("# " + "a" * 1_000_000, "1000002 letters, at most 1000000 are allowed")],
)  # fmt: skip
def test_a_file_too_long_or_too_deep_is_refused(tmp_path: Path, text: str, said: str) -> None:
    path = tmp_path / "bomb.toml"
    path.write_text(text)
    with pytest.raises(LindyError) as refused:
        read_toml(path)
    assert str(refused.value) == f"{path}: not valid TOML: {said}"


def test_a_file_may_begin_with_the_mark_of_an_editor_on_windows(tmp_path: Path) -> None:
    path = tmp_path / "marked.toml"
    path.write_bytes(b"\xef\xbb\xbfkp = 3\r\n")
    assert read_toml(path) == {"kp": 3}


# `--set key.path=value`: every TOML value arrives as it is, and every mistake is one sentence.


NAMES = st.from_regex(r"[a-z][a-z0-9_]{0,8}", fullmatch=True)
WORDS = (
    st.text("abcdefghijklmnopqrstuvwxyz /._", min_size=1)
    .map(str.strip)
    .filter(lambda w: w not in ("", "nan"))
)


class Sized(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    size: Annotated[float, msgspec.Meta(gt=0.0, le=1.0)]


def setting(text: str) -> Any:
    tree: dict[str, Any] = {}
    override(tree, [f"key={text}"])
    return tree["key"]


@given(WORDS)
def test_words_need_no_quotes_unless_they_mean_something(text: str) -> None:
    meant = {"true": True, "false": False, "inf": float("inf")}
    assert setting(text) == meant.get(text, text)
    assert setting(f'"{text}"') == text


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("", ""), (" 3 ", 3), ("0x10", 16), ("1e-3", 1e-3), ("'3'", "3"), ("{a = 1}", {"a": 1}),
        ("a=b", "a=b"), ("1e", "1e"),
    ],
)  # fmt: skip
def test_what_toml_knows_is_read_as_toml(text: str, value: object) -> None:
    assert setting(text) == value


@pytest.mark.parametrize("text", [".5", "05", "[1,", "{a=", "'open", '"open'])
def test_what_looks_like_a_value_and_is_none_is_refused(text: str) -> None:
    with pytest.raises(LindyError) as refused:
        setting(text)
    sentence = str(refused.value)
    assert sentence.startswith(f"--set key={text}: not valid TOML (")
    assert len(sentence.splitlines()) == 1


@given(st.lists(NAMES, min_size=1, max_size=5), st.integers())
def test_a_path_of_any_length_reaches_its_value_alone(path: list[str], value: int) -> None:
    tree: dict[str, Any] = {"Other": {"kp": 1.0}}
    override(tree, [f"{'.'.join(path)} = {value}"])
    inner: Any = tree
    for name in path:
        inner = inner[name]
    assert inner == value
    assert tree["Other"] == {"kp": 1.0}
    assert set(tree) == {"Other", path[0]}


class Named(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    tables: dict[str, Sized] = {}


@pytest.mark.parametrize(
    ("table", "sentence"),
    [
        ({"size": -3.0}, "x.tables.b.size: expected a number"),
        ({"sise": 1.0}, "x.tables.b.sise: unknown key; did you mean 'size'?"),
        (3, "x.tables.b: expected a table, found 3"),
    ],
)
def test_a_mistake_in_one_of_several_named_tables_says_in_which(table: Any, sentence: str) -> None:
    tree = {"tables": {name: {"size": 1.0} for name in "abc"} | {"b": table}}
    with pytest.raises(LindyError, match=re.escape(sentence)):
        convert(tree, Named, "x")


@given(st.lists(NAMES, min_size=1, max_size=8, unique=True), st.integers(0, 3))
def test_the_line_of_a_table_and_of_a_key_is_where_they_stand(
    tmp_path_factory: pytest.TempPathFactory, names: list[str], blank: int
) -> None:
    path: Path = tmp_path_factory.getbasetemp() / "lines.toml"
    block = "\n" * blank
    path.write_text("".join(f"{block}[{name}]\n{name}_x = 1\n" for name in names))
    for number, name in enumerate(names):
        heading = number * (2 + blank) + blank + 1
        assert line_of(path, (name,)) == f":{heading}"
        assert line_of(path, (name, f"{name}_x")) == f":{heading + 1}"
        assert line_of(path, (name, "missing")) == f":{heading}"
        assert line_of(path, (name, "missing"), exact=True) == ""
    path.unlink()
    assert line_of(path, (names[0],)) == ""  # of a recorded dive, flown again in another folder


def test_what_a_string_of_several_lines_says_is_no_key(tmp_path: Path) -> None:
    path = tmp_path / "mine.toml"
    path.write_text('[a]\ntext = """\nmass = 1\n"""\nmass = 2\n')
    assert line_of(path, ("a", "mass")) == ":5"


def test_an_endpoint_is_taken_as_it_is_unless_there_is_no_such_port() -> None:
    for text in ("unixsock-stream//tmp/a.sock", "udp/rov.local:1", "tcp/host:7447#iface=eth0"):
        assert checked_endpoint(text, "--listen") == text
    for text in ("tcp/127.0.0.1:{}", "tls/[::1]:{}", "udp/host:{}#iface=a"):
        assert checked_endpoint(text.format(65535), "--router") == text.format(65535)
        for port in ("0", "65536", "9" * 5000):
            with pytest.raises(LindyError, match=r"no such port, expected one of 1 to 65535$"):
                checked_endpoint(text.format(port), "--router")


@pytest.mark.parametrize(
    "text", ["", "127.0.0.1:7447", "tcp/host", "tcp/:7447", "tcp/a b:1", "ws/host:7447",
             "tls/host:7447#enable_mtls=false", "tls/host:7447?enable_mtls=false",
             "tls/host:7447#iface=eth0;enable_mtls=false", "unixsock-stream//a.sock#x=1"]
)  # fmt: skip
def test_what_is_no_endpoint_is_refused_with_an_example(text: str) -> None:
    with pytest.raises(LindyError) as refused:
        checked_endpoint(text, "--listen")
    assert str(refused.value).startswith(f"--listen {text!r}: expected PROTOCOL/ADDRESS:PORT")
    assert EXAMPLE in str(refused.value)
