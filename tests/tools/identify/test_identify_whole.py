"""Manoeuvres, dive, fit and file, of a vehicle that its file does not describe."""

import tomllib
from pathlib import Path

import pytest
from msgspec.structs import replace

from messages.control import ThrusterCommand
from messages.message import Message
from services.gamepad import stick_log
from services.gamepad.io.path_file import course_named
from services.marine.vehicle import Vehicle
from services.reference.settings import Settings
from services.runtime.config.errors import LindyError
from services.runtime.config.settings import DEPLOY, convert
from services.runtime.config.stack import Stack
from tests.support.recorded import without_viewer
from tools.__main__ import main
from tools.choices import Choices
from tools.identify.plan import AXES, PlanAxis, as_csv, plan
from tools.identify.results import VehicleFile, rewritten, rounded
from tools.recordings.recording import Raw, Recording
from tools.simulate import simulated

pytestmark = pytest.mark.slow

HULL = (
    "simulator.hull.net_buoyancy=2",
    "simulator.hull.added_mass=[5.22, 19.87, 14.0, 0.097, 0.182, 0.13]",
    "simulator.hull.quadratic_damping=[25.0, 45.7, 32.0, 1.53, 1.53, 1.1]",
    "simulator.hull.time_constant=0.12",
    "simulator.floor_depth=12",
)


@pytest.fixture(scope="module")
def dive(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The planned manoeuvres, flown once."""
    folder = tmp_path_factory.mktemp("identify")
    sticks = folder / "sticks.csv"
    assert main(["identify", "plan", "--out", str(sticks)]) == 0
    choices = Choices(pilot=f"script:{sticks}", set_=HULL, seed=1, out=folder / "dive")
    assert simulated(choices, running=without_viewer()).status == 0
    return folder / "dive"


def test_the_numbers_of_another_hull_come_out_of_a_dive(
    dive: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    new = tmp_path / "new.toml"
    assert main(["identify", str(dive), "--out", str(new), "--check", str(dive)]) == 0
    told = capsys.readouterr().out
    assert "sway: kept as in the file" in told
    vehicle = convert(tomllib.loads(new.read_text())["vehicle"], Vehicle, "vehicle")
    assert vehicle.mass + vehicle.added_mass[2] == pytest.approx(22.6, rel=0.01)
    assert vehicle.inertia[2] + vehicle.added_mass[5] == pytest.approx(0.346, rel=0.01)
    assert _drag(vehicle, 2, 0.5) == pytest.approx((0.38 + 32.0 * 0.5) * 0.5, rel=0.03)
    assert _drag(vehicle, 5, 1.0) == pytest.approx(0.87 + 1.1, rel=0.01)
    assert vehicle.net_buoyancy == pytest.approx(2.0, abs=0.05)
    assert [t.time_constant for t in vehicle.thruster] == pytest.approx([0.12] * 4, abs=0.003)
    assert vehicle.added_mass[:2] == (5.22, 19.87)

    assert main(["identify", str(dive), "--out", str(new)]) == 1  # never overwritten


@pytest.mark.parametrize(
    ("words", "sentence"),
    [
        (["--axes", "surge"], "does not excite any axis enough; surge: the dive hardly moves"),
        (["--vehicle", "bluerov2_heavy"], "too few samples to identify anything: 0 of control"),
    ],
)
def test_a_dive_that_does_not_tell_is_refused_in_a_sentence(
    dive: Path, words: list[str], sentence: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["identify", str(dive), *words]) == 1
    said = capsys.readouterr().err
    assert sentence in said
    assert said.count("\n") == 1


@pytest.mark.parametrize(
    ("share", "sentence"),
    [
        (0.001, "pioneer.toml is damaged; name one with --vehicle"),
        (0.05, "too few samples"),
        (0.25, "stretches of 10 s"),
    ],
)
def test_a_recording_that_was_cut_off_too_early_is_refused(
    dive: Path, tmp_path: Path, share: float, sentence: str, capsys: pytest.CaptureFixture[str]
) -> None:
    whole = next(dive.glob("*.mcap")).read_bytes()
    short = tmp_path / "short.mcap"
    short.write_bytes(whole[: int(share * len(whole))])
    assert main(["identify", str(short)]) == 1
    said = capsys.readouterr().err
    assert sentence in said
    assert said.count("\n") == 1


def test_a_dive_of_a_drone_that_was_never_armed_is_refused(
    dive: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    decode = Recording.decode

    def disarmed(self: Recording, raw: Raw) -> Message | None:
        message = decode(self, raw)
        return replace(message, armed=False) if isinstance(message, ThrusterCommand) else message

    monkeypatch.setattr(Recording, "decode", disarmed)
    assert main(["identify", str(dive)]) == 1
    assert "the drone was never armed" in capsys.readouterr().err


def _drag(vehicle: Vehicle, row: int, speed: float) -> float:
    return (vehicle.linear_damping[row] + vehicle.quadratic_damping[row] * speed) * speed


@pytest.mark.parametrize("name", ["pioneer", "bluerov2_heavy", "minerva"])
def test_a_plan_is_a_stick_log_that_comes_back_to_its_depth(name: str) -> None:
    stack = Stack(vehicle=name)
    vehicle, reference = stack.section("vehicle", Vehicle), stack.section("reference", Settings)
    found = plan(vehicle, reference, AXES, 20.0)
    log = stick_log.parse(as_csv(found, vehicle).encode(), course_named)
    assert log.duration == pytest.approx(found.seconds, abs=0.01)
    assert found.up > 0.0 < found.down
    assert {row.axis for row in found.rows} == {*AXES, None}


@pytest.mark.parametrize(("depth", "axes"), [(0.5, ("heave",)), (1.0, ("yaw", "heave"))])
def test_a_plan_that_would_surface_is_refused(depth: float, axes: tuple[PlanAxis, ...]) -> None:
    stack = Stack()
    with pytest.raises(LindyError, match="expected at least"):
        plan(stack.section("vehicle", Vehicle), stack.section("reference", Settings), axes, depth)


@pytest.mark.parametrize("depth", [99.9, 1000.0])
def test_a_plan_below_the_depth_limit_is_refused(depth: float) -> None:
    stack = Stack(vehicle="bluerov2_heavy")
    with pytest.raises(LindyError, match=r"depth_limit is 100 m; expected at most 9\d"):
        plan(stack.section("vehicle", Vehicle), stack.section("reference", Settings), AXES, depth)


@pytest.mark.parametrize("name", ["pioneer", "bluerov2_heavy", "minerva"])
def test_only_the_numbers_of_a_file_change(name: str) -> None:
    text = (DEPLOY / "vehicles" / f"{name}.toml").read_text()
    tree = tomllib.loads(text)
    vehicle = convert(tree["vehicle"], Vehicle, "vehicle")
    file = VehicleFile(name, text, tree, vehicle, 1.0, 1025.0)
    same = rewritten(file, rounded(vehicle), "why")
    assert same.splitlines() == text.splitlines()


def test_a_file_of_another_form_is_not_rewritten_wrongly() -> None:
    text = (DEPLOY / "vehicles" / "pioneer.toml").read_text()
    text = text.replace("added_mass = [5.22,", "added_mass = [\n  5.22,")
    tree = tomllib.loads(text)
    vehicle = convert(tree["vehicle"], Vehicle, "vehicle")
    wanted = rounded(replace(vehicle, added_mass=(1.0, 1.0, 1.0, 1.0, 1.0, 1.0)))
    with pytest.raises(LindyError, match="by hand"):
        rewritten(VehicleFile("x", text, tree, vehicle, 1.0, 1025.0), wanted, "why")
