"""Another vehicle side than the simulator: the example outside of the packages, as a user flies it,
drivers that cannot start, and drivers with wrong units, signs or stamps."""

import json
import os
import shutil
from contextlib import closing
from pathlib import Path

import msgspec
import pytest

from messages import topics
from messages.events import note
from messages.vehicle import VehicleStatus
from services.runtime.config.running import RUNNING, Running
from services.runtime.hosts.registry import Registry
from services.runtime.hosts.virtual_host import VirtualHost
from tests.support.started import lindy
from tools.__main__ import main
from tools.checks import checked, pilot_of
from tools.choices import Choices
from tools.recordings.recording import log_hash, open_recording

EXAMPLE = Path(__file__).parents[2] / "examples" / "point_vehicle"
SIDE = ("--stack", f"{EXAMPLE}/stack.toml", "--vehicle", f"{EXAMPLE}/vehicle.toml")
QUICK = ("--set", "estimation.calibration.still_time=1")  # [s] at rest instead of ten
SCRIPT = "t,surge,sway,heave,yaw\n0,0,0,0,0\n1,0,0,0.8,0\n4,0,0,0,0.5\n6,0,0,0,0\n8,0,0,0,0\n"
FLYING = ("driver", "estimation", "reference", "control", "tether", "link_monitor")
SECOND = 1_000_000_000  # [ns]


@pytest.fixture
def pilot(tmp_path: Path) -> tuple[str, str]:
    path = tmp_path / "script.csv"
    path.write_text(SCRIPT)
    return "--pilot", f"script:{path}"


def stack_with(folder: Path, name: str, code: str) -> tuple[str, str]:
    """The example's stack with this driver instead of its own."""
    (folder / f"{name}.py").write_text(code)
    stack = (EXAMPLE / "stack.toml").read_text()
    path = folder / "stack.toml"
    path.write_text(stack.replace('module = "driver"', f'module = "{name}"'))
    return "--stack", str(path)


@pytest.mark.slow
def test_it_keeps_its_contract_as_its_readme_checks_it() -> None:
    done = lindy("check-driver", SIDE[1], SIDE[3])
    assert done.returncode == 0, done.stdout


@pytest.mark.slow
def test_a_driver_of_a_user_that_falls_silent_is_named_to_the_pilot() -> None:
    services = Registry.read(SIDE[1])
    choices = Choices(stack=SIDE[1], vehicle=SIDE[3], set_=QUICK[1:])
    stack = checked(choices, pilot_of("script:first_dive"), services)
    with closing(VirtualHost()) as host:
        status = host.node("test", ["topside"]).latest(topics.STATUS)
        host.add_all(services.only({n: services[n] for n in services if n in FLYING}), stack)
        host.run(4 * SECOND)
        assert (before := status.newest(host.now)) is not None
        assert "service_silent" not in before.conditions
        host.kill("driver")
        host.run(host.now + 4 * SECOND)
        assert (after := status.newest(host.now)) is not None
        assert "service_silent" in after.conditions
        assert "a service on board does not answer (driver)" in note(after.notices)


@pytest.mark.slow
@pytest.mark.system
def test_a_driver_that_cannot_open_its_port_ends_the_dive_with_its_own_words(
    tmp_path: Path, pilot: tuple[str, str]
) -> None:
    code = "def wire(node, stack):\n    open('/dev/no_such_port')\n"
    stack = stack_with(tmp_path, "broken_driver", code)
    out = tmp_path / "out"
    said = lindy("dive", *stack, *pilot, "--headless", "--out", str(out))
    assert said.returncode == 1
    why = "module broken_driver: FileNotFoundError: [Errno 2] No such file or directory"
    assert said.stderr.startswith(f"lindy: {why}: '/dev/no_such_port'")
    assert said.stderr.count("\n") == 1
    log = (out / "logs" / "driver.log").read_text()
    assert "open('/dev/no_such_port')" in log  # the details, for whoever wrote the driver


@pytest.mark.parametrize("verb", ["dive", "simulate", "run"])
def test_a_stack_that_cannot_be_started_leaves_no_folder(
    tmp_path: Path, verb: str, pilot: tuple[str, str], capsys: pytest.CaptureFixture[str]
) -> None:
    stack = stack_with(tmp_path, "wireless_driver", "wire = None\n")
    out = tmp_path / "out"
    more = ["driver", "--connect", "drone=tcp/127.0.0.1:7447"] if verb == "run" else []
    assert main([verb, *more, *stack, *pilot, "--out", str(out)]) == 1
    said = capsys.readouterr().err
    lines = (tmp_path / "stack.toml").read_text().splitlines()
    line = next(n for n, text in enumerate(lines, 1) if '"wireless_driver"' in text)
    assert f"stack.toml:{line}: services.driver.module: module 'wireless_driver'" in said
    assert not out.exists()


CLOSES = "    node.on_close(lambda: {}['port'])\n"  # which fails as well
DYING = """
from examples_driver import Settings, wire as wire_all
def wire(node, stack):
    wire_all(node, stack)
    def handle(now):
        CODE
    node.alarm(handle).set(4_000_000_000)
CLOSER"""


@pytest.mark.parametrize(
    ("code", "how", "closer"),
    [
        ("raise SystemExit(0)", "ended itself at {}: SystemExit: 0", ""),
        ("{}['thrust']", "failed at {}: KeyError: 'thrust'", CLOSES),
    ],
)
def test_a_driver_that_dies_in_mid_dive_is_named_with_its_line_and_what_was_flown_is_kept(
    tmp_path: Path,
    pilot: tuple[str, str],
    capsys: pytest.CaptureFixture[str],
    code: str,
    how: str,
    closer: str,
) -> None:
    name = f"dying_driver_{abs(hash(code + closer))}"  # a module of its own in this process
    driver = (EXAMPLE / "driver.py").read_text()
    (tmp_path / "examples_driver.py").write_text(driver)
    shutil.copy(EXAMPLE / "pretend_hardware.py", tmp_path)
    code_file = DYING.replace("CODE", code).replace("CLOSER", closer)
    stack = stack_with(tmp_path, name, code_file)
    out = tmp_path / "out"
    vehicle = ("--vehicle", f"{EXAMPLE}/vehicle.toml")
    assert main(["simulate", *stack, *vehicle, *QUICK, *pilot, "--out", str(out)]) == 1
    said = capsys.readouterr()
    line = 1 + code_file[: code_file.index(code)].count("\n")
    sentence = f"driver (module {name}) {how.format(f'{tmp_path / name}.py:{line}')}"
    assert said.err.strip() == f"lindy: {sentence}"
    assert f"broke off: {sentence}" in said.out
    assert json.loads((out / "report.json").read_text())["exit"] == sentence
    assert log_hash(out) is not None  # closed, not cut off
    assert max(entry.log_ns for entry in open_recording(out)) >= 3_900_000_000


def test_a_driver_that_needs_real_time_says_so(
    tmp_path: Path, pilot: tuple[str, str], capsys: pytest.CaptureFixture[str]
) -> None:
    code = (
        "from services.runtime.config.errors import NeedsRealTimeError\n"
        "def wire(node, stack):\n"
        "    if stack.virtual:\n"
        "        raise NeedsRealTimeError(node.name)\n"
    )
    stack = stack_with(tmp_path, "real_time_driver", code)
    assert main(["simulate", *stack, *pilot, "--out", str(tmp_path / "out")]) == 1
    assert "driver needs real time: use `lindy dive`" in capsys.readouterr().err


def test_a_fault_is_for_simulated_vehicles_only(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    running = Running("vehicle", {}, os.getpid(), {}, f"{EXAMPLE}/stack.toml")
    (tmp_path / RUNNING).write_bytes(msgspec.json.encode(running))
    assert main(["fault", "port", "dead", "--dive", str(tmp_path)]) == 1
    said = capsys.readouterr().err
    assert "only a simulated vehicle can be broken on purpose, and this dive has none" in said


# A driver with wrong units, signs or stamps in the whole chain, on virtual time: the vehicle does
# not arm, and the pilot reads why.


SHORT = ("--set", "estimation.calibration.still_time=2")  # [s] at rest instead of ten
DOWN = "t,surge,sway,heave,yaw\n0,0,0,0,0\n1,0,0,0.8,0\n2,0,0,0,0\n"
FORCE, STAMP = "specific_force=force", "ImuSample(stamp_ns=now"

# The mistake in the driver, the count, and what the warning and the last sentence say of it.
WRONG = {
    "in_g": (
        FORCE, f"{FORCE[:-5]}tuple(f / 9.81 for f in force)", "wrong_unit:sensor/imu",
        "the IMU reads a specific force of 1 m/s², allowed are 3 to 30: its driver must say m/s²",
        "do not fit its unit (sensor/imu)",
    ),
    "upside_down": (
        FORCE, f"{FORCE[:-5]}(force[0], -force[1], -force[2])", "upside_down:sensor/imu",
        "check [vehicle.mounting.imu] in the vehicle file and the sign of the IMU's z axis",
        "the IMU reads as if the drone lay upside down",
    ),
    "late": (
        STAMP, f"{STAMP} - 5_000_000_000", "old_stamps:sensor/imu",
        "samples of the IMU are 5 s old when they arrive, allowed are 0.2 s",
        "too old when they arrive (sensor/imu)",
    ),
    "ahead": (
        STAMP, f"{STAMP} + 5_000_000_000", "unusable:sensor/imu",
        "the IMU cannot be used: no attitude and heading, depth from pressure alone; a message had "
        "a time stamp in the future (sensor/imu)",
        "no usable samples of the drone's IMU",
    ),
}  # fmt: skip


@pytest.mark.slow
@pytest.mark.parametrize("mistake", WRONG)
def test_a_vehicle_with_a_wrong_driver_stays_disarmed_and_says_why(
    tmp_path: Path, mistake: str, capsys: pytest.CaptureFixture[str]
) -> None:
    right, wrong, count, warning, ending = WRONG[mistake]
    code, out = (EXAMPLE / "driver.py").read_text(), tmp_path / "out"
    assert code.count(right) == 1
    shutil.copy(EXAMPLE / "pretend_hardware.py", tmp_path)
    stack = stack_with(tmp_path, f"driver_{mistake}", code.replace(right, wrong))
    (tmp_path / "script.csv").write_text(DOWN)
    vehicle = ("--vehicle", f"{EXAMPLE}/vehicle.toml", *SHORT)
    pilot = ("--pilot", f"script:{tmp_path}/script.csv", "--out", str(out))
    assert main(["simulate", *stack, *vehicle, *pilot]) == 1
    said = capsys.readouterr()
    assert said.out.count(warning) == 1
    assert ending in said.err
    assert "keep the drone still" not in said.err
    assert json.loads((out / "report.json").read_text())["losses"][count] == 1
    heard = [entry.message for entry in open_recording(out)]
    armed = [message.armed for message in heard if isinstance(message, VehicleStatus)]
    assert armed
    assert not any(armed)
