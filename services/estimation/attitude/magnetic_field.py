"""Detection of magnetic disturbances.

At one place the Earth's field has a constant strength, dip and direction. Iron nearby changes at
least one of strength, dip and agreement with the gyroscope.
"""

from math import degrees, radians

from services.estimation.attitude.attitude_filter import AttitudeSettings

LEAST_EARTH, MOST_EARTH = 20.0, 70.0  # [µT] the Earth's field is 22 to 67 µT


class MagneticField:
    """Decides for every sample whether the compass may be used.

    The normal field is the one learnt at calibration, or the one in the settings. After a
    disturbance the compass is used again once the field has been normal for `compass_hold_off`. A
    disturbance that stays constant for `field_relearn` becomes the new normal, unless the settings
    give the field: a vehicle that stays near iron cannot be told from one that has left the iron at
    its calibration site.
    """

    def __init__(self, settings: AttitudeSettings) -> None:
        self._settings = settings
        self.strength = settings.earth_field  # [µT] normal
        self.dip = None if settings.earth_dip is None else radians(settings.earth_dip)  # [rad]
        self.trusted = False
        self._good_for = 0.0  # [s] normal so far, after a disturbance
        self._steady_for = 0.0  # [s] the same so far, though not normal
        self._first = (0.0, 0.0, 0.0)  # strength, dip, bearing when that began
        self._counted = False  # this disturbance has been counted

    @property
    def disturbed(self) -> bool:
        """The field is not the normal one, or has not been for long: the compass is not used."""
        return self._counted and not self.trusted

    def learn(self, strength: float, dip: float) -> bool:
        """Set the normal field [µT, rad], measured at rest. False: it cannot be the Earth's."""
        if not self._can_be_the_earths(strength, dip):
            self._counted = True
            return False
        if self._settings.earth_field is None:
            self.strength = strength
        if self._settings.earth_dip is None:
            self.dip = dip
        self.trusted, self._counted = True, False
        return True

    def judge(
        self, strength: float, dip: float, bearing: float, innovation: float, gate: float, dt: float
    ) -> str | None:
        """One sample, `dt` [s] after the previous one; `innovation` [rad] is its difference from
        the gyroscope's north, `gate` [rad] the largest allowed. Returns an event to count;
        `trusted` then says whether the sample may be used."""
        if self.is_normal(strength, dip) and abs(innovation) <= gate:
            self._steady_for = 0.0
            if not self.trusted:
                self._good_for += dt
                self.trusted = self._good_for >= self._settings.compass_hold_off
                self._counted = self._counted and not self.trusted
            return None
        self._good_for, self.trusted = 0.0, False
        if self._is_new_normal(strength, dip, bearing, dt):
            self.learn(strength, dip)
            return "learnt"
        unknown = self.strength is None or self.dip is None
        if self._counted or (unknown and self._can_be_the_earths(strength, dip)):
            return None
        self._counted = True
        return "disturbed"

    def is_normal(self, strength: float, dip: float) -> bool:
        """Are strength [µT] and dip [rad] those of the normal field?"""
        s = self._settings
        if self.strength is None or self.dip is None:
            return False
        return (
            abs(strength - self.strength) <= s.field_tolerance
            and abs(degrees(dip - self.dip)) <= s.dip_tolerance
        )

    def _is_new_normal(self, strength: float, dip: float, bearing: float, dt: float) -> bool:
        s, first = self._settings, self._first
        same = (
            abs(strength - first[0]) <= s.field_tolerance
            and abs(degrees(dip - first[1])) <= s.dip_tolerance
            and abs(degrees(bearing - first[2])) <= s.compass_gate
        )
        if not same or not self._can_be_the_earths(strength, dip):
            self._first, self._steady_for = (strength, dip, bearing), 0.0
            return False
        self._steady_for += dt
        never = self.strength is None or self.dip is None
        return self._steady_for >= (s.compass_hold_off if never else s.field_relearn)

    def _can_be_the_earths(self, strength: float, dip: float) -> bool:
        s = self._settings
        if s.earth_field is not None and abs(strength - s.earth_field) > s.field_tolerance:
            return False
        if s.earth_dip is not None and abs(degrees(dip) - s.earth_dip) > s.dip_tolerance:
            return False
        return LEAST_EARTH <= strength <= MOST_EARTH
