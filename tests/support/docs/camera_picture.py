"""docs/camera.png: the simulated camera's picture as it is decoded topside, in four waters."""

from math import radians
from pathlib import Path

import av
import numpy as np
from matplotlib import image

from services.camera.core import Order
from services.camera.io.encoder import VideoEncoder
from services.camera.sea import CameraView, SimulatedSea, WaterLight
from services.marine import time_stripe
from services.marine.attitude import from_euler

OUT = Path(__file__).parents[3] / "docs" / "camera.png"
WIDTH, HEIGHT, HZ = 640, 360, 25.0
S = 1_000_000_000  # [ns]
FLOOR = 8.0  # [m]
# Water, lamp [-], bitrate [kbit/s], pictures a second.
WATERS = (
    (WaterLight(turbidity=0.2), 0.0, 1500.0, HZ),
    (WaterLight(turbidity=0.5), 0.0, 1500.0, HZ),
    (WaterLight(turbidity=0.3, daylight=0.0), 1.0, 1500.0, HZ),
    (WaterLight(turbidity=0.2), 0.0, 50.0, 8.0),
)


def main() -> None:
    pictures = [_decoded(*water) for water in WATERS]
    image.imsave(OUT, np.vstack([np.hstack(pictures[:2]), np.hstack(pictures[2:])]))


def _decoded(water: WaterLight, lamp: float, kbit: float, hz: float) -> np.ndarray:
    """The picture after three seconds of a slow way past the pilings, as RGB."""
    sea = SimulatedSea(WIDTH, HEIGHT, radians(80.0), water, FLOOR)
    encoder, decoder = VideoEncoder(WIDTH, HEIGHT), av.CodecContext.create("h264", "r")
    frames: list[av.VideoFrame] = []
    for number in range(round(3.0 * hz)):
        at = number / hz  # [s]
        attitude = from_euler(0.03, -0.05, 0.4 + 0.05 * at)
        picture = sea.draw(CameraView((0.1 * at, 0.3, 6.4), attitude, -0.15, lamp))
        stamp = round((100.0 + at) * S)
        time_stripe.write(picture.y, stamp)
        data = encoder.encode(picture, stamp, Order(kbit, hz, number == 0))
        frames += decoder.decode(av.Packet(data))  # type: ignore[attr-defined]
    return frames[-1].to_ndarray(format="rgb24")


if __name__ == "__main__":
    main()
