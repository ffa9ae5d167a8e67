"""What the names in `Health.counts` mean, in plain words for a pilot.

A name is `kind` or `kind:subject`, such as `clamped:reference.depth`. Whoever shows counts takes
the words and the order of importance from here.
"""

from enum import IntEnum
from typing import NamedTuple


class Rank(IntEnum):
    """Most important first."""

    FAILSAFE = 0  # the drone acted by itself
    DANGER = 1  # a part of the drone or of the link cannot be relied on
    DATA = 2  # the recording is not whole
    PILOT = 3  # something the pilot asked for was not done
    SENSOR = 4  # a measurement was not used
    LIMIT = 5  # a value was at its limit
    MESSAGE = 6  # a message was not used
    ROUTINE = 7  # part of any good dive


class Meaning(NamedTuple):
    rank: Rank
    words: str


FAILSAFE, DANGER, DATA, PILOT, SENSOR, LIMIT, MESSAGE, ROUTINE = Rank
_HELD_BACK = "was held back because the drone could not follow"

# Names that say more than their kind does.
NAMES: dict[str, Meaning] = {
    "failsafe:pilot_lost": Meaning(FAILSAFE, "pilot lost: the drone came to rest and held"),
    "failsafe:state_lost": Meaning(FAILSAFE, "drone's state lost: it came to rest"),
    "alarm:link": Meaning(DANGER, "the link got worse"),
    "clamped:reference.depth": Meaning(LIMIT, f"the wanted depth {_HELD_BACK}"),
    "clamped:reference.heading": Meaning(LIMIT, f"the wanted heading {_HELD_BACK}"),
    "clamped:reference.place": Meaning(LIMIT, f"the wanted place {_HELD_BACK}"),
    "lost:depth": Meaning(DANGER, "the depth was not known"),
    "lost:place": Meaning(DANGER, "the place could not be held any more"),
    "lost:position": Meaning(DANGER, "the position was not known"),
    "lost:live_viewer": Meaning(MESSAGE, "the live viewer was lost"),
    "dropped:live": Meaning(MESSAGE, "the live viewer could not keep up"),
    "invalid:state.position": Meaning(DANGER, "the place was held without knowing it"),
    "late:sensor/pressure": Meaning(SENSOR, "the pressure sensor's samples came late"),
    "outlier:vehicle/actuation": Meaning(SENSOR, "a thruster's report did not fit the motion"),
    "saturated:sensor/imu": Meaning(SENSOR, "the IMU was at the end of its range"),
    "implausible:atmosphere": Meaning(SENSOR, "the air pressure at the start cannot be true"),
    "impossible:clock/pong": Meaning(MESSAGE, "an answer to a clock ping cannot be true"),
    "malformed:memory": Meaning(DATA, "what a service remembered could not be read"),
    "not_remembered:disk": Meaning(DATA, "a service could not remember: the disk is full"),
    "wrong_length:vehicle/actuation": Meaning(SENSOR, "a thruster report was of the wrong length"),
    "stale:pilot/command": Meaning(SENSOR, "the pilot's commands were too old to be used"),
    "stale:control/thrusters": Meaning(DANGER, "the thrusters stopped for want of commands"),
}

# First word of all other names.
KINDS: dict[str, Meaning] = {
    "failsafe": Meaning(FAILSAFE, "the drone acted by itself"),
    "alarm": Meaning(DANGER, "an alarm was raised"),
    "empty": Meaning(DANGER, "the battery was empty"),
    "unplugged": Meaning(DANGER, "the gamepad was unplugged"),
    "closed": Meaning(DANGER, "the keyboard's window was closed"),
    "outdone": Meaning(DANGER, "another pilot took the sticks"),
    "distrusted": Meaning(DANGER, "a thruster did not do what it was told"),
    "lost_axis": Meaning(DANGER, "a direction could not be driven any more"),
    "not_finite": Meaning(DANGER, "a calculation failed and was begun anew"),
    "restarted": Meaning(DANGER, "an estimate was begun anew"),
    "invalid": Meaning(DANGER, "control had to do without an estimate"),
    "predicted": Meaning(DANGER, "the drone's state was guessed because its IMU was silent"),
    "not_recorded": Meaning(DATA, "a message was not recorded"),
    "disk_error": Meaning(DATA, "the disk could not be written"),
    "unreadable": Meaning(DATA, "a recorded message could not be read back"),
    "refused": Meaning(PILOT, "a request was refused"),
    "refused_here": Meaning(PILOT, "a request was not sent because a stick was deflected"),
    "unanswered": Meaning(PILOT, "a request was not answered"),
    "silent_by_fault": Meaning(SENSOR, "a simulated fault kept a sensor silent"),
    "frozen": Meaning(SENSOR, "a sensor kept saying the same"),
    "silent": Meaning(SENSOR, "a stream fell silent"),
    "stale": Meaning(SENSOR, "a stream was too old to be used"),
    "gap": Meaning(SENSOR, "a sensor or the state left a gap"),
    "rate": Meaning(SENSOR, "a sensor came at the wrong rate"),
    "implausible": Meaning(SENSOR, "a measurement that cannot be true was left out"),
    "outlier": Meaning(SENSOR, "a measurement far from all others was left out"),
    "clipped": Meaning(SENSOR, "a measurement was off to one side for too long"),
    "disturbed": Meaning(SENSOR, "the compass was disturbed and left out"),
    "limited": Meaning(SENSOR, "the compass deviates by more than can be corrected"),
    "no_bottom": Meaning(SENSOR, "the Doppler log did not reach the bottom"),
    "too_old": Meaning(SENSOR, "a measurement came too late to be used"),
    "ahead": Meaning(SENSOR, "a measurement claimed to come from the future"),
    "not_newer": Meaning(SENSOR, "a sample was not newer than the one before"),
    "wrong_length": Meaning(SENSOR, "a message had the wrong number of values"),
    "waiting": Meaning(SENSOR, "calibration waited for a sensor"),
    "moved": Meaning(SENSOR, "the drone moved while it was calibrated"),
    "late": Meaning(LIMIT, "an axis was held by a late estimate, with gentle gains"),
    "disarmed": Meaning(LIMIT, "thrust was asked for while the drone was disarmed"),
    "clamped": Meaning(LIMIT, "a value was held at its limit"),
    "saturated": Meaning(LIMIT, "a thruster reached its limit"),
    "undriven": Meaning(LIMIT, "a motion was asked for that the thrusters cannot make"),
    "missed_deadline": Meaning(LIMIT, "a step was skipped on a busy computer"),
    "jumped": Meaning(MESSAGE, "a clock was set"),
    "outage": Meaning(MESSAGE, "a message found no link"),
    "burst": Meaning(MESSAGE, "the link lost a message in a burst"),
    "loss": Meaning(MESSAGE, "the link lost a message"),
    "trace": Meaning(MESSAGE, "the link lost a message, as it was measured"),
    "queue_full": Meaning(MESSAGE, "a message found the link's queue full"),
    "codel": Meaning(MESSAGE, "a message had waited too long for the link"),
    "too_many": Meaning(MESSAGE, "a message was one too many on the way"),
    "thinned": Meaning(MESSAGE, "a message was left out because the link is narrow"),
    "damaged": Meaning(MESSAGE, "the link damaged a message"),
    "lost": Meaning(MESSAGE, "a message never arrived"),
    "expired": Meaning(MESSAGE, "a command came too late to be used"),
    "dropped": Meaning(MESSAGE, "a message was dropped"),
    "reordered": Meaning(MESSAGE, "a message came out of order and was left out"),
    "duplicated": Meaning(MESSAGE, "a message came twice"),
    "malformed": Meaning(MESSAGE, "a message could not be read"),
    "wrong_type": Meaning(MESSAGE, "a message was of the wrong type"),
    "wrong_epoch": Meaning(MESSAGE, "a command came from somebody who has not got the sticks"),
    "unknown": Meaning(MESSAGE, "a message came on a key nobody knows"),
    "unknown_key": Meaning(MESSAGE, "a message came on a key nobody knows"),
    "too_many_keys": Meaning(MESSAGE, "a message came on one key too many"),
    "from_future": Meaning(MESSAGE, "a message claimed to come from the future"),
    "unsynchronised": Meaning(MESSAGE, "a message came before the clocks were compared"),
    "overflowed": Meaning(MESSAGE, "a message came faster than it could be handled"),
    "skipped": Meaning(MESSAGE, "a message was passed over for a newer one"),
    "accelerating": Meaning(ROUTINE, "the drone was too fast to see which way is down"),
    "resting": Meaning(ROUTINE, "the gyroscope was calibrated at rest"),
}

SHORT = {"failsafe:pilot_lost": "pilot lost", "failsafe:state_lost": "drone's state lost"}


def known(name: str) -> bool:
    """Are there words for this name?"""
    return name in NAMES or name.partition(":")[0] in KINDS


def meaning(name: str) -> Meaning:
    """Rank and words of a name; a name that nobody knows stands for itself."""
    kind = name.partition(":")[0]
    return NAMES.get(name) or KINDS.get(kind) or Meaning(Rank.SENSOR, kind)


def sentence(name: str) -> str:
    """What happened, and to what where the words alone do not say it."""
    kind, _, subject = name.partition(":")
    words = meaning(name).words
    return words if name in NAMES or kind not in KINDS or not subject else f"{words} ({subject})"


def short(name: str) -> str:
    """A failsafe in two or three words."""
    return SHORT.get(name, name.partition(":")[2].replace("_", " "))


def in_words(text: str) -> str:
    """A log line that is the name of a count, as its sentence; any other text as it is."""
    return sentence(text) if ":" in text and " " not in text and known(text) else text
