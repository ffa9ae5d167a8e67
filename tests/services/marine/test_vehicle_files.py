"""Every vehicle file describes a vehicle that can exist, and says so where it cannot."""

import re
from pathlib import Path

import msgspec
import numpy as np
import pytest

from services.marine.hydrodynamics import damping, system_inertia
from services.marine.vehicle import CURVES, Vehicle, wrench_per_newton
from services.reference.settings import Settings
from services.runtime.config.errors import LindyError
from services.runtime.config.settings import deploy_file
from services.runtime.config.stack import Stack
from services.runtime.hosts.registry import Registry
from tools.checks import PilotChoice, checked, known_tables
from tools.choices import Choices

NAMES = ("pioneer", "bluerov2_heavy", "minerva")
PILOT = PilotChoice("script:first_dive")
HEADROOM = 0.7  # [-] of its thrust a vehicle may need for the motion that its sticks ask for


def vehicle(name: str) -> Vehicle:
    return Stack(vehicle=name).section("vehicle", Vehicle)


def reach(about: Vehicle, axis: int) -> tuple[float, float]:
    """[N, N m] Least and most of one axis, with every thruster that helps it."""
    least = most = 0.0
    for thruster in about.thruster:
        per_newton = wrench_per_newton(thruster)[axis]
        ends = [per_newton * limit for limit in thruster.limits]
        least, most = least + min(ends), most + max(ends)
    return least, most


@pytest.mark.parametrize("name", NAMES)
def test_every_table_of_every_vehicle_file_is_right(name: str) -> None:
    Stack(vehicle=name).check(known_tables(Registry.read()))


@pytest.mark.parametrize("name", NAMES)
def test_other_units_than_metres_and_an_inertia_that_no_hull_has_are_refused(name: str) -> None:
    about = vehicle(name)
    replace = msgspec.structs.replace
    for factor in (1e3, 1e2):
        far = [factor * part for part in about.thruster[0].position]
        wrong = replace(about.thruster[0], position=(far[0], far[1], far[2]))
        with pytest.raises(ValueError, match=rf"^thruster {wrong.name}: .*positions are in metres"):
            replace(about, thruster=[wrong, *about.thruster[1:]])
        length, width, height = (factor * part for part in about.size)
        with pytest.raises(ValueError, match="is lighter than any; sizes are in metres"):
            replace(about, size=(length, width, height))
    roll, pitch, yaw = about.inertia
    for factor in (1e-3, 1e3):
        with pytest.raises(ValueError, match=r"an inertia of .* about pitch do not belong to one"):
            replace(about, inertia=(roll, factor * pitch, yaw))


@pytest.mark.parametrize("called", ["x" * 41, "up\x1b[2J"])
def test_a_thruster_has_a_name_that_can_be_shown(called: str) -> None:
    thruster = vehicle("pioneer").thruster[0]
    with pytest.raises(ValueError, match="expected a name of at most 40 printable letters") as told:
        msgspec.structs.replace(thruster, name=called)
    assert str(told.value).isprintable()


def test_minerva_has_the_thrust_of_table_5() -> None:
    """Fernandes et al. 2015. Sway is that of the lateral thruster: the mains turn it as well."""
    minerva = vehicle("minerva")
    lateral = next(t for t in minerva.thruster if t.name == "lateral")
    assert reach(minerva, 0) == pytest.approx((-220.0, 480.0), abs=0.1)
    assert lateral.limits == (-195.0, 195.0)
    assert reach(minerva, 2) == (-180.0, 390.0)
    assert reach(minerva, 5) == pytest.approx((-300.0, 300.0), abs=0.5)
    assert all(
        abs(place) <= half
        for t in minerva.thruster
        for place, half in zip(t.position, (0.72, 0.41, 0.405), strict=True)
    )


def test_bluerov2_heavy_drives_all_six_axes_with_eight_t200() -> None:
    heavy = vehicle("bluerov2_heavy")
    columns = np.array([wrench_per_newton(t) for t in heavy.thruster])
    assert np.linalg.matrix_rank(columns) == 6
    for thruster in heavy.thruster:
        assert thruster.max_thrust == pytest.approx(CURVES["t200"].thrust(1.0), abs=0.01)
        assert thruster.dead_band == pytest.approx(CURVES["t200"].dead_band, abs=0.01)
        lag = thruster.lag
        assert lag is not None
        mean_delay = (lag.denominator[-2] - lag.numerator[-2]) / lag.denominator[-1]
        assert thruster.time_constant == pytest.approx(mean_delay, abs=1e-3)


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("way", [1, -1])
def test_the_heave_stick_asks_for_no_more_than_the_thrusters_can(name: str, way: int) -> None:
    about, heave = vehicle(name), Stack(vehicle=name).section("reference", Settings).heave
    nu = (0, 0, heave.max_velocity, 0, 0, 0)
    drag = damping(about.linear_damping, about.quadratic_damping, nu)[2]
    gain = system_inertia(about)[2] * heave.max_acceleration
    needed = way * (drag + gain) + about.net_buoyancy
    least, most = reach(about, 2)
    assert HEADROOM * least <= needed <= HEADROOM * most


@pytest.mark.parametrize(
    "override",
    [
        "vehicle.mass=0.0", "vehicle.mass=inf", "vehicle.inertia=[0.1, -0.2, 0.1]",
        "vehicle.added_mass=[-1.0, 1.0, 1.0, 1.0, 1.0, 1.0]",
        "vehicle.linear_damping=[1.0, 1.0, 1.0, 1.0, 1.0, -1.0]",
        "vehicle.quadratic_damping=[1.0, 1.0, 1.0, 1.0, -1.0, 1.0]",
        "vehicle.metacentric_height=-0.1", "vehicle.size=[1.0, 0.0, 1.0]",
        "vehicle.thruster=[]", "vehicle.net_buoyancy=nan",
    ],
)  # fmt: skip
def test_a_body_that_cannot_exist_is_refused(override: str) -> None:
    with pytest.raises(LindyError, match=override.partition("=")[0].replace(".", r"\.")):
        Stack(overrides=[override]).section("vehicle", Vehicle)


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("way", [1, -1])
def test_a_net_buoyancy_is_refused_exactly_where_the_thrusters_cannot_hold_it(
    name: str, way: int
) -> None:
    least, most = reach(vehicle(name), 2)
    limit, push = (most, "down") if way > 0 else (-least, "up")
    can, cannot = (
        Choices(vehicle=name, set_=(f"vehicle.net_buoyancy={way * share * limit:.3f}",))
        for share in (0.99, 1.01)
    )
    checked(can, PILOT, Registry.read())
    newtons = f"{way * 1.01 * limit:.3f}"
    sentence = rf"^--set .*={newtons}: is {float(newtons):g} N, .* push {push} with at most "
    with pytest.raises(LindyError, match=rf"{sentence}{limit:.1f} N"):
        checked(cannot, PILOT, Registry.read())


def test_a_net_buoyancy_in_the_file_is_refused_with_its_line(tmp_path: Path) -> None:
    text = deploy_file("vehicles", "pioneer").read_text()
    path = tmp_path / "mine.toml"
    path.write_text(re.sub("(?m)^net_buoyancy = .*$", "net_buoyancy = 200.0", text))
    line = 1 + path.read_text()[: path.read_text().index("net_buoyancy =")].count("\n")
    with pytest.raises(LindyError) as refused:
        checked(Choices(vehicle=str(path)), PILOT, Registry.read())
    assert str(refused.value).startswith(f"{path}:{line}: vehicle.net_buoyancy: is 200 N, but ")


OUTPUTS = {
    "two of one name": ("{name='a',kind='dimmer'},{name='a',kind='switch'}", "both called 'a'"),
    "two of one servo": (
        "{name='a',kind='dimmer',servo=13},{name='b',kind='switch',servo=13}",
        "outputs a and b both have servo 13",
    ),
    "two grippers": ("{name='a',kind='gripper'},{name='b',kind='gripper'}", "allowed is one"),
    "a thruster's servo": (
        "{name='lasers',kind='switch',servo=8}",
        "output lasers: servo 8 drives a thruster, expected a number from 9 to 32",
    ),
    "no such servo": ("{name='a',kind='switch',servo=33}", "found 33"),
    "17 of them": (
        ",".join(f"{{name='a{k}',kind='switch'}}" for k in range(17)),
        "there are 17 outputs, allowed are at most 16",
    ),
    "another kind": ("{name='a',kind='winch'}", "found 'winch'"),
    "a name that is none": ("{name='Left light',kind='dimmer'}", "small letters, digits and _"),
    "a pulse that is none": ("{name='a',kind='dimmer',high=nan}", "found nan"),
    "a time that is none": ("{name='a',kind='switch',off_after=nan}", "found nan"),
    "a gripper that goes on": ("{name='a',kind='gripper',off_after=3.0}", "takes no off_after"),
}


@pytest.mark.parametrize(("given", "says"), OUTPUTS.values(), ids=OUTPUTS)
def test_outputs_that_cannot_be_are_refused_in_a_sentence(given: str, says: str) -> None:
    stack = Stack(vehicle="bluerov2_heavy", overrides=[f"vehicle.output=[{given}]"])
    with pytest.raises(LindyError) as caught:
        stack.section("vehicle", Vehicle)
    assert says in str(caught.value)
    assert "output" in str(caught.value)


def test_a_vehicle_whose_file_names_no_outputs_has_a_light() -> None:
    assert [(o.name, o.kind) for o in vehicle("pioneer").output] == [("light", "dimmer")]


def test_every_thruster_of_the_pioneer_pushes_forward_starboard_or_down() -> None:
    """A thruster the wrong way round flies well in the simulator, which reads the same file."""
    directions = {thruster.name: thruster.direction for thruster in vehicle("pioneer").thruster}
    assert directions == {
        "port": (1.0, 0.0, 0.0),
        "starboard": (1.0, 0.0, 0.0),
        "lateral": (0.0, 1.0, 0.0),
        "vertical": (0.0, 0.0, 1.0),
    }
