"""A service as a process: how it ends, what it says when it cannot start, what it knows again."""

import signal
import subprocess
import sys
import time
from collections.abc import Generator
from pathlib import Path

import msgspec
import pytest

from services.runtime.bus.envelope import Envelope
from services.runtime.bus.zenoh_bus import ZenohBus, listening, open_bus
from services.runtime.config.stack import Stack
from services.runtime.hosts.process_host import Launch
from services.runtime.hosts.stack_file import ServiceSpec
from tests.support.patience import PATIENCE_S, until
from tests.support.started import exists

PYTHON = [sys.executable, "-P", "-m", "services"]
TOY = """
import time
import msgspec
from services.runtime.config.errors import LindyError

class Memory(msgspec.Struct):
    lives: int

def wire(node, stack):
    known = node.restore_checkpoint(Memory)
    lives = 1 if known is None else known.lives + 1
    node.save_checkpoint(Memory(lives))
    node.every(20.0, lambda now: node.log("info", f"life {lives}"))
    node.on_close(lambda: print("closed", flush=True))
"""
HANGING = TOY + "    node.every(20.0, lambda now: time.sleep(600))\n"
ENDING = (
    TOY
    + """
    def handle(now):
        if now > 0 and lives:
            LATER
    node.alarm(handle).set(node.deadline() + 200_000_000)
"""
)
PARENT = """
import subprocess, sys, time
toy = subprocess.Popen(sys.argv[1:], stdin=subprocess.PIPE)
print(toy.pid, flush=True)
time.sleep(600)
"""


class Bench:
    """A hub, a folder with the toy's module, and an ear for what the toy says."""

    def __init__(self, folder: Path, endpoint: str, bus: ZenohBus) -> None:
        self.folder, self._endpoint = folder, endpoint
        self.alive: list[bool] = []
        self._lines: list[Envelope] = []
        bus.hear("log/toy", self._lines.append)
        bus.watch(lambda _, alive: self.alive.append(alive))
        self._started: list[subprocess.Popen[str]] = []

    def command(self, code: str, **more: bool) -> list[str]:
        (self.folder / "toy_module.py").write_text(code)
        launch = Launch(
            process="toy",
            services={"toy": ServiceSpec(sides=["drone"], module="toy_module")},
            stack=Stack(),
            stack_file=str(self.folder / "mine.toml"),
            endpoints={"drone": self._endpoint},
            checkpoint=str(self.folder),
        )
        said = msgspec.to_builtins(launch) | more
        return [*PYTHON, msgspec.json.encode(said).decode()]

    def start(self, command: list[str]) -> subprocess.Popen[str]:
        pipe = subprocess.PIPE
        process = subprocess.Popen(command, stdout=pipe, stderr=pipe, text=True)
        self._started.append(process)
        return process

    def heard(self, text: str) -> bool:
        lines = [msgspec.msgpack.decode(e.payload)["text"] for e in self._lines]
        return text in lines

    def end(self) -> None:
        for process in self._started:
            process.kill()
            process.communicate()


@pytest.fixture
def bench(tmp_path: Path) -> Generator[Bench]:
    endpoint = f"unixsock-stream/{tmp_path}/hub.sock"
    with listening(endpoint), open_bus(endpoint, "pioneer") as bus:
        bench = Bench(tmp_path, endpoint, bus)
        yield bench
        bench.end()


def test_a_service_that_is_asked_to_end_closes_and_ends_well(bench: Bench) -> None:
    """Further signals do not change its status."""
    toy = bench.start(bench.command(TOY))
    until(lambda: bench.heard("life 1"))
    toy.send_signal(signal.SIGTERM)
    while toy.poll() is None:
        toy.send_signal(signal.SIGINT)
        time.sleep(0.001)  # often enough for some of them to come while the interpreter ends
    said, shown = toy.communicate(timeout=PATIENCE_S)
    assert (toy.returncode, said) == (0, "closed\n")
    assert set(shown.splitlines()) == {"info toy: life 1"}
    until(lambda: bench.alive == [True, False])


def test_a_service_ends_when_its_parent_dies_even_if_it_hangs(bench: Bench) -> None:
    command = bench.command(HANGING, supervised=True)
    parent = bench.start([sys.executable, "-S", "-c", PARENT, *command])
    assert parent.stdout is not None
    toy = int(parent.stdout.readline())
    until(lambda: True in bench.alive)
    assert exists(toy)
    parent.kill()
    until(lambda: not exists(toy))
    until(lambda: bench.alive == [True, False])


@pytest.mark.parametrize(
    ("code", "sentence"),
    [
        ("__import__('sys').exit(0)", "ended itself at {}: SystemExit: 0"),
        ("{}['x']", "failed at {}: KeyError: 'x'"),
    ],
)
def test_a_handler_that_fails_or_exits_is_one_sentence_with_its_line_and_status_1(
    bench: Bench, code: str, sentence: str
) -> None:
    whole = ENDING.replace("LATER", code)
    line = 1 + whole[: whole.index(code)].count("\n")
    toy = bench.start(bench.command(whole))
    said, shown = toy.communicate(timeout=PATIENCE_S)
    where = sentence.format(f"{bench.folder}/toy_module.py:{line}")
    assert shown.splitlines()[-1] == f"lindy toy: toy (module toy_module) {where}"
    assert (toy.returncode, said) == (1, "closed\n")


def test_a_process_that_has_closed_everything_and_does_not_end_is_ended() -> None:
    """As Zenoh's, where one of its threads could not be started."""
    code = (
        "import atexit, time\n"
        "from services.runtime.hosts import process_host as host\n"
        "host.EXIT_S = 0.01\n"
        "atexit.register(time.sleep, 600.0)\n"
        "with host._stoppable(supervised=False):\n"
        "    print('works', flush=True)\n"
    )
    ran = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, timeout=PATIENCE_S, check=False
    )
    assert (ran.returncode, ran.stdout) == (-signal.SIGALRM, b"works\n")
