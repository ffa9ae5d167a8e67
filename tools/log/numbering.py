"""What the sequence numbers of a topic say: which messages were sent and are not there.

Every process numbers the messages of a topic from 0. Several may publish the same one, as two
topsides do, and any may be restarted. So each number belongs to the sender that it follows.
"""

from dataclasses import dataclass, field

FARTHEST = 100_000  # messages between two of one sender: a quarter of an hour without a link


@dataclass(slots=True)
class Gap:
    """Numbers that are missing between two that are there."""

    missing: int
    after_ns: int  # [ns] UTC arrival of the one before …
    before_ns: int  # [ns] … and of the one behind


@dataclass(slots=True)
class Sender:
    """One process that publishes a topic."""

    first: int  # its lowest number here
    last: int  # its highest
    last_ns: int  # [ns] UTC arrival of that
    publish_ns: int  # [ns] UTC newest stamp
    seen: int  # messages, in all


@dataclass
class Numbering:
    """Of one topic, in the order of arrival."""

    recorded: int = 0  # messages, each once
    duplicated: int = 0
    reordered: int = 0
    gaps: list[Gap] = field(default_factory=list[Gap])
    _senders: list[Sender] = field(default_factory=list[Sender])
    _missing: dict[tuple[int, int], int] = field(default_factory=dict[tuple[int, int], int])

    def see(self, number: int, publish_ns: int, log_ns: int) -> None:
        if len(self._senders) == 1 and number == (only := self._senders[0]).last + 1:
            only.last, only.last_ns = number, log_ns  # as nearly all do
            only.publish_ns = max(only.publish_ns, publish_ns)
            only.seen += 1
            self.recorded += 1
            return
        index = self._sender_of(number, publish_ns)
        if index is None:
            self._senders.append(Sender(number, number, log_ns, publish_ns, 1))
            self.recorded += 1
            return
        sender = self._senders[index]
        sender.seen += 1
        if number <= sender.last:
            self._again(index, number)
            return
        if number > sender.last + 1:
            self._open_gap(index, sender, number, log_ns)
        self.recorded += 1
        sender.last, sender.last_ns = number, log_ns
        sender.publish_ns = max(sender.publish_ns, publish_ns)

    @property
    def sent(self) -> int:
        """Messages, from the first one that is here to the last one of each sender."""
        return self.recorded + self.missing

    @property
    def missing(self) -> int:
        return sum(gap.missing for gap in self.gaps)

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

    def _again(self, index: int, number: int) -> None:
        gap = self._missing.pop((index, number), None)
        if gap is None:
            self.duplicated += 1
        else:
            self.gaps[gap].missing -= 1
            self.reordered += 1
            self.recorded += 1

    def _open_gap(self, index: int, sender: Sender, number: int, log_ns: int) -> None:
        for missing in range(sender.last + 1, number):
            self._missing[index, missing] = len(self.gaps)
        self.gaps.append(Gap(number - sender.last - 1, sender.last_ns, log_ns))
