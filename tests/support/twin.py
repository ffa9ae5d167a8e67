"""A node that takes another one's name, as a second process of a service does."""

from messages import topics
from services.runtime.node.node import Node


def take_name(node: Node, name: str) -> None:
    node.name = name
    node._health = node.publisher(topics.HEALTH.of(name))  # pyright: ignore[reportPrivateUsage]
    node._log = node.publisher(topics.LOG.of(name))  # pyright: ignore[reportPrivateUsage]
