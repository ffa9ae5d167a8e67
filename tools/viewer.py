"""A dive with or without a viewer: rerun is an extra, and has no wheel for some machines."""

from collections.abc import Mapping
from importlib.util import find_spec

from services.runtime.extras import how_to_install
from services.runtime.stack import Row

VIEWER = "visualizer"


def runnable(rows: Mapping[str, Row]) -> dict[str, Row]:
    """The services that can run here. Without rerun there is no visualizer, which is said."""
    if VIEWER not in rows or find_spec("rerun") is not None:
        return dict(rows)
    print(
        "rerun is not installed, so this dive has no viewer and no dive.rrd; "
        f"{how_to_install('viewer')}",
        flush=True,
    )
    return {name: row for name, row in rows.items() if name != VIEWER}
