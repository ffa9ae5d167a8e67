"""What a service may remember across a crash, so that a restart in mid-dive goes on with the dive.

An atmosphere measured at the surface, the moment a stick log began: small things that cannot be
learnt again under water. One Struct per service, written whole.
"""

from pathlib import Path
from typing import Protocol


class Memory(Protocol):
    def recall(self) -> bytes | None: ...

    def remember(self, data: bytes) -> None: ...


class VolatileMemory:
    """For the virtual host: survives a restart of the node, not of the program."""

    def __init__(self) -> None:
        self._data: bytes | None = None

    def recall(self) -> bytes | None:
        return self._data

    def remember(self, data: bytes) -> None:
        self._data = data


class FileMemory:
    """For the process host: one small file in the dive's run folder, replaced in one move."""

    def __init__(self, path: Path) -> None:
        self._path = path

    def recall(self) -> bytes | None:
        try:
            return self._path.read_bytes()
        except FileNotFoundError:
            return None

    def remember(self, data: bytes) -> None:
        fresh = self._path.with_suffix(".new")
        fresh.write_bytes(data)
        fresh.replace(self._path)
