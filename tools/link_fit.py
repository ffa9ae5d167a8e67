"""Checks whether a drone can be piloted over a link. Where even the fastest command arrives too
late, it never arms."""

import msgspec
import numpy as np

from messages.pilot import TTL_MS, PilotCommand
from services.runtime.config.errors import LindyError
from services.runtime.config.settings import DEPLOY
from services.tether.io.profile_file import Named, named
from services.tether.profile import TAIL, Delay, DirectionProfile, Trace

COMMAND = PilotCommand(stamp_ns=10**15, surge=0.0, sway=0.0, heave=0.0, yaw=0.0)  # a short one
COMMAND_BYTES = len(msgspec.msgpack.encode(COMMAND))


def shortest_ms(leg: DirectionProfile) -> float:
    """[ms] Shortest one-way delay of a pilot command over this direction of a link."""
    sending = 0.0
    if leg.rate_kbit > 0.0:
        sending = (COMMAND_BYTES + leg.overhead_bytes) * 8.0 / leg.rate_kbit
    return leg.delay_ms + sending + _least_ms(leg.delay)


def _least_ms(delay: Delay | None) -> float:
    """[ms] Least that a delay adds; infinite where everything is lost."""
    if delay is None:
        return 0.0
    if isinstance(delay, Trace):
        passed = zip(delay.sent_s, delay.arrived_s, strict=True)
        return min((1e3 * (at - sent) for sent, at in passed if at is not None), default=np.inf)
    return float(delay.quantile(np.array([TAIL]))[0])


def can_be_flown(link: Named) -> bool:
    return shortest_ms(link.profile.down) <= TTL_MS


def why_not_flown(link: Named) -> str | None:
    """Why no command can arrive in time over this link, and what is allowed; None: one can."""
    if can_be_flown(link):
        return None
    return (
        f"{link.name} cannot be flown: a command needs {shortest_ms(link.profile.down):.0f} ms to"
        f" the drone at best, and is ignored when older than {TTL_MS:g} ms, so the drone would"
        f" never arm, or would lose its pilot; links that can be flown: {', '.join(flyable())}"
        f" (`lindy link show --profile {link.name}` shows what this one does to messages)"
    )


def check_can_be_flown(link: Named) -> None:
    """Raises LindyError: no command can arrive in time over this link."""
    if why := why_not_flown(link):
        raise LindyError(f"--link {why}")


def flyable() -> list[str]:
    """Profiles of deploy/links that can be flown."""
    return [name for name in profiles() if can_be_flown(named(name))]


def profiles() -> list[str]:
    return sorted(file.stem for file in (DEPLOY / "links").glob("*.toml"))
