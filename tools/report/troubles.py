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
    there = {name: times for name, times in counts.items() if times}
    broken: dict[Promise, dict[str, int]] = {}
    for name, times in there.items():
        if (promise := row_of(name).breaks) is not None:
            broken.setdefault(promise, {})[name] = times
    refused = sum(broken.get("understood", {}).values())
    if any(row_of(name) is events.DAMAGED for name in there):  # then it is nobody's fault
        refused = 0
    return [
        *_each(broken.get("piloted", {})),
        *_few(_each(broken.get("answered", {})), "services did not answer"),
        *_if(refused, f"{refused} message{'s' * (refused > 1)} refused"),
        *_if(broken.get("recorded"), "not everything was recorded"),
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
    times = by_process(restarts, shared)
    again = [f"{name} started again {_times(n)}" for name, n in times.items()]
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
    times: dict[str, int] = {}
    for name, count in restarts.items():
        process = shared.get(name, name)
        times[process] = max(count, times.get(process, 0))
    return {process: count for process, count in sorted(times.items()) if count}


def _each(counts: Mapping[str, int]) -> list[str]:
    return [f"{short(name)} {_times(times)}" for name, times in counts.items()]


def _few(each: Sequence[str], together: str) -> Sequence[str]:
    return each if len(each) <= NAMED else [f"{len(each)} {together}"]


def _if(there: object, words: str) -> list[str]:
    return [words] if there else []


def _times(count: int) -> str:
    return "once" if count == 1 else f"{count} times"
