"""A service's ports, timers and counters. The same in every host.

A service declares its subscriptions and publishers in its `wire` function; the host then calls
`step` whenever a message arrived or a timer is due. Handlers run one at a time, perhaps on
different threads, with `now` [ns] passed in; they do not block, sleep, read a clock or use unseeded
randomness.
"""

from collections import Counter, deque
from collections.abc import Callable, Mapping
from functools import partial
from threading import Lock
from typing import Any, TypeVar

import msgspec

from messages import events, topics
from messages.events import Event, Level, Outbox
from messages.health import LogLine
from messages.link import Clock
from messages.message import Message
from messages.payload import UNDECODABLE
from messages.topic import AnyTopic, Direction, M, Topic
from services.runtime.bus.envelope import Bus, Envelope
from services.runtime.node.checkpoint import CheckpointStore
from services.runtime.node.clock_offset import ClockOffset
from services.runtime.node.gate import Gate, Gates
from services.runtime.node.loop_stats import CALM_NS, Instance, LoopStats, Usage
from services.runtime.node.ports import Alarm, Inbox, Latest, Now, Publisher, Tick
from services.runtime.node.requests import A, AnswerBook, Overrules, Q, Requester, Requests

# Envelopes kept between two steps of a latest-wins port: 0.16 s at 100 Hz. A service that is
# stepped only at the end of a silence of 0.1 s, as control before its first reference, loses none.
RING = 16
BEHELD = 4096  # envelopes kept for an onlooker of everything: seconds of a dive
FORGETS = "its checkpoint cannot be written to the disk: started again it would use an older one"
EVENTS = 256  # envelopes kept between two steps of an every-message port
S = TypeVar("S", bound=msgspec.Struct)


class Node:
    """One service's end of the system."""

    def __init__(
        self,
        name: str,
        sides: Mapping[str, Bus],
        clock: Now,
        checkpoint: CheckpointStore,
        *,
        gateway: bool = False,
        clock_offset: ClockOffset | None = None,
        replay: bool = False,
        visitor: bool = False,
    ) -> None:
        """
        Args:
            replay: its onlooking ports get what is played again from a recording.
            visitor: a program that asks something and goes; no service, it has no health.
        """
        self.name = name
        self.sides = sides
        self.outbox = Outbox(lock=Lock())  # of its cores too
        self.wake: Callable[[], None] = lambda: None  # the host's; called on the bus's thread
        self.show: Callable[[LogLine], None] = lambda _: None  # the host's; writes to stderr
        self.usage: Callable[[], Usage | None] = lambda: None  # the host's; asks the system
        self.instance = Instance()  # the host's
        self.wall_offset_ns = 0  # the host's: UTC minus the node's clock; 0 on virtual time
        self.loop_stats = LoopStats()
        self._forgot_ns: int | None = None  # [ns] newest report of a checkpoint that failed
        self._clock = clock
        self._checkpoint = checkpoint
        self._home = next(iter(sides))
        self._clock_offset = clock_offset
        self._gateway = gateway
        self._replay = replay
        self._visitor = visitor
        self.published: list[AnyTopic] = []  # topics that it may publish
        self._publishers: list[Publisher[Any]] = []
        self._inboxes: list[Inbox] = []
        self._heard: list[tuple[str, str]] = []
        self._pending: deque[Callable[[], None]] = deque()  # drain inboxes with new messages
        self._collected: list[Callable[[], None]] = []  # drain inboxes at the next step
        self._timers: list[Tick | Alarm] = []
        self._closers: list[Callable[[], None]] = []
        self._log = self.publisher(topics.LOG.of(name))
        self._health = self.publisher(topics.HEALTH.of(name))
        self.every(topics.HEALTH.hz, self._report)
        if clock_offset is not None:
            self.each(topics.CLOCK, clock_offset.learn)

    def now(self) -> int:
        """[ns] For what is set up before the first handler is called."""
        return self._clock()

    # What a service publishes.

    def publisher(self, topic: Topic[M], *, side: str | None = None) -> Publisher[M]:
        """Publish a topic on the home side, or on another side. A gateway publishes topics of
        direction BOTH on each side, because nobody forwards its own messages."""
        everywhere = self._gateway and topic.way is topics.BOTH
        buses = self.sides.values() if everywhere else [self.sides[side or self._home]]
        publisher = Publisher(topic, [bus.say(topic) for bus in buses])
        self._publishers.append(publisher)
        self.published.append(topic)
        return publisher

    @property
    def heard(self) -> list[tuple[str, str]]:
        """What it subscribes to: side and key expression."""
        return self._heard

    def log(self, level: Level, text: str, event: str = "") -> None:
        """A line for people: on the bus, in the recording and on stderr."""
        line = LogLine(
            stamp_ns=self._clock(), service=self.name, level=level, text=text[:2000], event=event
        )
        self._log.put(line)
        self.show(line)

    def tell(self, event: Event | None, times: int = 1) -> None:
        """Count an event in `health/<service>` and, where its row says so, log it."""
        self.outbox.tell(event, times)

    @property
    def counts(self) -> Counter[str]:
        """Events by name, since the start."""
        return self.outbox.counts

    def _say(self) -> None:
        """Log what the cores have said."""
        while self.outbox.said:
            self.log(*self.outbox.said.popleft())

    # What a service receives.

    def latest(self, topic: Topic[M], *, onlooker: bool = False) -> Latest[M]:
        """The newest message, read when wanted; arrivals do not wake the service. An onlooker acts
        on no command, so it also gets expired ones."""
        inbox = self._inbox(topic.key, RING, self._home)
        return Latest(topic, inbox, self.gate(topic, onlooker=onlooker), self.outbox)

    def each(
        self,
        topic: Topic[M],
        handler: Callable[[M, int], None],
        *,
        onlooker: bool = False,
        side: str | None = None,
    ) -> None:
        """Every message on the home side, or on another side, in order of arrival. An onlooker acts
        on no command, so it also gets expired ones."""
        inbox = self._inbox(topic.key, EVENTS, side or self._home)
        gates = self._gates(topic, onlooker=onlooker)

        def drain() -> None:
            for arrival, envelope in inbox.take_all():
                now = self._clock()
                if (message := gates.admit(envelope, now)) is not None:
                    self.loop_stats.handled(now - arrival)
                    handler(message, now)

        self._on_arrival(inbox, drain)

    def trigger(
        self,
        topic: Topic[M],
        handler: Callable[[M | None, int], None],
        silence_s: float,
        *,
        earlier: Callable[[M, int], None] | None = None,
    ) -> None:
        """Call the handler with the newest message. After `silence_s` without one, the handler is
        called with None at the topic's own rate until messages arrive again.

        Older messages that arrived since the last step go to `earlier`, in order; without it they
        are counted as skipped, and a newest one that is stale is counted and does not act: on a
        starved computer it may have waited for a second.
        """
        inbox = self._inbox(topic.key, RING if earlier is None else EVENTS, self._home)
        gate, use = self.gate(topic), earlier or partial(self._skip, topic)
        alarm = self.alarm(lambda now: on_silence(now))

        def on_silence(now: int) -> None:
            if gate.admitted:  # before the first message it is a start, not a silence
                self.tell(events.SILENT(topic.key))
            alarm.set(now + round(1e9 / topic.hz))
            handler(None, now)

        def pass_over(message: M, arrival: int) -> None:
            now = self._clock()
            self.loop_stats.handled(now - arrival)  # also what is skipped has waited so long
            use(message, now)

        def drain() -> None:
            newest, since = None, 0
            for arrival, envelope in inbox.take_all():
                if (message := gate.admit(envelope, self._clock())) is not None:
                    if newest is not None:
                        pass_over(newest, since)
                    newest, since = message, arrival
            if newest is None:
                return
            now = self._clock()
            self.loop_stats.handled(now - since)
            limit = topic.stale_after_ns if earlier is None else None
            if limit is not None and now > newest.stamp_ns + limit:
                self.tell(events.STALE(topic.key))
                return
            alarm.set(now + round(silence_s * 1e9))
            handler(newest, now)

        alarm.set(self._clock() + round(silence_s * 1e9))
        self._on_arrival(inbox, drain)

    def _skip(self, topic: AnyTopic, _message: object, _now: int) -> None:
        self.tell(events.SKIPPED(topic.key))

    def tap(
        self, side: str, key: str, handler: Callable[[Envelope, int], None], depth: int = EVENTS
    ) -> None:
        """Every envelope on a key expression of one side, not decoded, with its arrival time [ns].
        For the tether."""
        inbox = self._inbox(key, depth, side)

        def drain() -> None:
            for arrival, envelope in inbox.take_all():
                self.loop_stats.handled(self._clock() - arrival)
                handler(envelope, arrival)

        self._on_arrival(inbox, drain)

    def collect(
        self, side: str, key: str, handler: Callable[[Envelope, int], None], depth: int
    ) -> None:
        """As `tap`, but arrivals do not wake the service: they are handled at its next step, at the
        latest when its next timer is due. For the recorder."""
        inbox = self._inbox(key, depth, side)

        def drain() -> None:
            late = max(0, self._clock() - self.deadline())  # as late as the timer that wakes us
            for arrival, envelope in inbox.take_all():
                self.loop_stats.handled(late)
                handler(envelope, arrival)

        self._collected.append(drain)

    def watch(
        self, handler: Callable[[AnyTopic, str, Message, int], None], depth: int = BEHELD
    ) -> None:
        """Every message of the home side and, of the drone's side, those that never cross the
        link, for an onlooker: `handler(topic, key, message, arrival)`. Arrivals do not wake the
        service. For the visualizer and Foxglove."""
        gates = {topic.key: self._gates(topic, onlooker=True) for topic in topics.ALL}

        def check(envelope: Envelope, arrival: int) -> None:
            topic = topics.find(envelope.key)
            if topic is None:
                self.tell(events.UNKNOWN_KEY())
            elif (message := gates[topic.key].admit(envelope, arrival)) is not None:
                handler(topic, envelope.key, message, arrival)

        for side in self.sides:
            stay = [topic.key for topic in topics.ALL if topic.way is Direction.STAY]
            for key in ["**"] if side == self._home else stay:
                self.collect(side, key, check, depth)

    def from_outside(self, handler: Callable[[int], None]) -> Callable[[], None]:
        """For a thread of a service's own that waits for a socket: what it calls when something
        is there. `handler(now)` is then called like any other, once for however many calls."""
        notified = False

        def handle() -> None:
            nonlocal notified
            notified = False  # before the handler looks: what comes from now on notifies again
            handler(self._clock())

        def notify() -> None:
            nonlocal notified
            if not notified:
                notified = True
                self._pending.append(handle)
                self.wake()

        return notify

    def gate(self, topic: Topic[M], *, onlooker: bool = False) -> Gate[M]:
        offset, replay = self._clock_offset, self._replay
        return Gate(topic, self.outbox, offset, onlooker=onlooker, replay=replay)

    def _gates(self, topic: Topic[M], *, onlooker: bool) -> Gate[M] | Gates[M]:
        kind = Gates[M] if topic.is_family else Gate[M]
        offset, replay = self._clock_offset, self._replay
        return kind(topic, self.outbox, offset, onlooker=onlooker, replay=replay)

    def local_ns(self, topic: AnyTopic, stamp_ns: int) -> int | None:
        """[ns] A stamp of an envelope by this node's clock; None where not known."""
        return (
            stamp_ns if self._clock_offset is None else self._clock_offset.local_ns(topic, stamp_ns)
        )

    def learn_clock(self, clock: Clock) -> None:
        """For the link monitor, which does not receive its own messages."""
        if self._clock_offset is not None:
            self._clock_offset.learn(clock, clock.stamp_ns)

    # Requests and answers.

    def request(
        self,
        asks: Topic[Q],
        answers: Topic[A],
        *,
        on_answer: Callable[[Q, A, int], None],
        on_given_up: Callable[[Q, int], None] = lambda _request, _now: None,
        overrules: Overrules[Q] = lambda _newer, _older: False,
        who: str | None = None,
    ) -> Requester[Q, A]:
        """Send requests. Each is repeated until it is answered or, after five seconds, given up.

        Args:
            on_answer: called with (request, answer, now), once per request.
            overrules: (newer, older): does the newer request withdraw the older one?
            who: prefix of the ids; default: the node's name.
        """
        requests = Requests(who or self.name, overrules)
        asking = Requester(requests, self.publisher(asks), self.alarm, on_answer, on_given_up)
        self.each(answers, asking.hear)
        return asking

    def answers(
        self,
        asks: Topic[Q],
        answers: Topic[A],
        decide: Callable[[Q, int], A],
        then: Callable[[Q, A, int], None] = lambda _request, _answer, _now: None,
    ) -> None:
        """Answer requests: each is carried out once, and every repetition gets the same answer.

        Args:
            decide: called with (request, now), once per id.
            then: called with (request, answer, now), once per id, after the answer was published.
        """
        publisher, book = self.publisher(answers), AnswerBook(decide)

        def hear(request: Q, now: int) -> None:
            answer, is_new = book.answer(request, now)
            publisher.put(answer)
            if is_new:
                then(request, answer, now)

        self.each(asks, hear)

    # Timers.

    def every(self, hz: float, handler: Callable[[int], None]) -> Tick:
        """Call `handler(now)` at a fixed rate, without drift."""
        tick = Tick(hz, self._clock(), handler)
        self._timers.append(tick)
        return tick

    def alarm(self, handler: Callable[[int], None]) -> Alarm:
        """A timer that rings once each time it is set."""
        alarm = Alarm(handler)
        self._timers.append(alarm)
        return alarm

    # Checkpoints, and the end of the service.

    def restore_checkpoint(self, kind: type[S]) -> S | None:
        """The checkpoint this service saved before a crash in the same dive, or None."""
        try:
            data = self._checkpoint.restore_checkpoint()
            return None if data is None else msgspec.json.decode(data, type=kind)
        except (OSError, *UNDECODABLE):
            self.tell(events.MALFORMED_CHECKPOINT())
            return None

    def save_checkpoint(self, what: msgspec.Struct) -> None:
        """Replace the checkpoint. Does not wait for the disk; a failed write is counted with the
        next health report."""
        self._checkpoint.save_checkpoint(msgspec.json.encode(what))

    def on_close(self, closer: Callable[[], None]) -> None:
        self._closers.append(closer)

    # What the host calls.

    def start(self) -> None:
        """Everything is wired: fixed rates count from now, so that a slow start is no delay."""
        now = self._clock()
        for timer in self._timers:
            if isinstance(timer, Tick):
                timer.start(now)

    def step(self) -> None:
        """Handle the messages that arrived and the timers that are due.

        Bounded, so that a flood of messages starves neither the timers nor the other nodes of a
        process; `wake` is called for the rest.
        """
        for drain in self._collected:
            drain()
        self.handle_arrivals()
        now = self._clock()
        for timer in self._timers:
            if timer.due is not None and timer.due <= now:
                self.loop_stats.handled(now - timer.due)
                if missed := timer.ring(now):
                    self.tell(events.MISSED_DEADLINE(), missed)
        self._say()
        if self._pending:
            self.wake()

    def handle_arrivals(self) -> bool:
        """Handle messages that arrived, but no timers. Bounded, so that a flood of messages cannot
        starve the timers: is anything left?"""
        for _ in range(min(len(self._pending), EVENTS)):
            self._pending.popleft()()
        if self.outbox.said:
            self._say()
        return bool(self._pending)

    @property
    def collects(self) -> bool:
        """Does the service collect envelopes between its timers?"""
        return bool(self._collected)

    def deadline(self) -> int:
        """[ns] When the next timer falls due. There always is one: the health report."""
        next_due: int | None = None
        for timer in self._timers:
            if timer.due is not None and (next_due is None or timer.due < next_due):
                next_due = timer.due
        assert next_due is not None
        return next_due

    def close(self) -> None:
        for drain in self._collected:
            drain()
        for closer in self._closers:
            closer()
        self._say()

    def _inbox(self, key: str, depth: int, side: str) -> Inbox:
        inbox = Inbox(key, depth, self._clock, self.outbox)
        self.sides[side].hear(key, inbox.store)
        self._inboxes.append(inbox)
        self._heard.append((side, key))
        return inbox

    def _on_arrival(self, inbox: Inbox, drain: Callable[[], None]) -> None:
        """Have `drain` called on the service's thread whenever something arrived."""

        def arrived() -> None:
            self._pending.append(drain)
            self.wake()

        inbox.arrived = arrived

    def _say_if_behind(self, now: int) -> None:
        """Who collects, such as the recorder, may wait for a disk; nobody waits for it."""
        if self.collects:
            return
        stalled, words = self.loop_stats.behind(now)
        if stalled:
            self.tell(events.STALLED())
        if words:
            self.log("warning", words)

    def _say_if_forgotten(self, now: int) -> None:
        """A disk that takes no checkpoint: counted, and said once for as long as that lasts."""
        if not (failures := self._checkpoint.failures()):
            return
        self.tell(events.NOT_REMEMBERED(), failures)
        before, self._forgot_ns = self._forgot_ns, now
        if before is None or now - before > CALM_NS:
            self.log("warning", FORGETS)

    def _report(self, now: int) -> None:
        if self._visitor:
            return
        self._say_if_forgotten(now)
        self._say_if_behind(now)
        sent = sum(publisher.sent for publisher in self._publishers)
        received = sum(inbox.stored for inbox in self._inboxes)
        self._health.put(
            self.loop_stats.report(
                self.name,
                now,
                sent,
                received,
                self.outbox.counts,
                self.usage(),
                self._home,
                self.instance,
            )
        )
