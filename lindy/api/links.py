"""The model of a tether: delay, loss, rate, queue and outages, by profile. The same profile and
seed give the same fates."""

from services.tether.io.profile_file import named
from services.tether.link_model import fates
from services.tether.profile import LinkProfile, Named

__all__ = ["LinkProfile", "Named", "fates", "named"]
