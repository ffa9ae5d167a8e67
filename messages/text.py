"""Text of others, on its way to a person."""


def harmless(text: str) -> str:
    """Without control characters, which a terminal would obey: whoever sent a message, made a
    recording or named a file may have put them into it."""
    return "".join(sign if sign.isprintable() or sign == "\n" else "�" for sign in text)
