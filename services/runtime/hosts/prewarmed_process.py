"""A prewarmed process: it has done its imports, which take most of a start, and waits to be told
what it is to run. Whoever started it tells it on its stdin; when that closes instead, it ends."""

import importlib
import os
import pkgutil
import sys
from contextlib import suppress
from pathlib import Path

import msgspec

import services
from services.runtime.config.errors import LindyError
from services.runtime.hosts.registry import Registry
from services.runtime.hosts.stack_file import ServiceSpec, code_of


class Prewarming(msgspec.Struct, frozen=True):
    """What to import, as one JSON argument."""

    services: dict[str, ServiceSpec] = {}  # none: it will be a hub
    stack_file: str = ""


class Work(msgspec.Struct, frozen=True):
    """What to run, as one line of JSON on stdin."""

    arguments: list[str]  # of `python -m services`
    log: str  # file for stdout and stderr, which is appended to


def wait_for_work(prewarming: Prewarming) -> list[str] | None:
    """The arguments that it is told; None: it is not needed any more.

    It closes the stdout that it was started with once it has imported everything.
    """
    until_imported = os.dup(1)
    os.dup2(2, 1)  # some libraries greet
    _import(prewarming)
    os.close(until_imported)
    line = sys.stdin.buffer.readline()
    if not line.endswith(b"\n"):
        return None
    work = msgspec.json.decode(line, type=Work)
    _append_to(work.log)
    return work.arguments


def _import(prewarming: Prewarming) -> None:
    """What fails here fails again with its sentence, in the log, once there is one."""
    registry = Registry(Path(prewarming.stack_file), prewarming.services)
    for name, spec in prewarming.services.items():
        with suppress(LindyError):
            registry.wire(name)
        if spec.module is None:
            _import_io(code_of(name, spec))


def _import_io(service: str) -> None:
    """What a service imports only where it is used: the libraries of pads, files and pages."""
    for folder in services.__path__:
        for module in pkgutil.iter_modules([f"{folder}/{service}/io"]):
            with suppress(ImportError):
                importlib.import_module(f"{services.__name__}.{service}.io.{module.name}")


def _append_to(log: str) -> None:
    # Where it cannot be opened, what is printed is lost, and everything else works.
    with suppress(OSError), Path(log).open("ab") as file:
        os.dup2(file.fileno(), 1)
        os.dup2(file.fileno(), 2)
    with Path(os.devnull).open("rb") as nothing:
        os.dup2(nothing.fileno(), 0)
