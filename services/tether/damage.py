"""What a damaged message looks like."""

NEVER_USED = 0xC1  # the one byte that no msgpack value begins with


def damaged(payload: bytes) -> bytes:
    """Every bit of the last byte flipped, and a first byte that no decoder accepts.

    A real link has a checksum on every frame. The bus has none, so a flipped bit inside a number
    would be taken for another number; no service may act on such a message.
    """
    if not payload:
        return bytes([NEVER_USED])
    turned = bytearray(payload)
    turned[-1] ^= 0xFF
    turned[0] = NEVER_USED
    return bytes(turned)
