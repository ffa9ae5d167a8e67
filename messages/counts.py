"""What the names in `Health.counts` mean, in plain words for a pilot.

A name is `kind` or `kind:subject`, such as `clamped:reference.depth`. The screen, the summary and
the report take the words and the order of importance from here.
"""

from enum import IntEnum
from typing import NamedTuple


class Rank(IntEnum):
    """Most important first."""

    FAILSAFE = 0  # the drone acted by itself
    DANGER = 1  # a part of the drone or of the link cannot be relied on
    DATA = 2  # the recording is incomplete
    PILOT = 3  # something the pilot asked for was not done
    SENSOR = 4  # a measurement was not used
    LIMIT = 5  # a value was at its limit
    MESSAGE = 6  # a message was not used
    ROUTINE = 7  # normal in any dive


class Meaning(NamedTuple):
    rank: Rank
    words: str


FAILSAFE, DANGER, DATA, PILOT, SENSOR, LIMIT, MESSAGE, ROUTINE = Rank
_HELD_BACK = "was held back because the drone could not follow"

# Names with words of their own.
NAMES: dict[str, Meaning] = {
    "failsafe:pilot_lost": Meaning(FAILSAFE, "pilot lost: the drone came to rest and held"),
    "failsafe:state_lost": Meaning(FAILSAFE, "drone's state lost: it came to rest"),
    "failsafe:link_lost": Meaning(FAILSAFE, "link lost: the drone came to rest and held"),
    "failsafe:imu_lost": Meaning(FAILSAFE, "IMU lost: the drone came to rest"),
    "failsafe:leak": Meaning(FAILSAFE, "water in the enclosure: the drone rose"),
    "failsafe:battery_critical": Meaning(FAILSAFE, "battery nearly empty: the drone rose"),
    "notice:leak": Meaning(DANGER, "water was noticed in the enclosure"),
    "notice:battery_critical": Meaning(DANGER, "the battery was noticed to be nearly empty"),
    "notice:battery_low": Meaning(DANGER, "the battery was low"),
    "notice:too_hot": Meaning(DANGER, "the enclosure was too hot"),
    "notice:too_deep": Meaning(DANGER, "the drone was deeper than its limit"),
    "notice:near_floor": Meaning(PILOT, "the bottom was close"),
    "notice:depth_limit": Meaning(PILOT, "the drone stopped at its depth limit"),
    "notice:control_silent": Meaning(DANGER, "control did not answer: the thrusters stopped"),
    "notice:service_silent": Meaning(DANGER, "a service on board did not answer"),
    "notice:service_late": Meaning(DANGER, "a service on board was late"),
    "notice:recorder_down": Meaning(DATA, "the recorder did not answer the drone"),
    "alarm:peers": Meaning(DANGER, "the other side runs another Lindy, or a service runs twice"),
    "alarm:other_drone": Meaning(DANGER, "the drone that was there had another name"),
    "alarm:junk": Meaning(DANGER, "services received many messages that they could not read"),
    "overruled:reference": Meaning(
        DANGER, "the pilot's disarm was obeyed by control; reference had not heard it"
    ),
    "alarm:link": Meaning(DANGER, "the link got worse"),
    "clamped:reference.depth": Meaning(LIMIT, f"the wanted depth {_HELD_BACK}"),
    "clamped:reference.heading": Meaning(LIMIT, f"the wanted heading {_HELD_BACK}"),
    "clamped:reference.place": Meaning(LIMIT, f"the wanted position {_HELD_BACK}"),
    "clamped:reference.horizontal": Meaning(
        LIMIT, "surge and sway were held back because the drone tilted too far"
    ),
    "lost:depth": Meaning(DANGER, "the depth was no longer known"),
    "lost:sensor/imu": Meaning(
        DANGER, "the IMU could not be used: no attitude and heading, depth from pressure alone"
    ),
    "lost:sensor/pressure": Meaning(
        DANGER, "no pressure sample could be used: the depth was not measured"
    ),
    "frozen:sensor/pressure": Meaning(
        DANGER, "the pressure sensor kept repeating one value: the depth was not measured"
    ),
    "unheld:depth": Meaning(DANGER, "the depth was not known and not held"),
    "unheld:heading": Meaning(DANGER, "the heading was not known and not held"),
    "lost:place": Meaning(DANGER, "the drone could no longer hold its position"),
    "lost:position": Meaning(DANGER, "the position was no longer known"),
    "lost:camera": Meaning(DANGER, "the camera gave no pictures"),
    "stale:picture": Meaning(MESSAGE, "a picture was too old to be sent"),
    "dropped:picture": Meaning(MESSAGE, "a picture did not arrive whole and was dropped"),
    "unencoded:picture": Meaning(MESSAGE, "the encoder gave nothing, or too much, for a picture"),
    "skipped:picture": Meaning(MESSAGE, "a picture was skipped for a newer one"),
    "left_out:picture": Meaning(ROUTINE, "a picture was left out to keep to the link's room"),
    "lost:live_viewer": Meaning(MESSAGE, "the live viewer was lost"),
    "dropped:live": Meaning(MESSAGE, "the live viewer could not keep up"),
    "invalid:state.position": Meaning(
        DANGER, "the position was held without a valid estimate of it"
    ),
    "distrusted:sensor/imu": Meaning(
        DANGER, "the vertical acceleration did not fit the pressure: depth from pressure alone"
    ),
    "trusted:sensor/imu": Meaning(
        SENSOR, "the vertical acceleration fitted the pressure again and was used"
    ),
    "doubted:gyroscope": Meaning(
        DANGER, "the gyroscope did not fit gravity: its bias was learnt anew, without a heading"
    ),
    "stepped:gyroscope": Meaning(
        DANGER,
        "the gyroscope's bias had changed: the heading was unknown until the compass gave it",
    ),
    "trusted:gyroscope": Meaning(
        SENSOR, "the gyroscope fitted gravity and the compass again and was used"
    ),
    "found:heading": Meaning(
        SENSOR, "the compass measured the heading again after a silence of the IMU"
    ),
    "jumped:sensor/pressure": Meaning(
        DANGER, "the pressure jumped and stayed: the depth, and the held depth, moved with it"
    ),
    "inconsistent:sensor/pressure": Meaning(
        DANGER, "the depth sensor moved more than its noise: waves, latency or a wrong IMU?"
    ),
    "late:sensor/pressure": Meaning(SENSOR, "pressure samples arrived late"),
    "outlier:vehicle/actuation": Meaning(SENSOR, "a thruster's report did not fit the motion"),
    "saturated:sensor/imu": Meaning(SENSOR, "the IMU reached the end of its range"),
    "wrong_force:sensor/imu": Meaning(
        DANGER, "the IMU's specific force at rest was not that of gravity"
    ),
    "upside_down:sensor/imu": Meaning(DANGER, "the IMU read as if the drone lay upside down"),
    "on_its_side:sensor/imu": Meaning(
        DANGER, "the IMU read as if the drone lay on its side or end"
    ),
    "moving:calibration": Meaning(
        DANGER, "the drone did not come to rest, or its gyroscope is not in rad/s"
    ),
    "implausible:atmosphere": Meaning(
        SENSOR, "the air pressure measured at the start is not plausible"
    ),
    "assumed:atmosphere": Meaning(
        DANGER, "the thrusters ran during calibration: the air pressure was only assumed"
    ),
    "impossible:clock/pong": Meaning(
        MESSAGE, "a reply to a clock ping was inconsistent and not used"
    ),
    "lost:sticks": Meaning(DANGER, "the ground station sent no sticks any more"),
    "lost:page_silent": Meaning(DANGER, "nothing arrived any more from the pilot's page"),
    "lost:page_hidden": Meaning(DANGER, "the pilot's page was hidden or its screen locked"),
    "lost:page_unplugged": Meaning(DANGER, "the pad was unplugged from the browser"),
    "lost:page_frozen": Meaning(DANGER, "the pad held a stick and reported nothing any more"),
    "lost:page_closed": Meaning(DANGER, "the pilot's page was closed"),
    "not_the_holder:page": Meaning(PILOT, "another page of the cockpit had the sticks"),
    "refused:watcher": Meaning(PILOT, "a page that only watches tried to command"),
    "refused:page": Meaning(MESSAGE, "a foreign page or program was refused by the cockpit"),
    "malformed:page": Meaning(MESSAGE, "a page sent what could not be read"),
    "oversized:page": Meaning(MESSAGE, "a page sent a message that was too long"),
    "wrong_version:page": Meaning(MESSAGE, "a page of another version was refused"),
    "expired:wish": Meaning(PILOT, "a pilot's request came too late from the page"),
    "dropped:page": Meaning(ROUTINE, "a page was too slow and missed a picture of the drone"),
    "dropped:page_video": Meaning(ROUTINE, "a page was too slow and missed a camera's picture"),
    "broken:page_video": Meaning(
        MESSAGE, "a camera's picture was lost: pages had none until the next keyframe"
    ),
    "too_many:page": Meaning(PILOT, "there were too many pages of the cockpit"),
    "too_many:page_messages": Meaning(PILOT, "a page sent too many messages and was closed"),
    "too_many:connection": Meaning(PILOT, "there were too many connections to the cockpit"),
    "refused:command": Meaning(PILOT, "a command of a ground station was refused"),
    "refused:parameter": Meaning(PILOT, "a parameter was not changed for a ground station"),
    "too_many:mavlink": Meaning(PILOT, "there were too many ground stations at once"),
    "dropped:mavlink": Meaning(MESSAGE, "a ground station did not read what it was sent"),
    "hung:recorder": Meaning(DATA, "the recorder did not answer"),
    "malformed:memory": Meaning(DATA, "a service's checkpoint could not be read"),
    "not_remembered:disk": Meaning(DATA, "a service's checkpoint could not be written to the disk"),
    "wrong_length:vehicle/actuation": Meaning(
        SENSOR, "a thruster report had the wrong number of values"
    ),
    "outdone:ardusub": Meaning(
        DANGER, "the board was armed, disarmed or switched by others: Lindy let it go"
    ),
    "refused:board": Meaning(DANGER, "the vehicle's board was not accepted and not armed"),
    "refused:arm": Meaning(DANGER, "the vehicle's board refused to arm"),
    "silent:pad": Meaning(DANGER, "the pad was connected and did not answer any more: pilot lost"),
    "silent:board": Meaning(DANGER, "the vehicle's board was silent for a second"),
    "jumped:board_clock": Meaning(DANGER, "the clock of the vehicle's board jumped"),
    "shifted:board_clock": Meaning(
        MESSAGE, "the clock of the vehicle's board shifted by some milliseconds"
    ),
    "stale:pilot/command": Meaning(SENSOR, "the pilot's commands were too old to be used"),
    "stale:control/thrusters": Meaning(
        DANGER, "the thrusters stopped because no new command arrived"
    ),
}

# All other names, by their first word.
KINDS: dict[str, Meaning] = {
    "failsafe": Meaning(FAILSAFE, "the drone acted by itself"),
    "notice": Meaning(DANGER, "the drone noticed something that the pilot has to know"),
    "alarm": Meaning(DANGER, "an alarm was raised"),
    "empty": Meaning(DANGER, "the battery was empty"),
    "stalled": Meaning(DANGER, "a service handled nothing for over 0.14 s"),
    "hung": Meaning(DANGER, "a service ran but did not answer"),
    "unplugged": Meaning(DANGER, "the gamepad was unplugged"),
    "closed": Meaning(DANGER, "the keyboard's window was closed"),
    "leak": Meaning(DANGER, "water was found inside the vehicle"),
    "outdone": Meaning(DANGER, "another pilot took control"),
    "stranger": Meaning(DANGER, "somebody else spoke to the board in Lindy's name"),
    "distrusted": Meaning(DANGER, "a thruster did not follow its commands"),
    "lost_axis": Meaning(DANGER, "the thrusters could no longer move the drone along an axis"),
    "not_finite": Meaning(DANGER, "a calculation gave no finite number and was restarted"),
    "restarted": Meaning(DANGER, "an estimator was restarted"),
    "mistake": Meaning(DANGER, "a mistake in Lindy itself: the screen may be wrong"),
    "invalid": Meaning(DANGER, "control had to work without an estimate"),
    "predicted": Meaning(DANGER, "the drone's state was predicted because its IMU was silent"),
    "not_recorded": Meaning(DATA, "a message was not recorded"),
    "disk_error": Meaning(DATA, "writing to the disk failed"),
    "unreadable": Meaning(DATA, "a recorded message could not be read back"),
    "refused": Meaning(PILOT, "a request was refused"),
    "overtaken": Meaning(PILOT, "a disarm arrived after a later arm, and was not obeyed"),
    "overruled": Meaning(DANGER, "a service had not heard the pilot's disarm"),
    "refused_here": Meaning(PILOT, "a request was not sent because a stick was deflected"),
    "unanswered": Meaning(PILOT, "a request was not answered"),
    "wrong_unit": Meaning(DANGER, "the values of a sensor did not fit its unit"),
    "old_stamps": Meaning(DANGER, "samples of a sensor were too old when they arrived"),
    "unusable": Meaning(DANGER, "no sample of a sensor could be used"),
    "silent_by_fault": Meaning(SENSOR, "a simulated fault silenced a sensor"),
    "regained": Meaning(SENSOR, "a sensor that was lost could be used again"),
    "unheld": Meaning(DANGER, "an axis was not held because its estimate was not valid"),
    "noisy": Meaning(DANGER, "a sensor was too noisy to be used"),
    "frozen": Meaning(SENSOR, "a sensor kept repeating the same value"),
    "silent": Meaning(SENSOR, "a stream stopped arriving"),
    "stale": Meaning(SENSOR, "a stream was too old to be used"),
    "gap": Meaning(SENSOR, "samples of a sensor or of the state were missing"),
    "rate": Meaning(SENSOR, "a sensor sampled at the wrong rate"),
    "implausible": Meaning(SENSOR, "an implausible measurement was rejected"),
    "outlier": Meaning(SENSOR, "a measurement far from all others was rejected"),
    "clipped": Meaning(SENSOR, "measurements deviated to the same side for too long"),
    "disturbed": Meaning(SENSOR, "the compass was disturbed and not used"),
    "limited": Meaning(SENSOR, "the compass deviates by more than can be corrected"),
    "no_bottom": Meaning(SENSOR, "the Doppler log (DVL) had no bottom lock"),
    "too_old": Meaning(SENSOR, "a measurement came too late to be used"),
    "ahead": Meaning(SENSOR, "a measurement had a time stamp in the future"),
    "not_newer": Meaning(SENSOR, "a sample was not newer than the previous one"),
    "wrong_length": Meaning(SENSOR, "a message had the wrong number of values"),
    "waiting": Meaning(SENSOR, "calibration waited for a sensor"),
    "moved": Meaning(SENSOR, "the drone moved during calibration"),
    "late": Meaning(LIMIT, "an axis was controlled with a late estimate and lower gains"),
    "disarmed": Meaning(LIMIT, "thrust was asked for while the drone was disarmed"),
    "clamped": Meaning(LIMIT, "a value was limited"),
    "saturated": Meaning(LIMIT, "a thruster reached its limit"),
    "undriven": Meaning(LIMIT, "a motion was asked for that the thrusters cannot produce"),
    "missed_deadline": Meaning(LIMIT, "a periodic step was skipped on a busy computer"),
    "jumped": Meaning(MESSAGE, "a clock jumped"),
    "outage": Meaning(MESSAGE, "a message was lost because the link was down"),
    "burst": Meaning(MESSAGE, "the link lost a message in a burst of losses"),
    "loss": Meaning(MESSAGE, "the link lost a message"),
    "no_room": Meaning(MESSAGE, "a picture was dropped because the link had no room for it"),
    "undecodable": Meaning(MESSAGE, "a picture could not be decoded"),
    "wrong_stamp": Meaning(SENSOR, "the time in a picture was not that of its stamp"),
    "trace": Meaning(MESSAGE, "the link lost a message, as in the recorded trace"),
    "queue_full": Meaning(MESSAGE, "a message was dropped because the link's queue was full"),
    "codel": Meaning(MESSAGE, "a message was dropped after waiting too long for the link"),
    "too_many": Meaning(MESSAGE, "a message was dropped because too many were on the link"),
    "thinned": Meaning(MESSAGE, "a telemetry message was left out because the link is slow"),
    "damaged": Meaning(MESSAGE, "the link damaged a message"),
    "lost": Meaning(MESSAGE, "a message never arrived: lost, or left out by a router that thins"),
    "expired": Meaning(MESSAGE, "a command arrived too late to be used"),
    "dropped": Meaning(MESSAGE, "a message was dropped"),
    "reordered": Meaning(MESSAGE, "a message arrived out of order and was not used"),
    "duplicated": Meaning(MESSAGE, "a message arrived twice"),
    "malformed": Meaning(MESSAGE, "a message could not be read"),
    "not_the_holder": Meaning(PILOT, "another ground station had the sticks"),
    "wrong_target": Meaning(MESSAGE, "a message was for another vehicle"),
    "ignored": Meaning(MESSAGE, "a message asked for what there is not"),
    "unknown_parameter": Meaning(MESSAGE, "a parameter was asked for that there is not"),
    "does_not_fit": Meaning(MESSAGE, "a number did not fit into a message and was not sent"),
    "wrong_type": Meaning(MESSAGE, "a message was of the wrong type"),
    "replayed": Meaning(MESSAGE, "a recorded message that was played again was refused"),
    "wrong_epoch": Meaning(MESSAGE, "a command came from a pilot who is not in control"),
    "unknown": Meaning(MESSAGE, "a message arrived on an unknown key"),
    "unknown_key": Meaning(MESSAGE, "a message arrived on an unknown key"),
    "too_many_keys": Meaning(MESSAGE, "a message arrived on more keys than are accepted"),
    "from_future": Meaning(MESSAGE, "a message had a time stamp in the future"),
    "unsynchronised": Meaning(MESSAGE, "a message arrived before the clocks were synchronised"),
    "overflowed": Meaning(MESSAGE, "messages arrived faster than they could be handled"),
    "oversized": Meaning(MESSAGE, "a message was too long to be kept"),
    "miscounted": Meaning(MESSAGE, "a sender numbered its messages wrongly"),
    "uncounted": Meaning(MESSAGE, "more kinds of counts than a health message holds"),
    "skipped": Meaning(MESSAGE, "a message was skipped for a newer one"),
    "accelerating": Meaning(ROUTINE, "the drone accelerated too much to measure roll and pitch"),
    "resting": Meaning(ROUTINE, "the gyroscope was calibrated at rest"),
}

SHORT = {
    "failsafe:pilot_lost": "pilot lost",
    "failsafe:state_lost": "drone's state lost",
    "failsafe:imu_lost": "IMU lost",
}


def known(name: str) -> bool:
    """Are there words for this name?"""
    return name in NAMES or name.partition(":")[0] in KINDS


def meaning(name: str) -> Meaning:
    """Rank and words of a name; an unknown name is shown as it is."""
    kind = name.partition(":")[0]
    return NAMES.get(name) or KINDS.get(kind) or Meaning(Rank.SENSOR, kind)


def sentence(name: str) -> str:
    """What happened, and to what, where the words alone do not say so."""
    kind, _, subject = name.partition(":")
    words = meaning(name).words
    return words if name in NAMES or kind not in KINDS or not subject else f"{words} ({subject})"


def short(name: str) -> str:
    """A failsafe, or a service that did not answer, in two or three words."""
    if is_hung(name):
        return f"{name.partition(':')[2]} did not answer"
    return SHORT.get(name, name.partition(":")[2].replace("_", " "))


def is_hung(name: str) -> bool:
    """Does it count how often a service ran but did not answer?"""
    return name.partition(":")[0] == "hung"


def in_words(text: str) -> str:
    """A log line that is the name of a count, as its sentence; any other text as it is."""
    return sentence(text) if ":" in text and " " not in text and known(text) else text
