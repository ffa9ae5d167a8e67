"""Settings: a mistake gets one sentence with the file, the line, the key and what is allowed."""

from pathlib import Path
from typing import Annotated

import msgspec
import pytest

from services.camera.core import Settings as Camera
from services.runtime.config.errors import LindyError
from services.runtime.config.settings import GONE, deploy_file, override, read, read_toml
from services.runtime.config.stack import Stack
from services.runtime.hosts.registry import Registry
from services.simulator.core import Settings as Simulator
from tools.checks import known_tables


class Depth(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    kp: Annotated[float, msgspec.Meta(gt=0.0)] = 1.0
    kd: float = 0.0


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
        ("[depth]\nkp = -2.0", r"some.toml:2: depth.kp: expected float > 0.0, found -2.0"),
        ("name = 3", r"some.toml:1: name: expected str, got int, found 3"),
        ("[depth\nkp = 1", r"some.toml: not valid TOML: .*line 1"),
        (
            "[deep]\nkp = 1.0",
            r"some.toml:1: deep: unknown key; did you mean 'depth'\? known: depth",
        ),
        (
            "name = 'a'\n\n[[part]]\nsize = 2.0",
            r"toml:3: part number 1: the key name is missing; known: name, size",
        ),
        (f"{TWO_PARTS}\nsize = 'x'", r"toml:5: part number 2, size: expected float, got str"),
        (f"{TWO_PARTS}\nsizes = 1.0", r"toml:5: part number 2, sizes: unknown key"),
        (f"{TWO_PARTS}\n[depth.kp]", r"toml:5: depth.kp: expected float"),
        (
            "places = [\n  [0, 1],\n  [0],\n]",
            r"toml:1: places number 2: expected array of length 2",
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
        ("simulator.mounting={foo=1}", r"simulator.mounting.foo: .*known: altimeter, dvl, imu"),
        ("simulator.water_density={temp=3}", r"density.temp: .*known: salinity, temperature"),
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


@pytest.mark.parametrize(("key", "instead"), GONE.items())
def test_a_key_of_an_earlier_version_says_what_to_use_instead(key: str, instead: str) -> None:
    assignment = f"{key}=1"
    with pytest.raises(LindyError) as refused:
        Stack(overrides=[assignment]).check(known_tables(Registry.read()))
    assert str(refused.value) == f"--set {assignment}: this key is gone: {instead}"


def test_a_missing_file_is_named(tmp_path: Path) -> None:
    with pytest.raises(LindyError, match=r"cannot read .*none.toml: No such file"):
        read(tmp_path / "none.toml", Some)


@pytest.mark.parametrize("bad", ["depth", "=3", "name.first=3"])
def test_a_malformed_override_is_refused(bad: str) -> None:
    with pytest.raises(LindyError, match=f"--set {bad}"):
        override({"name": "x"}, [bad])


def test_an_unknown_vehicle_suggests_the_nearest() -> None:
    with pytest.raises(LindyError, match=r"unknown vehicle 'pionere'; did you mean 'pioneer'"):
        deploy_file("vehicles", "pionere")


@pytest.mark.parametrize("path", ["/tmp", "/dev/null", "./mine"])
def test_a_path_that_is_no_file_of_the_kind_is_said(path: str) -> None:
    with pytest.raises(LindyError, match=rf"^{path} is no .toml file: give a name in deploy/veh"):
        deploy_file("vehicles", path)


def test_an_unknown_table_is_refused() -> None:
    with pytest.raises(
        LindyError,
        match=r"^--set contol\.depth\.kp=3: contol: unknown table .* did you mean 'control'",
    ):
        Stack(overrides=["contol.depth.kp=3"]).check(known_tables(Registry.read()))


@pytest.mark.parametrize(
    ("assignments", "guilty", "why"),
    [
        (["more.Down.tilt=1"], 0, r"cannot be called 'Down'; allowed are a to z, 0 to 9 and _"),
        (["width=320", "more.Down.tilt=1", "rate=10"], 1, "cannot be called 'Down'"),
        (["least_kbit=900", "most_kbit=500"], 1, "least_kbit is 900, expected at most most_kbit"),
    ],
)
def test_a_mistake_of_a_table_as_a_whole_is_of_the_option_from_which_on_it_is_wrong(
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


def test_an_unknown_table_or_key_in_the_file_has_its_line(tmp_path: Path) -> None:
    pioneer = deploy_file("vehicles", "pioneer").read_text()
    last = len(pioneer.splitlines())
    path = file(tmp_path, f"{pioneer}\n[contol]\nx = 1\n")
    with pytest.raises(LindyError, match=rf"some.toml:{last + 2}: contol: unknown table"):
        Stack(vehicle=str(path), overrides=["contol.y=3"]).check(known_tables(Registry.read()))


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
def test_a_file_that_is_too_long_or_too_deep_is_refused(
    tmp_path: Path, text: str, said: str
) -> None:
    path = tmp_path / "bomb.toml"
    path.write_text(text)
    with pytest.raises(LindyError) as refused:
        read_toml(path)
    assert str(refused.value) == f"{path}: not valid TOML: {said}"


def test_a_file_may_begin_with_the_mark_of_an_editor_on_windows(tmp_path: Path) -> None:
    path = tmp_path / "marked.toml"
    path.write_bytes(b"\xef\xbb\xbfkp = 3\r\n")
    assert read_toml(path) == {"kp": 3}
