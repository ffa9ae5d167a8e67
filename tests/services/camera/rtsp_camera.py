"""A camera of GStreamer's RTSP server, for Debian's own Python, which has its bindings.

Usage: /usr/bin/python3 rtsp_camera.py PORT; 0 is any free one. It prints the port. Each picture has
the time at which it was made in its stripe, as `services.marine.time_stripe` reads it.
"""

import binascii
import sys
import time
from importlib import import_module
from typing import Any

WIDTH, HEIGHT, HZ = 640, 360, 25
ROW_BLOCKS, BLOCK_WIDTH, BLOCK_HEIGHT = 32, 16, 8  # [px]
LEVELS = b"\x10", b"\xeb"
# As pilots' companion computers encode: several slices in each picture.
ENCODER = "x264enc tune=zerolatency speed-preset=ultrafast key-int-max=25"
PAYLOADER = "rtph264pay name=pay0 pt=96 config-interval=-1"


def picture(now_ns: int) -> bytes:
    """A picture in yuv420p: the time, and below it a grey that changes."""
    time_us = (now_ns // 1000 % (1 << 48)).to_bytes(6, "big")
    said = int.from_bytes(time_us + binascii.crc_hqx(time_us, 0xFFFF).to_bytes(2, "big"), "big")
    blocks = [LEVELS[said >> bit & 1] * BLOCK_WIDTH for bit in reversed(range(64))]
    margin = b"\x80" * (WIDTH - ROW_BLOCKS * BLOCK_WIDTH)
    upper, lower = (
        (b"".join(blocks[first : first + ROW_BLOCKS]) + margin) * BLOCK_HEIGHT for first in (0, 32)
    )
    grey = bytes([30 + now_ns // 10_000_000 % 200])
    below = grey * (WIDTH * (HEIGHT - 2 * BLOCK_HEIGHT))
    return upper + lower + below + b"\x80" * (WIDTH * HEIGHT // 2)


def serve(port: int) -> None:
    gi: Any = import_module("gi")
    gi.require_version("Gst", "1.0")
    gi.require_version("GstRtspServer", "1.0")
    GLib, Gst, Rtsp = (
        import_module(f"gi.repository.{name}") for name in ("GLib", "Gst", "GstRtspServer")
    )
    Gst.init(None)
    factory = Rtsp.RTSPMediaFactory()
    factory.set_shared(True)
    caps = f"video/x-raw,format=I420,width={WIDTH},height={HEIGHT},framerate={HZ}/1"
    factory.set_launch(
        f"( appsrc name=src is-live=true format=time do-timestamp=true caps={caps}"
        f" ! {ENCODER} ! {PAYLOADER} )"
    )

    def film(_: Any, media: Any) -> None:
        source = media.get_element().get_child_by_name("src")

        def push() -> bool:
            buffer = Gst.Buffer.new_wrapped(picture(time.monotonic_ns()))
            return source.emit("push-buffer", buffer) == Gst.FlowReturn.OK

        GLib.timeout_add(1000 // HZ, push)

    factory.connect("media-configure", film)
    server = Rtsp.RTSPServer()
    server.set_address("127.0.0.1")
    server.set_service(str(port))
    server.get_mount_points().add_factory("/stream", factory)
    server.attach(None)
    print(server.get_bound_port(), flush=True)
    GLib.MainLoop().run()


if __name__ == "__main__":
    serve(int(sys.argv[1]))
