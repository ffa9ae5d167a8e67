"""Why a dive did not end cleanly, in a few words each. What was merely at a limit, late, or lost or
damaged on the link is in the losses of the report and no trouble."""

from collections.abc import Mapping, Sequence

from messages import events
from messages.events import Promise, row_of, short

NAMED = 3  # services by name; of more only the number


def counted(counts: Mapping[str, int]) -> list[str]:
    """What the services' counts say.

    Args:
        counts: name → times, as in a report's losses.
    """
    there = {name: count for name, count in counts.items() if count}
    broken: dict[Promise, dict[str, int]] = {}
    for name, count in there.items():
        if (promise := row_of(name).breaks) is not None:
            broken.setdefault(promise, {})[name] = count
    refused = sum(broken.get("understood", {}).values())
    if any(row_of(name) is events.DAMAGED for name in there):  # then it is nobody's fault
        refused = 0
    each = {
        promise: [f"{short(name)} {times(n)}" for name, n in names.items()]
        for promise, names in broken.items()
    }
    return [
        *each.get("piloted", []),
        *_few(each.get("answered", []), "services did not answer"),
        *[f"{refused} message{'s' * (refused > 1)} refused"] * (refused > 0),
        *["not everything was recorded"] * ("recorded" in broken),
    ]


def processes(
    restarts: Mapping[str, int], gone: Sequence[str], shared: Mapping[str, str]
) -> list[str]:
    """
    Args:
        restarts: times each service and hub was started again.
        gone: services that were not alive at the end.
        shared: the process of each service that is not alone in a process of its own name.
    """
    again = [f"{name} started again {times(n)}" for name, n in by_process(restarts, shared).items()]
    missing = [f"{name} not alive at the end" for name in gone]
    return [
        *_few(again, "processes started again"),
        *_few(missing, "services not alive at the end"),
    ]


def ending(exit_reason: str, troubles: Sequence[str]) -> str:
    """How a dive ended, in words: cleanly only without any trouble.

    Args:
        exit_reason: `clean`, or why it was aborted.
    """
    if exit_reason != "clean":
        return f"broke off: {exit_reason}"
    return f"ended; {', '.join(troubles)}" if troubles else "ended cleanly"


def by_process(restarts: Mapping[str, int], shared: Mapping[str, str]) -> dict[str, int]:
    """Times each process was started again, of those that were. Arguments as of `processes`."""
    most: dict[str, int] = {}
    for name, count in restarts.items():
        process = shared.get(name, name)
        most[process] = max(count, most.get(process, 0))
    return {process: count for process, count in sorted(most.items()) if count}


def _few(each: Sequence[str], together: str) -> Sequence[str]:
    return each if len(each) <= NAMED else [f"{len(each)} {together}"]


def times(count: int) -> str:
    """In words."""
    return "once" if count == 1 else f"{count} times"
