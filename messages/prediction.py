"""Where the drone is by now, though the pilot cannot see it yet. From `predictor`, topside."""

import msgspec

from messages.message import Message
from messages.units import Finite, NotNegative, Stamp


class Miss(msgspec.Struct, frozen=True):
    """How far off a picture of the drone was, rms over the last seconds."""

    depth: NotNegative  # [m]
    heading: NotNegative  # [rad]
    place: NotNegative | None = None  # [m] horizontal; None: the drone does not measure its place


class Prediction(Message, frozen=True, kw_only=True):
    """The newest state that arrived, run ahead over the commands that were on the way.

    Judged later, when the state of that moment has arrived.
    """

    state_ns: Stamp  # [ns] sensor sample of the state it starts from
    ahead_ms: NotNegative  # [ms] from there to now
    depth: Finite  # [m] positive down
    heading: Finite  # [rad] accumulates past ±π
    depth_rate: Finite  # [m/s]
    yaw_rate: Finite  # [rad/s]
    forward: Finite  # [m] moved ahead since that state
    starboard: Finite  # [m] moved sideways since that state
    north: Finite | None = None  # [m] NED, where the drone measures its place
    east: Finite | None = None  # [m]
    missed: Miss | None = None  # of the predictions
    delayed: Miss | None = None  # of the delayed picture, without a prediction
