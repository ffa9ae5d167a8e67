"""The viewer of a replay: the visualizer as a process of its own, on the replay's keys."""

import os
import subprocess
from collections.abc import Generator
from contextlib import contextmanager
from pathlib import Path

import msgspec

from services.runtime.config.stack import Stack
from services.runtime.hosts.process_host import Launch
from services.runtime.hosts.registry import Registry
from services.runtime.hosts.stack_file import ServiceSpec
from services.runtime.launch.process_plan import PYTHON
from services.runtime.os import system
from tools.live.viewer import VIEWER

END_S = 5.0  # [s] in which it ends when asked to


def one_bus(spec: ServiceSpec) -> ServiceSpec:
    """A replay has one bus, that of the recorder: a service is there once, at home."""
    return msgspec.structs.replace(spec, sides=spec.sides[:1])


@contextmanager
def viewer(stack: Stack, endpoint: str) -> Generator[None]:
    """
    Args:
        stack: of the recorded dive; the viewer's file is put into its folder.
    """
    services = Registry.read()
    spec = one_bus(services[VIEWER])
    launch = Launch(
        process=VIEWER,
        services={VIEWER: spec},
        stack=msgspec.structs.replace(stack, replay=True, viewer=True, virtual=False),
        stack_file=str(services.file),
        endpoints={spec.sides[0]: endpoint},
        checkpoint=str(Path(stack.out)),
        parent=os.getpid(),
    )
    command = [*PYTHON, msgspec.json.encode(launch).decode()]
    child = subprocess.Popen(command, stdin=system.STDIN, **system.APART)
    try:
        yield
    finally:
        system.ask_to_end(child)
        try:
            child.wait(END_S)
        except subprocess.TimeoutExpired:
            child.kill()
            child.wait()
