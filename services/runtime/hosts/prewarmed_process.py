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


def wait_for_work(prewarming: Prewarming) -> list[str] | None:
    """The arguments that it is told; None: it is not needed any more.

    It closes the stdout that it was started with once it has imported everything; what it prints
    then goes to its stderr.
    """
    until_imported, log = os.dup(1), os.dup(2)
    _become(os.devnull, 1, 2)  # some libraries greet
    _import(prewarming)
    os.close(until_imported)
    line = sys.stdin.buffer.readline()
    if not line.endswith(b"\n"):
        return None
    work = msgspec.json.decode(line, type=Work)
    os.dup2(log, 1)
    os.dup2(log, 2)
    os.close(log)
    _become(os.devnull, 0)
    return work.arguments


def _become(path: str, *descriptors: int) -> None:
    with Path(path).open("r+b") as file:
        for descriptor in descriptors:
            os.dup2(file.fileno(), descriptor)


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
