"""`--set key.path=value`: every TOML value arrives as it is, and every mistake is one sentence."""

import re
from datetime import date
from pathlib import Path
from typing import Annotated, Any

import msgspec
import pytest
from hypothesis import given
from hypothesis import strategies as st

from services.runtime.bus.endpoint import EXAMPLE, checked_endpoint
from services.runtime.config.errors import LindyError
from services.runtime.config.settings import convert, line_of, override

NAMES = st.from_regex(r"[a-z][a-z0-9_]{0,8}", fullmatch=True)
NUMBERS = st.one_of(
    st.integers(-(2**63), 2**63 - 1), st.floats(allow_nan=False, allow_infinity=False)
)
WORDS = (
    st.text("abcdefghijklmnopqrstuvwxyz /._", min_size=1)
    .map(str.strip)
    .filter(lambda w: w not in ("", "nan"))
)


class Part(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    size: Annotated[float, msgspec.Meta(gt=0.0, le=1.0)]


def setting(text: str) -> Any:
    tree: dict[str, Any] = {}
    override(tree, [f"key={text}"])
    return tree["key"]


@given(NUMBERS)
def test_a_number_arrives_as_it_is(number: float) -> None:
    found = setting(repr(number))
    assert (found, type(found)) == (number, type(number))


@given(WORDS)
def test_words_need_no_quotes_unless_they_mean_something(text: str) -> None:
    meant = {"true": True, "false": False, "inf": float("inf")}
    assert setting(text) == meant.get(text, text)
    assert setting(f'"{text}"') == text


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("", ""), (" 3 ", 3), ("1_000", 1000), ("0x10", 16), ("1e-3", 1e-3), ("'3'", "3"),
        ("2026-01-02", date(2026, 1, 2)), ("{a = 1}", {"a": 1}), ("a=b", "a=b"), ("[]", []),
        ("1e", "1e"),
    ],
)  # fmt: skip
def test_what_toml_knows_is_read_as_toml(text: str, value: object) -> None:
    assert setting(text) == value


@pytest.mark.parametrize("text", [".5", "-.5", "05", "[1,", "{a=", "'open", '"open', "+.1"])
def test_what_looks_like_a_value_and_is_none_is_refused(text: str) -> None:
    with pytest.raises(LindyError) as refused:
        setting(text)
    sentence = str(refused.value)
    assert sentence.startswith(f"--set key={text}: not valid TOML (")
    assert len(sentence.splitlines()) == 1


@given(st.lists(NAMES, min_size=1, max_size=5), st.integers())
def test_a_path_of_any_length_reaches_its_value_and_changes_nothing_else(
    path: list[str], value: int
) -> None:
    tree: dict[str, Any] = {"Other": {"kp": 1.0}}
    override(tree, [f"{'.'.join(path)} = {value}"])
    inner: Any = tree
    for name in path:
        inner = inner[name]
    assert inner == value
    assert tree["Other"] == {"kp": 1.0}
    assert set(tree) == {"Other", path[0]}


@given(st.lists(st.integers(0, 99), min_size=1, max_size=6))
def test_of_several_for_one_key_the_last_wins(values: list[int]) -> None:
    tree: dict[str, Any] = {}
    override(tree, [f"depth.kp={value}" for value in values])
    assert tree == {"depth": {"kp": values[-1]}}


class Named(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    tables: dict[str, Part] = {}


@pytest.mark.parametrize("wrong", ["a", "b", "c"])
@pytest.mark.parametrize(
    ("table", "sentence"),
    [
        ({"size": -3.0}, "x.tables.{}.size: expected float"),
        ({"sise": 1.0}, "x.tables.{}.sise: unknown key; did you mean 'size'?"),
        (3, "x.tables.{}: expected a table, found 3"),
    ],
)
def test_a_mistake_in_one_of_several_named_tables_says_in_which(
    wrong: str, table: Any, sentence: str
) -> None:
    tree = {"tables": {name: {"size": 1.0} for name in "abc"} | {wrong: table}}
    with pytest.raises(LindyError, match=re.escape(sentence.format(wrong))):
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


@pytest.mark.parametrize(
    "text",
    ["tcp/127.0.0.1:7447", "tcp/[::1]:7447", "udp/rov.local:1", "unixsock-stream//tmp/a.sock",
     "tcp/host:7447#iface=eth0"],
)  # fmt: skip
def test_an_endpoint_is_taken_as_it_is(text: str) -> None:
    assert checked_endpoint(text, "--listen") == text


@pytest.mark.parametrize("text", ["tcp/127.0.0.1:{}", "tls/[::1]:{}", "udp/host:{}#iface=a"])
def test_a_port_that_there_is_not_is_one_sentence(text: str) -> None:
    for port in ("1", "65535"):
        assert checked_endpoint(text.format(port), "--router") == text.format(port)
    for port in ("0", "65536", "99999", "9" * 5000):
        with pytest.raises(LindyError) as refused:
            checked_endpoint(text.format(port), "--router")
        assert str(refused.value).endswith(": no such port, expected one of 1 to 65535")


@pytest.mark.parametrize(
    "text", ["", "127.0.0.1:7447", "tcp/host", "tcp/host:", "tcp/:7447", "tpc/host:7447",
             "tcp/a b:1", "tls/host:7447#enable_mtls=false", "tls/host:7447?enable_mtls=false",
             "tls/host:7447#iface=eth0;enable_mtls=false", "unixsock-stream//a.sock#x=1",
             "ws/host:7447", "unixpipe//tmp/a", "vsock/1:1", "serial//dev/ttyS0"]
)  # fmt: skip
def test_what_is_no_endpoint_is_refused_with_an_example(text: str) -> None:
    with pytest.raises(LindyError) as refused:
        checked_endpoint(text, "--listen")
    assert str(refused.value).startswith(f"--listen {text!r}: expected PROTOCOL/ADDRESS:PORT")
    assert EXAMPLE in str(refused.value)
