"""`lindy` started as a user does: processes of its own, watched from outside."""

import json
import os
import subprocess
import sys
from collections.abc import Callable, Sequence
from pathlib import Path
from signal import SIGINT, Signals
from typing import Any, Self

import msgspec
import zenoh

from messages.topic import M, Side, Topic
from services.runtime.bus.spaces import namespace
from services.runtime.bus.zenoh_bus import connected
from services.runtime.config.running import RUNNING, Running
from tests.support.patience import PATIENCE_S, until

LINDY = (sys.executable, "-P", "-m", "tools")
QUICK = ("--set", "estimation.calibration.still_time=3")  # [s] less to wait for
HAS_STICKS = "has the sticks"  # the pilot's line when the drone is armed


def lindy(*words: str) -> subprocess.CompletedProcess[str]:
    """A command that ends by itself."""
    return subprocess.run(
        [*LINDY, *words], capture_output=True, text=True, timeout=PATIENCE_S, check=False
    )


def exists(pid: int) -> bool:
    """A zombie that nobody collects does not exist any more."""
    try:
        stat = Path(f"/proc/{pid}/stat").read_text()
    except (FileNotFoundError, ProcessLookupError):
        return False
    return stat.rsplit(")", 1)[1].split()[0] != "Z"


class Ear:
    """On a hub of what goes on: a socket file, which no namespace of networks hides."""

    def __init__(self, running: Running, side: Side = "drone") -> None:
        self._session = connected(running.endpoints[side], namespace(running.vehicle))
        self._ears = list[object]()

    def heard(self, topic: Topic[M]) -> list[M]:
        """What is heard of it from now on."""
        found, decode = list[M](), msgspec.msgpack.Decoder(topic.message).decode

        def hear(sample: zenoh.Sample) -> None:
            found.append(decode(sample.payload.to_bytes()))

        self._ears.append(self._session.declare_subscriber(topic.key, hear))
        return found

    def close(self) -> None:
        self._session.close()  # type: ignore[no-untyped-call]


class Started:
    """One command that goes on, until the end of a `with` at the latest."""

    def __init__(
        self,
        out: Path,
        *words: str,
        script: str = "",
        before: Sequence[str] = (),
        screen: Path | None = None,
    ) -> None:
        """
        Args:
            out: folder of its dive; what it says and its script are in files beside it.
            script: that its pilot flies, where it has one.
            before: words before those of the command.
            screen: file for what it says.
        """
        self.out, self._screen = out, screen or out.with_suffix(".txt")
        if script:
            out.with_suffix(".csv").write_text(script)
            words = (*words, "--pilot", f"script:{out.with_suffix('.csv')}")
        with self._screen.open("w") as said:
            self.process = subprocess.Popen(
                [*before, *LINDY, *words, *QUICK, "--out", str(out)],
                stdin=subprocess.DEVNULL, stdout=said, stderr=subprocess.STDOUT,
            )  # fmt: skip

    @property
    def said(self) -> str:
        return self._screen.read_text(errors="replace")

    @property
    def running(self) -> Running:
        """
        Raises:
            FileNotFoundError: it does not run yet.
        """
        return msgspec.json.decode((self.out / RUNNING).read_bytes(), type=Running)

    def pid(self, name: str) -> int | None:
        """None: not yet."""
        try:
            return self.running.pids.get(name)
        except (FileNotFoundError, msgspec.DecodeError):
            return None

    @property
    def alive(self) -> bool:
        return self.process.poll() is None

    def until(self, happens: Callable[[], object]) -> None:
        """Wait for what must happen while it goes on."""

        def require_running() -> None:
            assert self.alive, self.said

        until(happens, lambda: self.said, require_running)

    def until_said(self, *words: str) -> None:
        self.until(lambda: all(each in self.said for each in words))

    def until_armed(self) -> Running:
        self.until_said(HAS_STICKS)
        return self.running

    def signal(self, name: str, number: Signals) -> None:
        os.kill(self.running.pids[name], number)

    def end(self, how: Signals = SIGINT) -> int:
        """As by Ctrl-C. Returns the exit status."""
        if self.alive:
            self.process.send_signal(how)
        return self.process.wait(PATIENCE_S)

    def report(self, status: int = 0) -> dict[str, Any]:
        """Wait for its end, and read the report."""
        assert self.process.wait(PATIENCE_S) == status, self.said
        return json.loads((self.out / "report.json").read_text())

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        if self.alive:
            self.process.terminate()
            self.process.wait(PATIENCE_S)
