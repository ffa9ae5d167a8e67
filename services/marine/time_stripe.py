"""A time stamp in a picture that a machine can read: 64 black or white blocks along its top.

Two rows of 32 blocks. The first 48 are the time in microseconds, modulo 2⁴⁸, the others its
CRC-16-CCITT; the most significant bit is first. Blocks are 16 px wide, the width of a macroblock of
H.264, so that each of them costs a few bits and survives any quantiser.
"""

import binascii

import numpy as np
from numpy.typing import NDArray

Luma = NDArray[np.uint8]  # [-] 16 black to 235 white, shape (height, width)
ROWS, COLUMNS = 2, 32
BLOCK_WIDTH, BLOCK_HEIGHT = 16, 8  # [px]
WIDTH, HEIGHT = COLUMNS * BLOCK_WIDTH, ROWS * BLOCK_HEIGHT  # [px] of the whole stripe
BELOW = HEIGHT + 2  # [px] the first row that is none of it: the codec blurs its edge
BLACK, WHITE = 16, 235
MIDDLE = (BLACK + WHITE) / 2
TIME_BYTES, SUM_BYTES = 6, 2
WRAP_US = 1 << (8 * TIME_BYTES)  # [µs] nine years


def fits(width: int, height: int) -> bool:
    """Is a picture of this size [px] large enough for a stripe?"""
    return width >= WIDTH and height >= 4 * HEIGHT


def write(luma: Luma, stamp_ns: int) -> None:
    """Draw the time [ns] into a picture that is large enough."""
    time = (stamp_ns // 1000 % WRAP_US).to_bytes(TIME_BYTES, "big")
    bits = np.unpackbits(np.frombuffer(time + _sum(time), np.uint8)).reshape(ROWS, COLUMNS)
    levels = np.where(bits, WHITE, BLACK).astype(np.uint8)
    luma[:HEIGHT, :WIDTH] = levels.repeat(BLOCK_HEIGHT, 0).repeat(BLOCK_WIDTH, 1)


def read(luma: Luma, near_ns: int) -> int | None:
    """[ns] The time in a picture, of all that it may stand for the one nearest to `near_ns`; None:
    there is no stripe, or it cannot be read."""
    height, width = luma.shape
    if not fits(width, height):
        return None
    blocks = luma[:HEIGHT, :WIDTH].reshape(ROWS, BLOCK_HEIGHT, COLUMNS, BLOCK_WIDTH)
    # The inner part of each block: its edges are blurred by the codec.
    inner = blocks[:, 2:-2, :, 4:-4].mean(axis=(1, 3))
    found = np.packbits(inner > MIDDLE).tobytes()
    time, check = found[:TIME_BYTES], found[TIME_BYTES:]
    if _sum(time) != check:
        return None
    away = (int.from_bytes(time, "big") - near_ns // 1000 + WRAP_US // 2) % WRAP_US - WRAP_US // 2
    return (near_ns // 1000 + away) * 1000


def paint_over(rgb: NDArray[np.uint8]) -> None:
    """Put what is below a stripe in its place, mirrored: it is for machines. A picture of shape
    (height, width, 3) is changed in place; one that has no stripe is not."""
    if read(rgb[..., 1], 0) is not None:
        rgb[:BELOW] = rgb[BELOW : 2 * BELOW][::-1]


def _sum(time: bytes) -> bytes:
    # Begun with ones, so that a black picture is not a time.
    return binascii.crc_hqx(time, 0xFFFF).to_bytes(SUM_BYTES, "big")
