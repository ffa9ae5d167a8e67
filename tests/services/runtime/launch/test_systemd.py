"""What systemd is told, through a real socket."""

import os
import signal
import socket
import time
from collections.abc import Callable, Generator
from contextlib import contextmanager
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from services.runtime.config.stack import Stack
from services.runtime.hosts.loop import last_beat
from services.runtime.hosts.registry import Registry
from services.runtime.launch.child import OsChild
from services.runtime.launch.local_stack import LocalStack, local_stack
from services.runtime.launch.process_plan import Dive
from services.runtime.launch.systemd import Systemd
from tests.support.patience import PATIENCE_S, until

S = 1_000_000_000  # [ns]


class Manager:
    """The end of the socket that is systemd's."""

    def __init__(self, address: str) -> None:
        self.socket = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)
        self.socket.setblocking(False)
        self.socket.bind(address)

    def heard(self) -> list[str]:
        """Since the last call."""
        lines: list[str] = []
        while True:
            try:
                lines.append(self.socket.recv(4096).decode())
            except BlockingIOError:
                return lines


@contextmanager
def manager(address: str) -> Generator[Manager]:
    made = Manager(address)
    try:
        yield made
    finally:
        made.socket.close()


@pytest.mark.parametrize("abstract", [False, True])
def test_start_work_and_end_are_told(tmp_path: Path, abstract: bool):
    name = f"@lindy-test-{os.getpid()}" if abstract else str(tmp_path / "notify")
    with manager(name.replace("@", "\0", 1) if abstract else name) as hears:
        systemd = Systemd({"NOTIFY_SOCKET": name, "WATCHDOG_USEC": "2000000"}, os.getpid())
        systemd.ready()
        systemd.works(1 * S)
        systemd.stopping()
        assert hears.heard() == ["READY=1", "WATCHDOG=1", "STOPPING=1"]


@given(
    st.integers(1, 60_000_000),
    st.lists(st.integers(0, 2 * S), min_size=1, max_size=200),
)
def test_the_watchdog_hears_twice_in_its_time_at_least_and_not_at_every_call(
    tmp_path_factory: pytest.TempPathFactory, period_us: int, pauses: list[int]
):
    name = str(tmp_path_factory.mktemp("systemd") / "notify")
    told = list[int]()
    with manager(name) as hears:
        systemd = Systemd({"NOTIFY_SOCKET": name, "WATCHDOG_USEC": str(period_us)}, 1)
        now = 0
        for pause in pauses:
            now += pause
            before = told[-1] if told else None
            systemd.works(now)
            if hears.heard():
                told.append(now)
                assert before is None or now - before >= period_us * 500
            else:
                assert before is not None
                assert now - before < period_us * 500
    assert told[0] == pauses[0]


@pytest.mark.parametrize(
    "environment",
    [
        {},
        {"NOTIFY_SOCKET": "{name}"},
        {"NOTIFY_SOCKET": "{name}", "WATCHDOG_USEC": "1000", "WATCHDOG_PID": "1"},
        {"NOTIFY_SOCKET": "{name}", "WATCHDOG_USEC": "soon"},
        {"NOTIFY_SOCKET": "{name}-that-is-not-there", "WATCHDOG_USEC": "1000"},
        {"WATCHDOG_USEC": "1000"},
    ],
)
def test_without_a_watchdog_or_without_systemd_nothing_is_told(
    tmp_path: Path, environment: dict[str, str]
):
    name = str(tmp_path / "notify")
    with manager(name) as hears:
        systemd = Systemd({key: value.format(name=name) for key, value in environment.items()}, 77)
        systemd.works(1 * S)
        systemd.stopping()
        assert "WATCHDOG=1" not in hears.heard()


def test_a_manager_that_reads_nothing_holds_nobody_up(tmp_path: Path):
    with manager(str(tmp_path / "notify")):
        systemd = Systemd({"NOTIFY_SOCKET": str(tmp_path / "notify")}, 1)
        for _ in range(10_000):  # far more than the socket takes; would wait for ever
            systemd.ready()


STACK = """
[services.engine]
sides = ["drone"]
vehicle_side = true
module = "quiet_module"

[services.recorder]
sides = ["drone"]
module = "quiet_module"
"""


def spared_by_the_system(_: OsChild) -> None:
    """A signal that does not end its process."""


def made(folder: Path) -> tuple[Stack, Registry]:
    (folder / "quiet_module.py").write_text("def wire(node, stack):\n    pass\n")
    (folder / "mine.toml").write_text(STACK)
    (folder / "out").mkdir()
    return Stack(out=str(folder / "out")), Registry.read(str(folder / "mine.toml"))


def pump_until(local: LocalStack, happened: Callable[[], bool]) -> None:
    until(happened, meanwhile=local.pump)


@pytest.mark.system
@pytest.mark.parametrize(("name", "spared"), [("engine", False), ("recorder", True)])
def test_the_watchdog_is_silent_while_what_holds_the_vehicle_hangs(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, name: str, spared: bool
):
    """… and cannot be ended, as what waits for a dead device. What only writes files may hang."""
    address = str(tmp_path / "notify")
    monkeypatch.setenv("NOTIFY_SOCKET", address)
    monkeypatch.setenv("WATCHDOG_USEC", "200000")
    monkeypatch.setattr(OsChild, "kill", spared_by_the_system)
    stack, services = made(tmp_path)
    with manager(address) as hears:
        with local_stack(Dive(stack, services)) as local:
            local.start_services()
            pump_until(local, lambda: not local.missing())
            assert "READY=1" not in hears.heard()
            local.wait_alive(PATIENCE_S, lambda: True)
            assert "READY=1" in hears.heard()
            pump_until(local, lambda: last_beat(local.plan.heartbeat(name)) is not None)
            pid = local.supervisor.pids[name]
            os.kill(pid, signal.SIGSTOP)
            pump_until(local, lambda: name in local.hang_detector.silent)
            hears.heard()
            over = time.monotonic() + 1.0  # [s] five times the watchdog's: silence takes time
            pump_until(local, lambda: time.monotonic() > over)
            assert ("WATCHDOG=1" in hears.heard()) == spared
            os.kill(pid, signal.SIGCONT)
            pump_until(local, lambda: name not in local.hang_detector.silent)
            pump_until(local, lambda: "WATCHDOG=1" in hears.heard())
        assert hears.heard()[-1] == "STOPPING=1"
