"""Foxglove's own WebSocket server (foxglove-sdk). It offers channels and parameters. Publishing by
clients, services, files and playback are not among its capabilities, so it refuses them itself."""

from collections.abc import Mapping

from foxglove import Channel, Context, Schema, start_server
from foxglove.websocket import Capability, Client, Parameter, ServerListener

from services.foxglove.core import Settings, Value
from services.recorder.foxglove.channel import NamedSchema
from services.runtime.config.errors import LindyError
from services.runtime.config.passwords import without_passwords


class FoxgloveServer:
    """Sends to every client what it has subscribed to. Never waits for one: where a client does not
    read, the SDK drops its oldest messages."""

    def __init__(self, settings: Settings, name: str, parameters: Mapping[str, Value]) -> None:
        """Listen.

        Raises:
            LindyError: the address cannot be used.
        """
        self._context = Context()
        self._channels: dict[str, Channel] = {}
        try:
            self._server = start_server(
                name=name,
                host=settings.host,
                port=settings.port,
                capabilities=[Capability.Parameters],
                server_listener=ShownParameters(parameters),
                context=self._context,
            )
        except (OSError, RuntimeError, ValueError) as error:
            raise LindyError(
                f"foxglove cannot listen on {settings.host}:{settings.port}: {error}; another "
                f"port is --set foxglove.port=8766"
            ) from None

    def channel(self, key: str, schema: NamedSchema) -> Channel:
        """The channel of a key, offered from its first message on."""
        channel = self._channels.get(key)
        if channel is None:
            channel = self._channels[key] = Channel(
                key,
                schema=Schema(name=schema.name, encoding="jsonschema", data=schema.data),
                message_encoding="json",
                context=self._context,
            )
        return channel

    def close(self) -> None:
        self._server.stop()


class ShownParameters(ServerListener):
    """Parameters that can be read. The SDK has no way to offer these alone, so whoever sets one is
    answered with its value as it is."""

    def __init__(self, parameters: Mapping[str, Value]) -> None:
        self._parameters = {
            name: without_passwords(value) if isinstance(value, str) else value
            for name, value in parameters.items()
        }

    def on_get_parameters(
        self, client: Client, param_names: list[str], request_id: str | None = None
    ) -> list[Parameter]:
        """All of them where none is named."""
        del client, request_id
        names = param_names or self._parameters
        return [Parameter(n, value=self._parameters[n]) for n in names if n in self._parameters]

    def on_set_parameters(
        self, client: Client, parameters: list[Parameter], request_id: str | None = None
    ) -> list[Parameter]:
        """Nothing is changed."""
        return self.on_get_parameters(client, [p.name for p in parameters], request_id)
