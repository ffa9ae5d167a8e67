"""`python -m tests.golden.update`: golden dives of today's code, and what changed in them.

Look at what it prints before you commit: every line is a field that the services on board now
publish otherwise.
"""

from pathlib import Path
from tempfile import TemporaryDirectory

from tests.golden.dives import CHAIN, TOLERANCES, VEHICLES, golden, make
from tools.replay.differences import in_words
from tools.replay.source import open_source
from tools.replay.through import through


def changes(vehicle: str) -> list[str]:
    """How today's outputs differ from those of the golden dive."""
    if not golden(vehicle).exists():
        return ["it is new"]
    found = through(open_source(golden(vehicle)), CHAIN, tolerances=TOLERANCES)
    return [in_words(one, found.begin_ns) for one in found.differences]


def update() -> None:
    for vehicle in VEHICLES:
        changed = changes(vehicle)
        with TemporaryDirectory() as place:
            fresh = Path(place) / "fresh.mcap"
            make(vehicle, fresh)
            golden(vehicle).write_bytes(fresh.read_bytes())
        size = golden(vehicle).stat().st_size / 1000
        print(f"{vehicle}: {len(changed)} fields changed, {size:.0f} kB")
        print(*(f"  {line}" for line in changed), sep="\n")


if __name__ == "__main__":
    update()
