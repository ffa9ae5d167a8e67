"""The files that those of a dive name: what a recording must carry besides them, so that the dive
can be flown again."""

from collections.abc import Iterator, Sequence
from contextlib import suppress
from pathlib import Path

from messages.link import LinkRequest
from services.gamepad.core import Settings
from services.piloting.sticks import Incident
from services.runtime.config.errors import LindyError
from services.runtime.config.settings import deploy_file
from services.runtime.config.stack import SCRIPT, Stack
from services.runtime.hosts.stack_file import bases
from services.tether.io.profile_file import named, traces


def read_besides(stack: Stack, incidents: Sequence[Incident], courses: Sequence[str]) -> list[str]:
    """The stacks that the stack extends, traces of the link, the pad profile, and the links and
    paths that a script names.

    Args:
        incidents: of the script.
        courses: names of the paths in it.
    """
    return [*dict.fromkeys(map(str, _named(stack, incidents, courses)))]


def _named(stack: Stack, incidents: Sequence[Incident], courses: Sequence[str]) -> Iterator[Path]:
    yield from bases(deploy_file("stacks", stack.services))
    yield from _traces(stack.link)
    for incident in incidents:
        if isinstance(incident, LinkRequest) and incident.profile is not None:
            with suppress(LindyError):  # the tether will refuse it
                yield deploy_file("links", incident.profile)
            yield from _traces(incident.profile)
    for course in courses:
        yield deploy_file("paths", course)
    if not stack.pilot.startswith(SCRIPT):
        with suppress(LindyError):  # the service says what is wrong with it
            yield deploy_file("pads", stack.section("gamepad", Settings).profile)


def _traces(link: str) -> list[Path]:
    with suppress(LindyError):
        return traces(named(link))
    return []
