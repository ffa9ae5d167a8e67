"""Is the magnetic field the Earth's, or is there iron?

The Earth's field has one strength and one dip at a place, and it does not turn when the vehicle
does. Iron nearby breaks at least one of the three: strength, dip, or agreement with the gyroscope.
"""

from math import degrees, radians

from services.estimation.attitude.attitude_filter import AttitudeSettings

LEAST_EARTH, MOST_EARTH = 20.0, 70.0  # [µT] the Earth's field is 22 to 67 µT


class MagneticField:
    """Says for every sample whether the compass may be used.

    The field learnt at calibration, or the one the settings name, is what is normal. After a
    passage of disturbance the compass comes back once the field has been normal for
    `compass_hold_off`. A disturbance that stays the same for `field_relearn` is the new normal,
    unless the settings name the field: from inside, a vehicle that came near iron to stay looks
    like one that left the iron it was calibrated at.
    """

    def __init__(self, settings: AttitudeSettings) -> None:
        self._settings = settings
        self.strength = settings.earth_field  # [µT] normal
        self.dip = None if settings.earth_dip is None else radians(settings.earth_dip)  # [rad]
        self.trusted = False
        self._good_for = 0.0  # [s] normal so far, after a disturbance
        self._steady_for = 0.0  # [s] the same so far, though not normal
        self._first = (0.0, 0.0, 0.0)  # strength, dip, bearing when that began
        self._told = False  # this disturbance has been counted

    def learn(self, strength: float, dip: float) -> bool:
        """Take a field [µT, rad] measured at rest for normal. False: it cannot be the Earth's."""
        if not self._can_be_the_earths(strength, dip):
            self._told = True
            return False
        if self._settings.earth_field is None:
            self.strength = strength
        if self._settings.earth_dip is None:
            self.dip = dip
        self.trusted, self._told = True, False
        return True

    def judge(
        self, strength: float, dip: float, bearing: float, surprise: float, gate: float, dt: float
    ) -> str | None:
        """One sample, `dt` [s] after the one before; `surprise` [rad] is how far it is from where
        the gyroscope says north is, and `gate` how far it may be. Returns what is to be counted;
        `trusted` then says whether the sample may be used."""
        if self._is_normal(strength, dip) and abs(surprise) <= gate:
            self._steady_for = 0.0
            if not self.trusted:
                self._good_for += dt
                self.trusted = self._good_for >= self._settings.compass_hold_off
                self._told = self._told and not self.trusted
            return None
        self._good_for, self.trusted = 0.0, False
        if self._is_new_normal(strength, dip, bearing, dt):
            self.learn(strength, dip)
            return "learnt"
        unknown = self.strength is None or self.dip is None
        if self._told or (unknown and self._can_be_the_earths(strength, dip)):
            return None
        self._told = True
        return "disturbed"

    def _is_normal(self, strength: float, dip: float) -> bool:
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
