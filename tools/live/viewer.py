"""A dive with or without a viewer: rerun is an extra, and has no wheel for some machines."""

from importlib.util import find_spec

from services.runtime.config.extras import how_to_install
from services.runtime.hosts.registry import Registry

VIEWER = "visualizer"


def runnable(services: Registry) -> Registry:
    """The services that can run here. Without rerun there is no visualizer, which is printed."""
    if VIEWER not in services or find_spec("rerun") is not None:
        return services
    print(
        "rerun is not installed, so this dive has no viewer and no dive.rrd; "
        f"{how_to_install('viewer')}",
        flush=True,
    )
    return services.only({name: spec for name, spec in services.items() if name != VIEWER})
