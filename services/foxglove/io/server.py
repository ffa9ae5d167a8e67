"""Foxglove's own WebSocket server (foxglove-sdk). It offers channels, and none of the server's
capabilities: publishing, parameters, services, files and playback it refuses by itself."""

from foxglove import Channel, Context, Schema, start_server

from services.recorder.foxglove.channel import NamedSchema
from services.runtime.config.errors import LindyError


class FoxgloveServer:
    """Sends to every client what it has subscribed to. Never waits for one: where a client does not
    read, the SDK drops its oldest messages."""

    def __init__(self, host: str, port: int, name: str) -> None:
        """Listen.

        Raises:
            LindyError: the address cannot be used.
        """
        self._context = Context()
        self._channels: dict[str, Channel] = {}
        try:
            self._server = start_server(
                name=name, host=host, port=port, capabilities=[], context=self._context
            )
        except (OSError, RuntimeError, ValueError) as error:
            raise LindyError(
                f"foxglove cannot listen on {host}:{port}: {error}; another port is "
                f"--set foxglove.port=8766"
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
