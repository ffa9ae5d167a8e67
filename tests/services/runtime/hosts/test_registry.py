"""A mistake in a stack file, or in a module that it names, is one sentence that says where."""

from itertools import count
from pathlib import Path

import pytest
from msgspec.structs import replace

from messages import topics
from services.runtime.config.errors import LindyError
from services.runtime.config.settings import deploy_file
from services.runtime.config.stack import Stack
from services.runtime.hosts.registry import NEEDED, Registry
from services.runtime.hosts.stack_file import bases, own_services
from services.runtime.hosts.virtual_host import VirtualHost
from tools.checks import DEFAULT_PILOT, known_tables
from tools.choices import Choices
from tools.live.cockpit import with_cockpit, with_picture
from tools.live.pilots import who_flies

NUMBERS = count()
WIRE = "def wire(node, stack):\n    "
STRICT = """
import msgspec
class Settings(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    port: str = "/dev/ttyACM0"
    baud: int = 115200
"""


def stack_file(folder: Path, text: str) -> Registry:
    path = folder / "mine.toml"
    path.write_text(text)
    return Registry.read(str(path))


def with_driver(folder: Path, code: str | None, more: str = "") -> Registry:
    """A stack of a driver, whose module has a name of its own in this process."""
    name = f"driver_{next(NUMBERS)}"
    if code is not None:
        (folder / f"{name}.py").write_text(code)
    text = f'[services.driver]\nsides = ["drone"]\nvehicle_side = true\nmodule = "{name}"\n{more}'
    return stack_file(folder, text)


def test_the_shipped_stacks_differ_in_the_vehicle_side_alone() -> None:
    simulated, real = Registry.read("simulated"), Registry.read("real")
    assert simulated.vehicle_side == {"simulator": "services.simulator"}
    assert real.vehicle_side == {"driver": "my_lab.my_driver"}
    assert {n: s for n, s in simulated.items() if not s.vehicle_side} == {
        n: s for n, s in real.items() if not s.vehicle_side
    }
    stacks = ("mavlink", "ardusub", "ardusub_instruments", "foxglove", "camera", "cockpit", "ros2")
    others = [Registry.read(stack) for stack in stacks]
    named = {*simulated, *(name for stack in others for name in stack)}
    assert named == set(own_services())


def test_a_ground_station_may_be_the_pilot_in_place_of_the_gamepad() -> None:
    simulated, mavlink = Registry.read("simulated"), Registry.read("mavlink")
    assert set(simulated) ^ set(mavlink) == {"gamepad", "mavlink"}
    mavlink.require_whole()
    assert who_flies(Choices(stack="mavlink"), mavlink).name == "mavlink"
    with pytest.raises(LindyError, match="a ground station flies in the stack mavlink"):
        who_flies(Choices(stack="mavlink", pilot="keyboard"), mavlink)
    ros2 = Registry.read("ros2")
    assert set(simulated) ^ set(ros2) == {"gamepad", "ros2"}
    assert who_flies(Choices(stack="ros2"), ros2).name == "ros2"
    cockpit = Registry.read("cockpit")
    picture = {"camera"}
    assert set(simulated) ^ set(cockpit) == {"gamepad", "cockpit"} | picture
    cockpit.require_whole()
    with pytest.raises(LindyError, match="a browser flies in the stack cockpit"):
        who_flies(Choices(stack="cockpit", pilot="keyboard"), cockpit)
    added = with_cockpit(simulated, None)
    assert dict(added) == dict(cockpit) | dict(added)
    assert who_flies(Choices(), added).name == "cockpit"
    beside = with_cockpit(simulated, "keyboard")
    assert set(beside) == {*simulated, "cockpit"} | picture
    assert dict(with_cockpit(cockpit, "keyboard")) == dict(cockpit)
    both = {**simulated, "mavlink": mavlink["mavlink"]}
    assert who_flies(Choices(pilot="keyboard"), both).name == "keyboard"


def test_no_script_that_nobody_chose_flies_a_drone_elsewhere(monkeypatch: pytest.MonkeyPatch):
    simulated = Registry.read("simulated")
    monkeypatch.setattr("tools.live.pilots.pad_is_there", lambda: False)
    assert who_flies(Choices(), simulated).name == DEFAULT_PILOT
    with pytest.raises(LindyError, match=r"^no gamepad is plugged in: .* --pilot keyboard"):
        who_flies(Choices(), simulated, elsewhere=True)
    chosen = who_flies(Choices(pilot=DEFAULT_PILOT), simulated, elsewhere=True)
    assert chosen.name == DEFAULT_PILOT
    monkeypatch.setattr("tools.live.pilots.pad_is_there", lambda: True)
    assert who_flies(Choices(), simulated, elsewhere=True).name == "gamepad"


DEVICE = Choices(set_=("camera.source=/dev/video0",))


@pytest.mark.parametrize(
    ("stack", "choices", "has_av", "sentence"),
    [
        ("simulated", Choices(), True, ""),
        ("simulated", Choices(), False, "PyAV is not installed, so this dive has no picture; in"),
        ("ardusub", Choices(), True, "no camera is named, so this dive has no picture: --set cam"),
        ("ardusub", DEVICE, True, ""),
        ("ardusub", DEVICE, False, "PyAV is not installed"),
    ],
)
def test_a_cockpit_has_a_picture_where_there_can_be_one_and_else_says_why(
    stack: str,
    choices: Choices,
    has_av: bool,
    sentence: str,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    spec = object() if has_av else None
    monkeypatch.setattr("tools.live.cockpit.find_spec", {"av": spec}.get)
    whole = with_cockpit(Registry.read(stack), None)
    flown = with_picture(whole, choices)
    said = capsys.readouterr().out
    assert said.count("\n") == bool(sentence)
    assert said.startswith(sentence)
    left_out = {"camera"} if sentence else set[str]()
    assert set(flown) == set(whole) - left_out
    flown.require_whole()


def service(name: str, *keys: str) -> str:
    return "\n".join([f"[services.{name}]", *keys, ""])


ON_BOARD, TOPSIDE, BOTH = "sides = ['drone']", "sides = ['topside']", "sides = ['topside', 'drone']"
VEHICLE, OF_X, MINE = "vehicle_side = true", "module = 'x'", "process = 'mine'"
WHOLE = service("simulator", ON_BOARD, VEHICLE)
GATEWAY = service("tether", BOTH, "gateway = true")
SECOND = service("cable", "service = 'tether'", BOTH, "gateway = true")
TAKEN = service("control", ON_BOARD) + service("estimation", ON_BOARD, "process = 'control'")
TWO_HOMES = service("control", ON_BOARD, MINE) + service("gamepad", BOTH, MINE)


@pytest.mark.parametrize(
    ("text", "where", "words"),
    [
        ("", "", r"no service is the vehicle; one of them must have vehicle_side = true"),
        ("[service.x]", ":1: service", "unknown key; did you mean 'services'"),
        (service("contrl", ON_BOARD), ":1: ", "no service 'contrl', .* did you mean 'control'"),
        (service("control", "sides = ['dron']"), ":2: services.control.sides number 1", "'dron'"),
        (service("control", "sides = []"), ":2: services.control.sides", "expected an array"),
        (service("control", "sides = ['drone', 'drone']"), ":2: ", "'drone' is there twice"),
        (service("vehicle", ON_BOARD, OF_X), "", "cannot be called 'vehicle'"),
        (service("hub_drone", ON_BOARD, OF_X), "", "cannot be called 'hub_drone'"),
        (service("simulator", BOTH, VEHICLE), ":2: services.simulator.sides", r"is \[\"drone\"\]"),
        (service("tether", ON_BOARD, "gateway = true"), ":2: services.tether.sides", "topside"),
        (WHOLE + GATEWAY + SECOND, ":10: services.cable.gateway", "tether is the gateway already"),
        (WHOLE + service("x", ON_BOARD, VEHICLE, OF_X), ":6: ", "simulator is a whole vehicle alr"),
        (service("control", ON_BOARD, "process = 'hub_drone'"), ":3: ", "called 'hub_drone'"),
        (TAKEN, ":5: services.estimation.process", "'control' is a service that is not in this"),
        (TWO_HOMES, ":6: services.gamepad.process", "'mine' has control, whose home is the drone"),
        (service("x", ON_BOARD, "module = '../x'"), ":3: services.x.module", "'../x' is no name"),
        ("extends = 'simulatd'", ":1: extends", "unknown stack 'simulatd'; did you mean"),
        ("extends = 'mine.toml'", ":1: extends", "'mine.toml' is a file; allowed is a na"),
        (
            "extends = 'simulated'\n" + service("x", "in_place_of = 'pad'"),
            ":3: services.x.in_place_of", "there is no service 'pad' to replace; known",
        ),
        (service("reference", TOPSIDE), ":2: services.reference.sides", "it is on board"),
    ],
)  # fmt: skip
def test_a_mistake_in_a_stack_file_is_named(
    tmp_path: Path, text: str, where: str, words: str
) -> None:
    with pytest.raises(LindyError, match=f"mine.toml{where}.*{words}"):
        stack_file(tmp_path, text)


def test_a_stack_that_extends_another_says_only_what_differs(tmp_path: Path) -> None:
    simulated = Registry.read("simulated")
    mine = stack_file(
        tmp_path,
        'extends = "simulated"\n[services.control]\nprocess = "one"\n'
        '[services.sticks]\nin_place_of = "gamepad"\nsides = ["topside"]\nmodule = "sticks"\n'
        '[services.alarm]\nsides = ["drone"]\nmodule = "alarm"\n',
    )
    assert [*mine] == [*("sticks" if n == "gamepad" else n for n in simulated), "alarm"]
    assert mine["control"] == replace(simulated["control"], process="one")
    same = {*simulated} - {"gamepad", "control"}
    assert {n: mine[n] for n in same} == {n: simulated[n] for n in same}
    assert [path.stem for path in bases(deploy_file("stacks", "cockpit"))] == [
        "camera",
        "simulated",
    ]


def without(folder: Path, *names: str, more: str = "") -> Registry:
    """The simulated stack without these services."""
    tables = deploy_file("stacks", "simulated").read_text().split("[services.")
    kept = [table for table in tables if table.partition("]")[0] not in names]
    return stack_file(folder, "[services.".join(kept) + more)


OWN = '[services.mine]\nsides = ["drone"]\nmodule = "mine"\n'


@pytest.mark.parametrize("name", ["gamepad", "estimation", "reference", "control"])
def test_a_stack_without_a_needed_service_is_refused_unless_a_module_may_replace_it(
    tmp_path: Path, name: str
) -> None:
    with pytest.raises(LindyError) as refused:
        without(tmp_path, name).require_whole()
    key = NEEDED[name].key
    assert f"mine.toml: services: nobody publishes {key}, " in str(refused.value)
    assert f"allowed: [services.{name}], or a module of your own" in str(refused.value)
    without(tmp_path, name, more=OWN).require_whole()
    without(tmp_path, name, more=OWN.replace("services.mine", f"services.{name}")).require_whole()
    two_missing = without(tmp_path, name, *({"control", "estimation"} - {name}), more=OWN)
    with pytest.raises(LindyError, match="nobody publishes"):
        two_missing.require_whole()


def test_a_stack_whose_sides_nothing_connects_is_refused(tmp_path: Path) -> None:
    with pytest.raises(LindyError, match="none connects the topside with the drone; one must have"):
        without(tmp_path, "tether").require_whole()


def test_a_service_that_only_looks_on_may_be_left_out(tmp_path: Path) -> None:
    for names in ("", "recorder", "visualizer", "predictor", "link_monitor", "recorder visualizer"):
        without(tmp_path, *names.split()).require_whole()


def test_what_must_be_one_is_not_there_twice(tmp_path: Path) -> None:
    for name in ("estimation", "reference", "control"):
        with pytest.raises(LindyError, match=rf"services.second: it runs the code of {name}, and"):
            without(tmp_path, more=service("second", ON_BOARD, f"service = '{name}'"))


def test_grouped_services_without_a_process_share_that_of_their_home() -> None:
    grouped = Registry.read("simulated").grouped()
    assert grouped.processes == {
        "onboard": ["simulator", "estimation", "reference", "control"],
        "topside": ["tether", "gamepad", "link_monitor", "predictor"],
        "recorder": ["recorder"],
        "visualizer": ["visualizer"],
    }
    assert grouped.shared == {
        name: process for process in ("onboard", "topside") for name in grouped.processes[process]
    }
    assert "driver" in Registry.read("real").grouped().processes


def test_processes_of_the_stack_file_are_kept_and_joined(tmp_path: Path) -> None:
    more = "".join(
        f"[services.{name}]\nsides = ['drone']\nprocess = '{process}'\n"
        for name, process in (
            ("estimation", "chain"),
            ("control", "chain"),
            ("reference", "onboard"),
        )
    )
    services = with_driver(tmp_path, None, more)
    assert services.processes == {
        "driver": ["driver"], "chain": ["estimation", "control"], "onboard": ["reference"],
    }  # fmt: skip
    assert services.shared == {"estimation": "chain", "control": "chain", "reference": "onboard"}
    assert services.grouped().processes == {
        "onboard": ["driver", "reference"], "chain": ["estimation", "control"],
    }  # fmt: skip


def test_a_service_with_the_name_of_a_side_s_process_is_in_it_or_refused(tmp_path: Path) -> None:
    mine = "module = 'x'\n[services.topside]\nmodule = 'x'\nsides = ['drone']\n"
    services = with_driver(tmp_path, None, "[services.desk]\nsides = ['topside']\n" + mine)
    with pytest.raises(LindyError, match=r"services.desk.process: 'topside' is a service"):
        services.grouped()


def test_on_two_machines_each_instance_keeps_a_process_of_its_own(tmp_path: Path) -> None:
    twice = "[services.link_monitor]\nsides = ['topside', 'drone']\neach_machine = true\n"
    services = with_driver(tmp_path, None, twice + "process = 'link_monitor'\n").apart()
    assert services.shared == {}
    assert {"link_monitor", "link_monitor_drone"} <= services.processes.keys()


@pytest.mark.parametrize(
    ("code", "sentence"),
    [
        (None, r"there is no module 'driver_\d+'; allowed: an installed module, or a file beside"),
        (
            "wire = 3",
            r"'driver_\d+' \(.*driver_\d+.py\) has no function wire\(node, stack\)",
        ),
        ("import no_such_port", r"cannot be imported: ModuleNotFoundError: No module named 'no_s"),
        ("raise SystemExit('bye')", r"cannot be imported: SystemExit: bye"),
        ("class Settings: ...\n" + WIRE + "pass", r"Settings of module .* forbid_unknown_fields"),
    ],
)
def test_a_module_that_cannot_be_used_is_named_with_its_line(
    tmp_path: Path, code: str | None, sentence: str
) -> None:
    services = with_driver(tmp_path, code)
    with pytest.raises(LindyError, match=rf"mine.toml:4: services.driver.module: .*{sentence}"):
        known_tables(services)


@pytest.mark.parametrize(
    ("line", "sentence"),
    [
        ("raise OSError(2, 'No such file', '/dev/ttyACM0')", r"module driver_\d+: FileNotFoundErr"),
        ("raise ValueError('two\\nlines')", r"module driver_\d+: ValueError: two lines$"),
        (
            "from services.runtime.config.errors import LindyError; "
            "raise LindyError('port is taken')",
            r"^port is taken$",
        ),
    ],
)
def test_a_driver_that_cannot_start_says_why(tmp_path: Path, line: str, sentence: str) -> None:
    services = with_driver(tmp_path, WIRE + line)
    with pytest.raises(LindyError, match=sentence):
        VirtualHost().add_all(services, Stack())


def test_a_drivers_settings_are_checked_like_lindys_own(tmp_path: Path) -> None:
    known = known_tables(with_driver(tmp_path, STRICT + WIRE + "pass"))
    Stack(overrides=["driver.port=/dev/ttyUSB1"]).check(known)
    Stack(overrides=["simulator.floor_depth=9.0"]).check(known)  # the file suits other stacks too
    with pytest.raises(LindyError, match=r"--set driver.prot=1: unknown key; did you mean 'port'"):
        Stack(overrides=["driver.prot=1"]).check(known)
    with pytest.raises(
        LindyError, match=r"--set driver.baud=fast: expected a whole number, found 'fast'"
    ):
        Stack(overrides=["driver.baud=fast"]).check(known)


def test_settings_of_a_module_that_declares_none_are_refused_with_how_to(tmp_path: Path) -> None:
    known = known_tables(with_driver(tmp_path, WIRE + "pass"))
    Stack().check(known)
    with pytest.raises(
        LindyError, match=r"^--set driver.port=x: driver: the module .* declare them"
    ):
        Stack(overrides=["driver.port=x"]).check(known)
    path = tmp_path / "boat.toml"
    path.write_text(deploy_file("vehicles", "pioneer").read_text() + "\n[driver]\nport = 'x'\n")
    line = len(path.read_text().splitlines()) - 1
    with pytest.raises(
        LindyError, match=rf"boat.toml:{line}: driver: .* class Settings\(msgspec.S"
    ):
        Stack(vehicle=str(path)).check(known)


def test_a_recorded_vehicle_file_may_have_tables_of_other_services(tmp_path: Path) -> None:
    """A dive of one's own driver is reviewed and replayed without it."""
    path, known = tmp_path / "boat.toml", known_tables(Registry.read())
    path.write_text(deploy_file("vehicles", "pioneer").read_text() + "\n[driver]\nport = 'x'\n")
    Stack(vehicle=str(path)).check(known, recorded=True)
    with pytest.raises(LindyError, match="driver: unknown table"):
        Stack(vehicle=str(path)).check(known)
    with pytest.raises(LindyError, match="contrl: unknown table"):
        Stack(vehicle=str(path), overrides=["contrl.x=1"]).check(known, recorded=True)


def test_the_other_machine_needs_no_driver(tmp_path: Path) -> None:
    services = with_driver(tmp_path, None)
    Stack(overrides=["driver.port=x"]).check(known_tables(services, here={"gamepad"}))


def test_a_driver_is_started_like_any_service(tmp_path: Path) -> None:
    code = STRICT + WIRE + "node.log('info', stack.section(node.name, Settings).port)\n"
    host, said = VirtualHost(), list[str]()
    host.node("ear", ["drone"]).each(topics.LOG, lambda line, _: said.append(line.text))
    host.add_all(with_driver(tmp_path, code), Stack(overrides=["driver.port=/dev/x"]))
    host.run(1_100_000_000)  # past the first health report
    assert said == ["/dev/x"]
