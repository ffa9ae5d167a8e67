"""Where north and east count from: one place for all instruments, also after a crash."""

import msgspec

from messages.events import Outbox
from services.instruments.fixes import LocalFixes, OriginCheckpoint
from services.instruments.geodesy import GeoPoint
from services.runtime.config.errors import LindyError
from services.runtime.config.stack import Stack
from services.runtime.node.node import Node

POSITIONS = ("nmea", "ugps")  # services that give positions


class PositionTable(msgspec.Struct, frozen=True):
    """What their tables have in common."""

    url: str = ""
    origin: GeoPoint | None = None


def local_fixes(
    stack: Stack, name: str, instrument: str, outbox: Outbox, node: Node | None
) -> LocalFixes:
    """
    Args:
        name: of the service.
        node: remembers the first position, so that it stays the origin after a crash.

    Raises:
        LindyError: there are two instruments, and it is not said that their origin is the same.
    """
    running = [n for n in POSITIONS if not stack.running or n in stack.running]
    tables = {n: stack.section(n, PositionTable) for n in running}
    origins = {n: table.origin for n, table in tables.items() if table.url}
    if len(origins) > 1 and (None in origins.values() or len({*origins.values()}) > 1):
        found = " and ".join(f"{n}.origin {origin or 'absent'}" for n, origin in origins.items())
        raise LindyError(
            f"{stack.vehicle_path}: found {found}; allowed with two instruments for the position: "
            f"the same origin for both, since both count north and east from it"
        )
    origin = stack.section(name, PositionTable).origin
    if node is None:
        return LocalFixes(instrument, outbox, origin)
    before = node.restore_checkpoint(OriginCheckpoint)
    if origin is None and before is not None:
        origin = before.origin
    return LocalFixes(instrument, outbox, origin, node.save_checkpoint)
