"""Depth alarm: every state is looked at; an alarm is counted and told to people."""

from typing import Annotated

import msgspec
from depth_alarm import DepthAlarm

from lindy.api.messages import VehicleState, events, topics
from lindy.api.service import Node, Stack


class Settings(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """The table of the vehicle file that has this service's name."""

    deepest: Annotated[float, msgspec.Meta(gt=0.0, le=11_000.0)] = 30.0  # [m] positive down


def wire(node: Node, stack: Stack) -> None:
    alarm = DepthAlarm(stack.section(node.name, Settings).deepest)

    def on_state(state: VehicleState, _: int) -> None:
        if (news := alarm.heard(state.depth)) is None:
            return
        if alarm.on:
            node.tell(events.ALARM("depth"))
        node.log("warning" if alarm.on else "info", news)

    node.each(topics.STATE, on_state)
