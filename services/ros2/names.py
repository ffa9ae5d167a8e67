"""A drone's name in ROS 2. Pure."""

import re

from services.ros2.core import Settings


def ros_name(drone: str) -> str:
    """A drone's name as ROS allows it: letters, digits and _, from a letter on."""
    name = re.sub(r"[^A-Za-z0-9_]", "_", drone)
    return name if name[:1].isalpha() else f"drone_{name}"


def namespace_of(settings: Settings, name: str) -> str:
    """Of its topics: empty, or from a / on."""
    return f"/{name}" if settings.namespace is None else settings.namespace
