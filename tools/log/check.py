"""`lindy log check`: is everything in a recording that was sent, and if not, who knows why?

Sent = recorded + lost on the link + thinned + dropped in a queue + refused or lost by the recorder
+ not yet reported + missing, for every topic. Sent is known from the sequence numbers, so the parts
are taken from what is missing there, and never add up to more. What was counted beyond that was
lost before the first or after the last message of a topic that is in the recording.

Every process numbers the messages of a topic from 0. Several may publish the same one, as two
topsides do, and any may be restarted. So each number belongs to the sender that it follows.
"""

from collections import Counter
from collections.abc import Collection, Iterable, Mapping
from dataclasses import dataclass, field
from pathlib import Path

import msgspec

from messages import events, topics
from messages.events import Row
from messages.health import Health
from messages.text import harmless
from messages.topic import Direction
from services.runtime.config.errors import LindyError
from tools import exit_status
from tools.analysis.losses import LINK, LOST, QUEUES, THINNED, crosses, family, missed, take
from tools.choices import Json
from tools.health_sums import HealthSums
from tools.recordings.progress import reading
from tools.recordings.recording import Recording, open_recording
from tools.report.report import times
from tools.text_table import aligned

COLUMNS = ("link", "thinned", "queue", "refused", "recorder", "unreported", "missing", "duplicated")
FARTHEST = 100_000  # messages between two of one sender: a quarter of an hour without a link
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

    @property
    def missing(self) -> int:
        return sum(account.missing for account in self.topics.values())


def check(recording: Path, /, *, json: Json = False) -> int:
    """Check that everything that was sent is in it; print what was lost where.

    RECORDING is a dive's folder or its MCAP file. For every topic: sent, recorded, and lost.
    `link`: lost on the link; `thinned`: left out because the link is slow; `queue`: too many waited
    for it; `refused`: the recorder could not read them; `recorder`: it or its disk was too slow or
    full; `unreported`: after the link's last report. Exit status 3: some are missing and nobody
    accounts for them, or the file is damaged, was recovered, or was not finished.

    Example: lindy log check dives/latest
    """
    opened = open_recording(recording)
    if not opened.metadata("dive"):
        opened.require_messages()
        raise LindyError(
            f"{recording} was not recorded by Lindy: what its numbers mean is not known"
        )
    with reading("checking", opened.size) as opened.advance:
        found = accounts(opened)
    if not found.topics:
        raise opened.empty(recording)
    wrong = [*incomplete(opened), *in_words(found)]
    wrong += [] if wrong else found.unrecorded
    if json:
        whole = {"ok": not wrong, "wrong": wrong, **msgspec.to_builtins(found)}
        print(msgspec.json.format(msgspec.json.encode(whole)).decode())
    else:
        print(harmless(as_text(found)))
        print(harmless("\n".join(wrong or ["everything that was sent is accounted for"])))
    return exit_status.LOST if wrong else exit_status.DONE


def incomplete(recording: Recording) -> list[str]:
    """Why a recording that was read may have had more."""
    found = recording.damage
    if recording.metadata("recovered").get("found"):
        found.append(f"it was recovered: {recording.metadata('recovered')['found']}")
    return found


def in_words(found: Accounts) -> list[str]:
    """What is wrong."""
    return [
        f"{key}: {account.missing} of {account.sent} messages are missing, and no service "
        "counted a loss, as when the recorder was down or the file was damaged"
        for key, account in found.topics.items()
        if account.missing
    ]


def as_text(found: Accounts) -> str:
    """A table, with the columns that are not empty."""
    shown = [name for name in COLUMNS if any(getattr(a, name) for a in found.topics.values())]
    heads = ["topic", "sent", "recorded", *shown]
    rows = [
        [
            key,
            str(account.sent),
            str(account.recorded),
            *(str(getattr(account, name) or "") for name in shown),
        ]
        for key, account in found.topics.items()
    ]
    total = [sum(getattr(a, name) for a in found.topics.values()) for name in heads[1:]]
    rows.append(["all", *map(str, total)])
    lines = aligned([heads, *rows])
    if found.backwards:
        lines.append(f"the recorder's clock ran backwards {times(found.backwards)}")
    return "\n".join(lines)


@dataclass(slots=True)
class Sender:
    """One process that publishes a topic."""

    first: int  # its lowest number here
    last: int  # its highest
    last_ns: int  # [ns] UTC arrival of that
    publish_ns: int  # [ns] UTC newest stamp


@dataclass
class Numbering:
    """Of one topic, in the order of arrival."""

    recorded: int = 0  # messages, each once
    duplicated: int = 0
    reordered: int = 0
    # By sender and number: [ns] UTC arrival of the one before the gap, and of the one behind it.
    lost: dict[tuple[int, int], tuple[int, int]] = field(
        default_factory=dict[tuple[int, int], tuple[int, int]]
    )
    _senders: list[Sender] = field(default_factory=list[Sender])

    def see(self, number: int, publish_ns: int, log_ns: int) -> None:
        if len(self._senders) == 1 and number == (only := self._senders[0]).last + 1:
            only.last, only.last_ns = number, log_ns  # as nearly all do
            only.publish_ns = max(only.publish_ns, publish_ns)
            self.recorded += 1
            return
        index = self._sender_of(number, publish_ns)
        if index is None:
            self._senders.append(Sender(number, number, log_ns, publish_ns))
            self.recorded += 1
            return
        sender = self._senders[index]
        if number > sender.last:
            between = sender.last_ns, log_ns
            self.lost |= dict.fromkeys(
                ((index, n) for n in range(sender.last + 1, number)), between
            )
            sender.last, sender.last_ns = number, log_ns
            sender.publish_ns = max(sender.publish_ns, publish_ns)
        elif self.lost.pop((index, number), None) is None:
            self.duplicated += 1
            return
        else:
            self.reordered += 1
        self.recorded += 1

    @property
    def sent(self) -> int:
        """Messages, from the first one that is here to the last one of each sender."""
        return self.recorded + self.missing

    @property
    def missing(self) -> int:
        return len(self.lost)

    @property
    def before(self) -> int:
        """Messages that the first sender had sent before the recording began."""
        return self._senders[0].first if self._senders else 0

    def _sender_of(self, number: int, publish_ns: int) -> int | None:
        """Which sender a number belongs to; None: to a new one."""
        ahead: list[tuple[int, int]] = []
        for index, sender in enumerate(self._senders):
            if sender.first <= number <= sender.last and publish_ns <= sender.publish_ns:
                return index  # late, or a copy
            if sender.last < number <= sender.last + FARTHEST:
                ahead.append((number - sender.last, -index))
        return -min(ahead)[1] if ahead else None


class LinkReports:
    """What the link, or where it is a real one its receivers, counted as lost."""

    def __init__(self) -> None:
        self.first_ns: int | None = None  # [ns] UTC of its first report, if the dive had begun
        self.last_ns = 0  # [ns] UTC of its last report
        self._services: dict[str, HealthSums] = {}

    def add(self, health: Health, log_ns: int) -> None:
        is_link = health.service == LINK
        sums = self._services.setdefault(health.service, HealthSums(joined=is_link))
        if is_link:
            if not sums.said and health.seq > 0:
                self.first_ns = log_ns
            self.last_ns = log_ns
        sums.add(health)

    @property
    def emulated(self) -> bool:
        """Is the link a service that counts what it loses?"""
        return LINK in self._services

    def lost(self, name: str, reasons: Iterable[Row]) -> dict[str, int]:
        """Messages of a topic of the table that the emulated link lost for each of these reasons,
        by the name of the event."""
        counts = self._services[LINK].counts
        return {event: counts[event] for event in (reason(name).name for reason in reasons)}

    def missed(self, key: str) -> int:
        """Messages that a service on this side missed: on a real link nobody else counts them."""
        return max((missed(sums.counts, key) for sums in self._services.values()), default=0)

    def sent_by(self, side: str) -> tuple[set[str], int]:
        """Services of a side, and messages that they have sent, both ways across the link aside."""
        of_side = {n: s for n, s in self._services.items() if s.side == side and n != LINK}
        return {*of_side}, sum(sums.sent for sums in of_side.values())


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
        if raw.key.startswith(HEALTH) and isinstance(health := recording.decode(raw), Health):
            reports.add(health, raw.log_ns)
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
            if reports.emulated:
                name = family(key)
                account.link, left = take(left, reports.lost(name, LOST), spent)
                account.thinned, left = take(left, reports.lost(name, THINNED), spent)
                account.queue, left = take(left, reports.lost(name, QUEUES), spent)
                account.unreported = min(left, _unreported(numbering, reports))
                left -= account.unreported
            else:
                counts = {events.LOST(key).name: reports.missed(key)}
                account.link, left = take(left, counts, spent)
        refused = {name: counted[name] for name in (reason(key).name for reason in REFUSED)}
        account.refused, left = take(left, refused, spent)
        anything = {event.name: counted[event.name] for event in ANY_TOPIC}
        account.recorder, account.missing = take(left, anything, spent)
    return found


def _unreported(numbering: Numbering, reports: LinkReports) -> int:
    """Messages that the link may have lost without a report of it in the recording."""
    first, last = reports.first_ns, reports.last_ns
    return sum(
        behind > last or (first is not None and before < first)
        for before, behind in numbering.lost.values()
    )
