"""Settings: a mistake gets one sentence with the file, the line, the key and what is allowed."""

from pathlib import Path
from typing import Annotated

import msgspec
import pytest

from services.runtime.errors import LindyError
from services.runtime.registry import Registry
from services.runtime.settings import convert, deploy_file, override, read
from services.runtime.stack import Stack
from tools.checks import known_tables


class Depth(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    kp: Annotated[float, msgspec.Meta(gt=0.0)] = 1.0
    kd: float = 0.0


class Some(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    depth: Depth = Depth()
    name: str = ""


def file(folder: Path, text: str) -> Path:
    path = folder / "some.toml"
    path.write_text(text)
    return path


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        ("[depth]\nkp = 2.0\nkpp = 1.0", r"some.toml:3: depth.kpp: unknown key; did you mean 'kp'"),
        ("[depth]\nkp = -2.0", r"some.toml:2: depth.kp: expected float > 0.0, found -2.0"),
        ("name = 3", r"some.toml:1: name: expected str, got int, found 3"),
        ("[depth\nkp = 1", r"some.toml: not valid TOML: .*line 1"),
        ("[deep]\nkp = 1.0", r"some.toml: deep: unknown key; did you mean 'depth'\? known: depth"),
        ("depth = 3", r"some.toml:1: depth: expected object, got int, found 3"),
    ],
)
def test_a_mistake_is_named(tmp_path: Path, text: str, sentence: str) -> None:
    with pytest.raises(LindyError, match=sentence):
        read(file(tmp_path, text), Some)


def test_a_missing_file_is_named(tmp_path: Path) -> None:
    with pytest.raises(LindyError, match=r"cannot read .*none.toml: No such file"):
        read(tmp_path / "none.toml", Some)


def test_overrides_reach_into_tables() -> None:
    tree = {"depth": {"kp": 1.0}}
    override(tree, ["depth.kp=3", "name=deep water", "depth.kd = 0.5"])
    assert convert(tree, Some, "") == Some(Depth(3.0, 0.5), "deep water")


@pytest.mark.parametrize("bad", ["depth", "=3", "name.first=3"])
def test_a_malformed_override_is_refused(bad: str) -> None:
    with pytest.raises(LindyError, match=f"--set {bad}"):
        override({"name": "x"}, [bad])


def test_an_unknown_vehicle_suggests_the_nearest() -> None:
    with pytest.raises(LindyError, match=r"unknown vehicle 'pionere'; did you mean 'pioneer'"):
        deploy_file("vehicles", "pionere")


@pytest.mark.parametrize("vehicle", ["pioneer"])
def test_every_shipped_vehicle_is_valid(vehicle: str) -> None:
    Stack(vehicle=vehicle).check(known_tables(Registry.read()))


def test_an_unknown_table_is_refused() -> None:
    with pytest.raises(LindyError, match=r"contol: unknown table; did you mean 'control'"):
        Stack(overrides=["contol.depth.kp=3"]).check(known_tables(Registry.read()))


def test_a_value_out_of_limits_stops_the_dive_before_it_starts() -> None:
    with pytest.raises(LindyError, match=r"^--set vehicle.mass=-1: expected float > 0.0, found -1"):
        Stack(overrides=["vehicle.mass=-1"]).check(known_tables(Registry.read()))
