"""Where the messages of a dive are: recorded, or lost where somebody counted it.

Sent = recorded + lost on the link + thinned + dropped in a queue + refused or lost by the recorder
+ not yet reported + missing, for every topic. Sent is known from the sequence numbers, so the parts
are taken from what is missing there, and never add up to more. What was counted beyond that was
lost before the first or after the last message of a topic that is in the recording.
"""

from collections import Counter
from collections.abc import Collection, Iterable, Mapping

import msgspec

from messages import events, topics
from messages.events import Row
from messages.health import Health
from messages.topic import Direction
from tools.analysis.losses import LINK, LOST, QUEUES, THINNED, crosses, family, missed, take
from tools.health_sums import HealthSums
from tools.log.numbering import Numbering
from tools.recordings.recording import Raw, Recording

# What the recorder counts for a message that it received and could not keep.
REFUSED = (events.MALFORMED, events.WRONG_TYPE, events.TOO_MANY_KEYS)
ANY_TOPIC = (
    events.OVERFLOWED("**"), events.OVERSIZED("**"), events.NOT_RECORDED()
)  # it does not know of which topic  # fmt: skip
HEALTH = topics.HEALTH.key[:-1]
SLACK, SLACK_SHARE = 100, 0.01  # messages before the first and after the last of what is here


class Account(msgspec.Struct, kw_only=True):
    """Of one topic, in messages."""

    before: int  # sent before the recording began; in no sum
    sent: int
    recorded: int  # each once
    link: int = 0  # lost on the link
    thinned: int = 0  # left out by the emulated link because it is slow
    queue: int = 0  # dropped because too many waited for the link
    refused: int = 0  # the recorder could not read them
    recorder: int = 0  # the recorder had no room for them, or its disk
    unreported: int = 0  # after the link's last report, or before its first
    missing: int = 0  # nobody accounts for these
    duplicated: int = 0  # arrived more than once; in no sum
    reordered: int = 0  # arrived late; they are recorded


class Accounts(msgspec.Struct, kw_only=True):
    topics: dict[str, Account]  # by key
    backwards: int = 0  # times that the recorder's clock ran backwards
    unrecorded: list[str] = []  # what services say they have sent, and is in no topic here
    remarks: list[str] = []  # what could not be taken into account

    @property
    def missing(self) -> int:
        return sum(account.missing for account in self.topics.values())


class LinkReports:
    """What the link, or where it is a real one its receivers, counted as lost."""

    def __init__(self) -> None:
        self.first_ns: int | None = None  # [ns] UTC of its first report, if the dive had begun
        self.last_ns = 0  # [ns] UTC of its last report
        self._services: dict[str, HealthSums] = {}
        self._before = Counter[str]()  # counted by the link before the recording began

    def add(self, health: Health, log_ns: int) -> None:
        sums = self._services.setdefault(health.service, HealthSums())
        if health.service == LINK:
            if not sums.said and health.seq > 0:
                self.first_ns, self._before = log_ns, Counter(health.counts)
            self.last_ns = log_ns
        sums.add(health)

    @property
    def emulated(self) -> bool:
        """Is the link a service that counts what it loses?"""
        return LINK in self._services

    def of(self, name: str, reasons: Iterable[Row]) -> int:
        """Messages of a topic of the table that the link lost for one of these reasons."""
        counts = self._services[LINK].counts - self._before if self.emulated else Counter[str]()
        return sum(counts[reason(name).name] for reason in reasons)

    def sent_by(self, side: str) -> tuple[set[str], int]:
        """Services of a side, and messages that they have sent, both ways across the link aside."""
        of_side = {n: s for n, s in self._services.items() if s.side == side and n != LINK}
        return {*of_side}, sum(sums.sent for sums in of_side.values())

    def missed(self, key: str) -> int:
        """Messages that a service on this side missed: on a real link nobody else counts them."""
        return max((missed(sums.counts, key) for sums in self._services.values()), default=0)


def accounts(recording: Recording) -> Accounts:
    """Read a recording, and account for every topic in it."""
    numbers: dict[str, Numbering] = {}
    reports = LinkReports()
    backwards, newest = 0, 0

    for raw in recording.raw():
        if (numbering := numbers.get(raw.key)) is None:
            numbering = numbers[raw.key] = Numbering()
        numbering.see(raw.sequence, raw.publish_ns, raw.log_ns)
        backwards += raw.log_ns < newest
        newest = raw.log_ns
        if raw.key.startswith(HEALTH):
            _add(reports, recording, raw)
    numbers = {key: numbering for key, numbering in numbers.items() if numbering.recorded}
    side = recording.metadata("dive").get("side", "drone")
    found = account_for(numbers, reports, recording.losses(), side)
    unrecorded = unrecorded_in(found, *reports.sent_by(side), side)
    return Accounts(topics=found, backwards=backwards, unrecorded=unrecorded)


def unrecorded_in(
    found: Mapping[str, Account], services: Collection[str], sent: int, side: str
) -> list[str]:
    """A topic that is missing as a whole has no numbers. But its sender has counted it."""
    own = (Direction.UP if side == "drone" else Direction.DOWN, Direction.STAY)
    known = 0
    for key, account in found.items():
        topic = topics.find(key)
        whose = key.partition("/")[2]
        if topic is not None and (topic.way in own or whose in services):
            known += account.before + account.sent
    if sent - known <= max(SLACK, SLACK_SHARE * sent):
        return []
    return [
        f"the services of the {side}'s side have sent {sent} messages, and the topics here are of "
        f"{known}: whole topics are missing"
    ]


def account_for(
    numbers: Mapping[str, Numbering], reports: LinkReports, counted: Counter[str], side: str
) -> dict[str, Account]:
    """
    Args:
        numbers: what the sequence numbers say, by key.
        counted: by the recorder.
        side: of the recorder.
    """
    found: dict[str, Account] = {}
    spent = Counter[str]()  # counts that were taken for another key of a family, or another topic
    for key, numbering in sorted(numbers.items()):
        account = found[key] = Account(
            before=numbering.before,
            sent=numbering.sent,
            recorded=numbering.recorded,
            duplicated=numbering.duplicated,
            reordered=numbering.reordered,
        )
        left = numbering.missing
        if left and crosses(key, side):
            left = _on_the_link(account, key, left, numbering, reports, spent)
        refused = {name: counted[name] for name in (reason(key).name for reason in REFUSED)}
        account.refused, left = take(left, refused, spent)
        anything = {event.name: counted[event.name] for event in ANY_TOPIC}
        account.recorder, account.missing = take(left, anything, spent)
    return found


def _on_the_link(
    account: Account,
    key: str,
    left: int,
    numbering: Numbering,
    reports: LinkReports,
    spent: Counter[str],
) -> int:
    """Returns what is left to account for."""
    if not reports.emulated:
        account.link, left = take(left, {events.LOST(key).name: reports.missed(key)}, spent)
        return left
    name = family(key)
    account.link, left = take(left, _counts(reports, name, LOST), spent)
    account.thinned, left = take(left, _counts(reports, name, THINNED), spent)
    account.queue, left = take(left, _counts(reports, name, QUEUES), spent)
    account.unreported = min(left, _unreported(numbering, reports))
    return left - account.unreported


def _counts(reports: LinkReports, name: str, reasons: Iterable[Row]) -> dict[str, int]:
    return {reason(name).name: reports.of(name, [reason]) for reason in reasons}


def _unreported(numbering: Numbering, reports: LinkReports) -> int:
    """Messages that the link may have lost without a report of it in the recording."""
    first, last = reports.first_ns, reports.last_ns
    return sum(
        gap.missing
        for gap in numbering.gaps
        if gap.before_ns > last or (first is not None and gap.after_ns < first)
    )


def _add(reports: LinkReports, recording: Recording, raw: Raw) -> None:
    health = recording.decode(raw)
    if isinstance(health, Health):
        reports.add(health, raw.log_ns)
