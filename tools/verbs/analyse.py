"""Verbs that read a file, a recording or a path, and print or draw what is in it."""

from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from tools.choices import named


def picture(
    recording: Path,
    *,
    out: Annotated[Path, Parameter(converter=named, help="the PNG to write, a new file")] = Path(
        "dive.png"
    ),
    at: Annotated[
        float | None, Parameter(help="seconds since the dive began; default: its end")
    ] = None,
    page: Annotated[
        str, Parameter(help="dive, motion, control, sensors, link, camera or health")
    ] = "dive",
) -> int:
    """Write a picture of a recorded dive as the viewer shows it, without a display.

    RECORDING is a dive's folder, or the dive.rrd in it. It needs Vulkan, in software at least; on
    Debian: apt install mesa-vulkan-drivers libvulkan1

    Example: lindy picture dives/latest --at 40 --page link --out link.png
    """
    from tools.picture import picture

    picture(recording, out, at, page)
    return 0


def path(
    file: str,
    *,
    dt: Annotated[float | None, Parameter(help="[s] between samples, for the reference")] = None,
) -> int:
    """Print a path (JSON), or with --dt the whole reference along it (CSV).

    FILE is a TOML file or a name in deploy/paths. Keys: waypoints, min_radius, kind, smooth_yaw;
    cruise, speeds; model, acceleration, jerk, accel_time, decel_time, epsilon, theta_a, theta_d,
    theta_0, xi.

    Example: lindy path deploy/paths/fernandes.toml --dt 0.15
    """
    from tools.path import path

    return path(file, dt=dt)
