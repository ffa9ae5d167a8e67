"""What a core has told its outbox."""

from messages.events import Outbox


def told(outbox: Outbox) -> list[str]:
    """Names of the events since the last call, each as often as it was counted, in the order in
    which they first came; both counts and lines are then forgotten."""
    names = list(outbox.counts.elements())
    outbox.counts.clear()
    outbox.said.clear()
    return names
