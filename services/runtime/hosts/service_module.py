"""Where the code of a service is found: its name → a module → `wire`.

One of Lindy's own services is `services.<name>`: its `wire` is in `.service`, its `Settings`, if it
has any, in `.core`. Any other service is the module that its table in the stack file names, with
`wire` and `Settings` in that module itself. Such a module is looked for among the installed
packages and then in the folder of the stack file.
"""

import importlib
import importlib.util
import pkgutil
import sys
import traceback
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from types import ModuleType
from typing import Any

import msgspec

import services
from services.runtime.config.errors import LindyError
from services.runtime.config.settings import line_of
from services.runtime.config.stack import Stack
from services.runtime.node.node import Node

Wire = Callable[[Node, Stack], None]
HERE = services.__name__  # `services`; in an installed package `lindy.services`


def own_services() -> list[str]:
    """Names of Lindy's own services."""
    folders = [module.name for module in pkgutil.iter_modules(services.__path__) if module.ispkg]
    return sorted(n for n in folders if importlib.util.find_spec(f"{HERE}.{n}.service"))


def own_settings(name: str) -> type | None:
    """The settings that one of Lindy's own services reads from a vehicle file."""
    return getattr(importlib.import_module(f"{HERE}.{name}.core"), "Settings", None)


def wire_of(name: str) -> Wire:
    """`wire` of one of Lindy's own services."""
    return importlib.import_module(f"{HERE}.{name}.service").wire


@dataclass(frozen=True, slots=True)
class ServiceModule:
    """The module of one service of a stack file."""

    file: Path  # the stack file
    service: str  # its name there
    code: str  # the one of Lindy's own services that it runs
    users: str | None  # a user's module; None: one of Lindy's own services

    @property
    def name(self) -> str:
        return self.users or f"{HERE}.{self.code}"

    def wire(self) -> Wire:
        """The function that connects a service's core to its ports. Whatever it raises becomes one
        sentence.

        Raises:
            LindyError: there is no such module or function.
        """
        wire = wire_of(self.code) if self.users is None else self._wire_of_users()

        def wired(node: Node, stack: Stack) -> None:
            try:
                wire(node, stack)
            except LindyError:
                raise
            except (Exception, SystemExit) as error:
                raise LindyError(f"module {self.name}: {_in_words(error)}") from error

        return wired

    def failure(self, error: BaseException) -> LindyError:
        """What a handler of the service raised in mid-dive, in one sentence: which service, which
        module, which line."""
        if isinstance(error, MemoryError):  # of the computer, or of a limit: nobody's mistake
            return LindyError(f"{self.service} has no memory left")
        line = _line_in(sys.modules.get(self.name), error)
        whose = f"{self.service} (module {self.name})"
        if self.users is None:
            whose = f"an error in Lindy itself: {whose}"
        what = "ended itself" if isinstance(error, SystemExit) else "failed"
        at = f"{line.filename}:{line.lineno}:"
        return LindyError(f"{whose} {what} at {at} {_in_words(error)}")

    def settings_of_users(self) -> type | None:
        """The settings that a user's module reads from a vehicle file.

        Raises:
            LindyError: the module cannot be used.
        """
        self._wire_of_users()  # a module without one is no service
        settings = getattr(self._imported(), "Settings", None)
        if settings is None or _is_strict(settings):
            return settings
        raise LindyError(
            f"{self._at()}: Settings of module {self.name!r} must be a "
            f"class of the kind (msgspec.Struct, frozen=True, forbid_unknown_fields=True)"
        )

    def _wire_of_users(self) -> Wire:
        module = self._imported()
        wire: Wire | None = getattr(module, "wire", None)
        if not callable(wire):
            raise LindyError(
                f"{self._at()}: module {module.__name__!r} ({module.__file__}) has "
                f"no function wire(node, stack)"
            )
        return wire

    def _imported(self) -> ModuleType:
        """Import a module that is not Lindy's own."""
        folder = str(self.file.parent)
        if folder not in sys.path:
            sys.path.append(folder)  # at the end: nothing there can replace an installed module
        try:
            return importlib.import_module(self.name)
        except (Exception, SystemExit) as error:
            if isinstance(error, ModuleNotFoundError) and _is_part(error.name, self.name):
                raise LindyError(
                    f"{self._at()}: there is no module {self.name!r}; allowed: an installed "
                    f"module, or a file beside the stack file"
                ) from None
            raise LindyError(
                f"{self._at()}: module {self.name!r} cannot be imported: {_in_words(error)}"
            ) from error

    def _at(self) -> str:
        """The file, the line and the key, for an error."""
        path = ("services", self.service, "module")
        return f"{self.file}{line_of(self.file, path)}: {'.'.join(path)}"


def _is_part(found: str | None, module: str) -> bool:
    """Was the module itself, or a package that contains it, not found?"""
    return found is not None and (module == found or module.startswith(f"{found}."))


def _is_strict(settings: Any) -> bool:
    """Does it refuse the keys it does not know?"""
    if not isinstance(settings, type) or not issubclass(settings, msgspec.Struct):
        return False
    return settings.__struct_config__.forbid_unknown_fields


def _line_in(module: ModuleType | None, error: BaseException) -> traceback.FrameSummary:
    """Where an error came from: the innermost line of the module or of a file beside it, because
    what it called there is seldom at fault; else the innermost line of all."""
    frames = traceback.extract_tb(error.__traceback__)
    file = getattr(module, "__file__", None)
    own = [f for f in frames if file is not None and Path(f.filename).parent == Path(file).parent]
    return (own or frames)[-1]


def _in_words(error: BaseException) -> str:
    return f"{type(error).__name__}: {' '.join(str(error).split())}"
