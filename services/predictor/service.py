"""Predictor service: from delayed telemetry it publishes the drone's predicted present state."""

from messages import topics
from services.predictor.core import Predictor
from services.reference.settings import Settings
from services.runtime.config.stack import Stack
from services.runtime.node.node import Node


def wire(node: Node, stack: Stack) -> None:
    predictor = Predictor(stack.section("reference", Settings))
    predictions = node.publisher(topics.PREDICTION)

    def publish(now: int) -> None:
        if (prediction := predictor.predict(now)) is not None:
            predictions.put(prediction)

    node.each(topics.PILOT_COMMAND, predictor.command, onlooker=True)
    node.each(topics.STATE, predictor.state)
    node.each(topics.REFERENCE, predictor.reference)
    node.each(topics.STATUS, predictor.status)
    node.every(topics.PREDICTION.hz, publish)
