"""PARAM_REQUEST_LIST, PARAM_REQUEST_READ and PARAM_SET."""

from dataclasses import dataclass, field

from messages import events
from messages.events import Outbox
from services.mavlink.packets import Addressed, ReceivedPacket
from services.mavlink.parameters import NAMES, NO_INDEX, Parameters
from services.mavlink.reaction import Reaction
from services.mavlink_io.numbers import MavSeverity

AT_ONCE = 10  # of a list, in one tick


@dataclass(slots=True)
class ParameterProtocol:
    parameters: Parameters
    outbox: Outbox
    _next: dict[str, int] = field(default_factory=dict[str, int])  # link → next of its list

    def begin_list(self, packet: ReceivedPacket) -> None:
        """Begin the list on this link, or begin it again."""
        self._next[packet.sender.link] = 0

    def forget(self, link: str) -> None:
        self._next.pop(link, None)

    def read(self, packet: ReceivedPacket, out: Reaction) -> None:
        fields = packet.fields
        index = self.parameters.index(fields["param_id"], fields["param_index"])
        if index is None:
            self.outbox.tell(events.UNKNOWN_PARAMETER("mavlink"))
        else:
            out.packets.append(Addressed(packet.sender.link, self.parameters.packet(index)))

    def set(self, packet: ReceivedPacket, out: Reaction, *, is_holder: bool) -> None:
        """The answer is the value in force, on all links."""
        name: str = packet.fields["param_id"]
        index = self.parameters.index(name, NO_INDEX)
        if index is None:
            self.outbox.tell(events.UNKNOWN_PARAMETER("mavlink"))
            return
        if not is_holder:
            self.outbox.tell(events.NOT_THE_HOLDER("parameter"))
            refusal = f"{events.NOT_THE_HOLDER.sentence}: {name} is not changed"
            out.say(packet.sender.link, MavSeverity.WARNING, refusal)
        elif refusal := self.parameters.change(name, packet.fields["param_value"]):
            self.outbox.tell(events.REFUSED_PARAMETER())
            out.say(packet.sender.link, MavSeverity.WARNING, refusal)
        out.packets.append(Addressed(None, self.parameters.packet(index)))

    def tick(self, out: Reaction) -> None:
        """The next of each list."""
        for link, begin in list(self._next.items()):
            end = min(begin + AT_ONCE, len(NAMES))
            out.packets += [
                Addressed(link, self.parameters.packet(index)) for index in range(begin, end)
            ]
            if end == len(NAMES):
                del self._next[link]
            else:
                self._next[link] = end
