"""The drone's present state, predicted from delayed telemetry. From `predictor`, topside."""

import msgspec

from messages.message import Message
from messages.units import Finite, NotNegative, Stamp


class Miss(msgspec.Struct, frozen=True):
    """Error of a prediction or of the delayed state, rms over the last seconds."""

    depth: NotNegative  # [m]
    heading: NotNegative  # [rad]
    place: NotNegative | None = None  # [m] horizontal; None: position is not measured


class Prediction(Message, frozen=True, kw_only=True):
    """The newest state that arrived, propagated to the present with the commands still on the link.

    Its error is known later, when the state of that moment has arrived.
    """

    state_ns: Stamp  # [ns] sensor sample of the state it starts from
    ahead_ms: NotNegative  # [ms] from that sample to now
    depth: Finite  # [m] positive down
    heading: Finite  # [rad] accumulates past ±π
    depth_rate: Finite  # [m/s]
    yaw_rate: Finite  # [rad/s]
    forward: Finite  # [m] moved ahead since that state
    starboard: Finite  # [m] moved sideways since that state
    north: Finite | None = None  # [m] NED, where the drone measures its position
    east: Finite | None = None  # [m]
    missed: Miss | None = None  # error of the predictions
    delayed: Miss | None = None  # error of the delayed state, without a prediction
