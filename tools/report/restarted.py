"""Which processes were started again, and the services that each crash took with it."""

from collections.abc import Mapping


def restarted(restarts: Mapping[str, int], shared: Mapping[str, str]) -> list[str]:
    """`control 1 ×`, or of services in one process `onboard (estimation, reference) 1 ×`.

    Args:
        restarts: times each service and hub was started again; a process takes all its services.
        shared: the process of each service that is not alone in a process of its own name.
    """
    parts: dict[str, list[str]] = {}
    for name in sorted(restarts):
        if name in shared:
            parts.setdefault(shared[name], []).append(name)
    return [
        " ".join(filter(None, (process, _bracketed(parts.get(process, [])), f"{count} ×")))
        for process, count in by_process(restarts, shared).items()
    ]


def by_process(restarts: Mapping[str, int], shared: Mapping[str, str]) -> dict[str, int]:
    """Times each process was started again, of those that were. Arguments as of `restarted`."""
    times: dict[str, int] = {}
    for name, count in restarts.items():
        process = shared.get(name, name)
        times[process] = max(count, times.get(process, 0))
    return {process: count for process, count in sorted(times.items()) if count}


def _bracketed(names: list[str]) -> str:
    return f"({', '.join(names)})" if names else ""
