"""A stack of two tiny services as processes: started, kept running, ended with nothing left."""

import os
import shutil
import signal
import time
from collections.abc import Callable
from pathlib import Path

import msgspec
import pytest
from hypothesis import given
from hypothesis import strategies as st

from messages import topics
from messages.health import LogLine
from services.marine.vehicle import Vehicle
from services.runtime.bus.zenoh_bus import listening
from services.runtime.config.errors import LindyError
from services.runtime.config.running import RUNNING, Running
from services.runtime.config.settings import deploy_file
from services.runtime.config.stack import Stack
from services.runtime.hosts.loop import last_beat
from services.runtime.hosts.registry import Registry
from services.runtime.hosts.stack_file import ServiceSpec
from services.runtime.launch.child import OsChild
from services.runtime.launch.local_stack import LocalStack, local_stack
from services.runtime.launch.process_plan import Dive, ProcessPlan
from services.runtime.os import system
from tests.services.runtime.launch.test_traces import manager
from tests.support.patience import PATIENCE_S, until
from tests.support.started import Ear, exists

SIDES = ("topside", "drone")
STACK = """
[services.engine]
sides = ["drone"]
vehicle_side = true
module = "engine_module"

[services.desk]
sides = ["topside", "drone"]
module = "desk_module"
"""
QUIET = "def wire(node, stack):\n    pass\n"
TALKING = """
def wire(node, stack):
    node.every(20.0, lambda now: node.log("info", "here"))
"""
READING = """
from services.marine.vehicle import Vehicle
def wire(node, stack):
    mass = stack.section("vehicle", Vehicle).mass
    node.every(20.0, lambda now: node.log("info", f"mass {mass:g}"))
"""
WAITING = """
import pathlib, time
def wire(node, stack):
    while not (pathlib.Path(__file__).parent / "go").exists():
        time.sleep(0.02)
"""
MISTAKEN = """
from services.runtime.config.errors import LindyError
def wire(node, stack):
    raise LindyError("the port is taken; choose another")
"""


def made(
    folder: Path, engine: str = TALKING, desk: str = QUIET, stack: str = STACK
) -> tuple[Stack, Registry]:
    (folder / "engine_module.py").write_text(engine)
    (folder / "desk_module.py").write_text(desk)
    (folder / "mine.toml").write_text(stack)
    out = folder / "out"
    out.mkdir()
    return Stack(out=str(out)), Registry.read(str(folder / "mine.toml"))


REMEMBERING = """
import msgspec
class Memory(msgspec.Struct):
    lives: int
def wire(node, stack):
    node.on_close(lambda: print("closed", node.name, flush=True))
    known = node.restore_checkpoint(Memory)
    lives = 1 if known is None else known.lives + 1
    node.save_checkpoint(Memory(lives))
    node.every(20.0, lambda now: node.log("info", f"life {lives}"))
"""
GREEDY = (
    REMEMBERING
    + """
    import resource
    def grow(now):
        if lives == 1:
            resource.setrlimit(resource.RLIMIT_AS, (2**33, resource.RLIM_INFINITY))
            bytearray(2**34)
    node.alarm(grow).set(node.now() + 200_000_000)
"""
)
ONE_PROCESS = """
[services.engine]
sides = ["drone"]
vehicle_side = true
module = "engine_module"
process = "onboard"

[services.sounder]
sides = ["drone"]
module = "engine_module"
process = "onboard"

[services.desk]
sides = ["topside", "drone"]
module = "desk_module"
"""


def pump_until(local: LocalStack, happened: Callable[[], bool]) -> None:
    until(happened, lambda: (local.missing(), local.supervisor.pids), local.pump)


def alive(local: LocalStack) -> None:
    pump_until(local, lambda: not local.missing())


def running(stack: Stack) -> Running:
    return msgspec.json.decode((stack.out_dir / RUNNING).read_bytes(), type=Running)


def socket_folders(local: LocalStack) -> set[Path]:
    return {Path(e.partition("/")[2]).parent for e in local.plan.endpoints.values()}


def test_a_stack_comes_alive_is_found_by_its_file_and_leaves_nothing_behind(tmp_path: Path) -> None:
    stack, services = made(tmp_path, engine=READING)
    file = tmp_path / "pioneer_too.toml"
    file.write_text(deploy_file("vehicles", "pioneer").read_text())
    mass = f"mass {stack.section('vehicle', Vehicle).mass:g}"
    stack = msgspec.structs.replace(stack, vehicle=str(file))
    with local_stack(Dive(stack, services)) as local:
        assert set(local.plan.endpoints) == {"topside", "drone"}
        assert sorted(local.missing()) == ["desk", "engine"]
        local.start_services()
        alive(local)
        assert local.shown >= {("drone", "engine"), ("topside", "desk"), ("drone", "desk")}
        found = running(stack)
        stack_file, pids = str(services.file), local.supervisor.pids
        began = system.began(os.getpid())
        assert found == Running(
            vehicle="pioneer",
            endpoints=local.plan.endpoints,
            supervisor=os.getpid(),
            pids=pids,
            stack_file=stack_file,
            vehicle_file=str(stack.vehicle_path.resolve()),
            began=began,
        )
        assert set(found.pids) == {"hub_topside", "hub_drone", "engine", "desk"}
        ear = Ear(found)
        said = ear.heard(topics.LOG.of("engine"))
        pump_until(local, lambda: bool(said))
        ear.close()
        assert said[0].text == mass
        folders = socket_folders(local)
        assert all(folder.is_dir() for folder in folders)
        assert set(local.supervisor.restarts.values()) == {0}
        file.write_text("[vehicle")  # who starts again reads what the dive began with
        after = kills_are_mended(local, stack, mass)
        require_it_goes_on_without_a_service_or_its_folder(local, stack)
        pids = (*found.pids.values(), *after.values(), *local.supervisor.pids.values())
    assert not [pid for pid in pids if exists(pid)]
    assert not [folder for folder in folders if folder.exists()]
    assert not (stack.out_dir / RUNNING).exists()


def kills_are_mended(local: LocalStack, stack: Stack, says: str) -> dict[str, int]:
    """A service and a hub that are killed come again, and the file names the new processes."""
    before = running(stack).pids
    for name in ("engine", "hub_drone"):
        os.kill(before[name], signal.SIGKILL)
    pump_until(local, lambda: bool(local.missing()))
    alive(local)
    pump_until(local, lambda: {"engine", "hub_drone"} <= set(running(stack).pids))
    after = running(stack).pids
    assert {name for name, pid in after.items() if pid != before[name]} == {"engine", "hub_drone"}
    restarts = {"hub_topside": 0, "hub_drone": 1, "engine": 1, "desk": 0}
    assert local.supervisor.restarts == restarts
    assert f"info engine: {says}" in (stack.out_dir / "logs/engine.log").read_text()
    return after


def require_it_goes_on_without_a_service_or_its_folder(local: LocalStack, stack: Stack) -> None:
    """A service that was alive is not waited for: by then the drone may be armed. And without the
    folder of the dive everything is started again as well."""
    os.kill(local.supervisor.pids["desk"], signal.SIGKILL)
    pump_until(local, lambda: "desk" in local.missing())
    said = list[LogLine]()
    local.node.show = said.append
    local.wait_alive(-1.0, lambda: True)
    assert "not alive after -1 s: desk; the dive goes on" in [line.text for line in said]
    alive(local)
    shutil.rmtree(stack.out_dir)
    os.kill(local.supervisor.pids["desk"], signal.SIGKILL)
    pump_until(local, lambda: bool(local.missing()))
    alive(local)
    assert local.supervisor.restarts["desk"] == 2


@given(st.sets(st.tuples(st.sampled_from(SIDES), st.sampled_from(("engine", "desk", "foreign")))))
def test_missing_is_who_shows_no_token_on_one_of_its_sides(shown: set[tuple[str, str]]) -> None:
    specs = {"engine": ServiceSpec(sides=["drone"]), "desk": ServiceSpec(sides=[*SIDES])}
    services = Registry(Path("x.toml"), specs)
    local = LocalStack(ProcessPlan(Dive(Stack(), services), Path()))
    local.shown = shown
    desk = {("topside", "desk"), ("drone", "desk")} <= shown
    whole = {"engine": ("drone", "engine") in shown, "desk": desk}
    assert local.missing() == [name for name, there in whole.items() if not there]
    alone = Dive(Stack(), services.only({"desk": specs["desk"]}), side="topside")
    local = LocalStack(ProcessPlan(alone, Path()))  # the drone has its hub on another machine
    local.shown = shown
    assert local.missing() == ([] if ("topside", "desk") in shown else ["desk"])


BUSY = """
import pathlib
def wire(node, stack):
    def now_and_then(now):
        while (pathlib.Path(__file__).parent / "hang").exists():
            pass
    node.every(20.0, now_and_then)
"""


def test_a_killed_process_takes_its_services_with_it_and_brings_them_back(tmp_path: Path) -> None:
    """At its end, the recorder is closed last."""
    recorder = '[services.recorder]\nsides = ["drone"]\nprocess = "onboard"\n'
    whole = f'{ONE_PROCESS}{recorder}module = "engine_module"\n'
    stack, services = made(tmp_path, engine=REMEMBERING, stack=whole)
    with local_stack(Dive(stack, services)) as local:
        said = list[LogLine]()
        local.node.show = said.append
        local.start_services()
        alive(local)
        pump_until(local, lambda: "onboard" in local.supervisor.pids)
        assert local.supervisor.lives["onboard"].seen
        before = running(stack).pids
        onboard = {"engine", "sounder", "recorder"}
        assert set(before) == {"hub_topside", "hub_drone", "desk"} | onboard
        assert before["engine"] == before["sounder"] != before["desk"]
        kept = [tmp_path / f"out/checkpoints/{name}.json" for name in ("engine", "sounder")]
        pump_until(local, lambda: all(path.is_file() for path in kept))
        log = stack.out_dir / "logs/onboard.log"
        pump_until(local, lambda: log.read_text().count("life 1") > 2)
        os.kill(before["engine"], signal.SIGKILL)
        pump_until(local, lambda: onboard <= set(local.missing()))
        alive(local)
        after = running(stack).pids
        assert after["engine"] == after["sounder"] != before["engine"]
        assert after["desk"] == before["desk"]
        others = dict.fromkeys(("hub_topside", "hub_drone", "desk"), 0)
        assert local.restarts == others | dict.fromkeys(onboard, 1)
        lines = [line.text for line in said if not line.text.startswith("late: ")]
        assert lines == [
            "onboard (engine, sounder, recorder) ended unexpectedly (signal SIGKILL)",
            "onboard (engine, sounder, recorder) is started again",
        ]
        lines = {f"info {name}: life {life}" for name in ("engine", "sounder") for life in (1, 2)}
        pump_until(local, lambda: lines <= set(log.read_text().splitlines()))
    assert not exists(after["engine"])
    closed = [line for line in log.read_text().splitlines() if line.startswith("closed")]
    assert sorted(closed) == ["closed engine", "closed recorder", "closed sounder"]
    assert closed[-1] == "closed recorder"


def test_who_is_late_is_named_and_may_come_and_a_viewer_is_last(tmp_path: Path) -> None:
    viewer = '[services.visualizer]\nsides = ["topside"]\nmodule = "engine_module"\n'
    stack, services = made(tmp_path, engine=QUIET, desk=WAITING, stack=STACK + viewer)
    with local_stack(Dive(stack, services)) as local:
        local.start_services()
        pump_until(local, lambda: ("drone", "engine") in local.shown)
        assert "visualizer" not in local.supervisor.pids

        def look() -> bool:
            local.pump()
            return True

        with pytest.raises(LindyError) as late:
            local.wait_alive(0.0, look)
        logs = stack.out_dir / "logs"
        assert str(late.value) == f"not alive after 0 s: desk (see {logs})"
        local.wait_alive(0.0, lambda: False)  # whoever waits may give up without an error
        (tmp_path / "go").touch()
        local.wait_alive(PATIENCE_S, look)
        alive(local)
        assert "visualizer" in local.supervisor.pids


def test_a_service_that_cannot_start_ends_the_stack_with_its_own_sentence(tmp_path: Path) -> None:
    stack, services = made(tmp_path, engine=MISTAKEN)
    pids = dict[str, int]()

    def start() -> None:
        with local_stack(Dive(stack, services)) as local:
            local.start_services()
            while True:
                pids.update(local.supervisor.pids)
                local.pump()

    with pytest.raises(LindyError, match=r"^the port is taken; choose another$"):
        start()
    assert set(pids) == {"hub_topside", "hub_drone", "engine", "desk"}
    assert not [pid for pid in pids.values() if exists(pid)]
    assert not (stack.out_dir / RUNNING).exists()


def test_each_start_in_one_folder_has_checkpoints_of_its_own(tmp_path: Path) -> None:
    stack, services = made(tmp_path)
    for folders in ({"checkpoints"}, {"checkpoints", "checkpoints-2"}):
        ProcessPlan(Dive(stack, services), tmp_path).keep_files(print)
        assert {path.name for path in stack.out_dir.iterdir()} == folders


def test_a_taken_endpoint_is_said_before_anything_is_started(tmp_path: Path) -> None:
    stack, services = made(tmp_path)
    taken = f"unixsock-stream/{tmp_path}/mine.sock"
    with (
        listening(taken),
        pytest.raises(LindyError, match=rf"^endpoint {taken} .*; choose another"),
        local_stack(Dive(stack, services, listen=(taken,))),
    ):
        raise AssertionError("it has started")


def test_who_has_no_memory_and_who_hangs_are_started_again(tmp_path: Path) -> None:
    stack, services = made(tmp_path, engine=GREEDY, desk=BUSY)
    with local_stack(Dive(stack, services)) as local:
        lines = list[LogLine]()
        local.node.show = lines.append
        local.node.each(topics.LOG, lambda line, _: lines.append(line))
        local.start_services()
        pump_until(local, lambda: local.supervisor.restarts["engine"] == 1)
        alive(local)
        log = stack.out_dir / "logs" / "engine.log"
        pump_until(local, lambda: "life 2" in log.read_text())
        said = [line.text for line in lines if line.text.startswith("engine ended unexpectedly")]
        assert said == ["engine ended unexpectedly (status 1: engine has no memory left)"]
        pump_until(local, lambda: last_beat(local.plan.heartbeat("desk")) is not None)
        (tmp_path / "hang").touch()
        pump_until(local, lambda: "desk" in local.hang_detector.silent)
        (tmp_path / "hang").unlink()
        pump_until(local, lambda: local.restarts["desk"] == 1)
        alive(local)


def test_neither_a_hub_that_cannot_listen_nor_a_mistake_ends_anything(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """As where the folder of its socket has become read-only. The mistake is printed once."""
    stack, services = made(tmp_path, desk=TALKING)
    with local_stack(Dive(stack, services)) as local:

        def wrong(line: LogLine, _: int) -> None:
            raise KeyError(line.text)

        local.node.each(topics.LOG, wrong)
        local.start_services()
        pump_until(local, lambda: local.node.counts["mistake"] > 3 and not local.missing())
        lines = list[str]()
        local.node.show = lambda line: lines.append(line.text)
        socket = Path(local.plan.endpoints["drone"].partition("/")[2])
        socket.unlink()
        socket.mkdir()
        os.kill(local.supervisor.pids["hub_drone"], signal.SIGKILL)
        pump_until(local, lambda: local.supervisor.restarts["hub_drone"] >= 2)
        assert any(line.startswith("hub_drone ended unexpectedly (status 1:") for line in lines)
        socket.rmdir()
        pump_until(local, lambda: not local.missing() and socket.is_socket())
    assert local.supervisor.failure is None
    assert capsys.readouterr().err.count("KeyError: 'here'") == 1


# What systemd is told of a stack.


RECORDED = STACK + '[services.recorder]\nsides = ["drone"]\nmodule = "desk_module"\n'


def spared_by_the_system(_: OsChild) -> None:
    """A signal that does not end its process."""


@pytest.mark.system
def test_the_watchdog_is_silent_while_what_holds_the_vehicle_hangs(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    """… and cannot be ended, as what waits for a dead device. What only writes files may hang."""
    address = str(tmp_path / "notify")
    monkeypatch.setenv("NOTIFY_SOCKET", address)
    monkeypatch.setenv("WATCHDOG_USEC", "200000")
    monkeypatch.setattr(OsChild, "kill", spared_by_the_system)
    stack, services = made(tmp_path, engine=QUIET, stack=RECORDED)
    with manager(address) as hears:
        with local_stack(Dive(stack, services)) as local:
            local.start_services()
            alive(local)
            assert "READY=1" not in hears.heard()
            local.wait_alive(PATIENCE_S, lambda: True)
            assert "READY=1" in hears.heard()
            for name, spared in (("recorder", True), ("engine", False)):
                pump_until(
                    local, lambda name=name: last_beat(local.plan.heartbeat(name)) is not None
                )
                pid = local.supervisor.pids[name]
                os.kill(pid, signal.SIGSTOP)
                pump_until(local, lambda name=name: name in local.hang_detector.silent)
                hears.heard()
                over = time.monotonic() + 1.0  # [s] five times the watchdog's: silence takes time
                pump_until(local, lambda over=over: time.monotonic() > over)
                assert ("WATCHDOG=1" in hears.heard()) == spared
                os.kill(pid, signal.SIGCONT)
                pump_until(local, lambda: not local.hang_detector.silent)
                pump_until(local, lambda: "WATCHDOG=1" in hears.heard())
        assert hears.heard()[-1] == "STOPPING=1"
