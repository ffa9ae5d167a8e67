"""What is in a file of a recording, as one checksum: whoever alters, removes or adds a message and
keeps the checksum is found out. Whoever computes it anew is not: it is no signature."""

import hashlib

HASH = "hash"  # metadata with that of a whole dive, by the recorder
CONTENTS = "contents"  # metadata with the checksum, in each file that was finished
OF_THE_WHOLE = (HASH, CONTENTS)  # not true of a copy of a part


class Contents:
    """SHA-256 over all messages and views of a file, in their order."""

    def __init__(self) -> None:
        self._hash = hashlib.sha256()

    def add(self, key: str, data: bytes, log_ns: int, publish_ns: int, sequence: int) -> None:
        # Lengths first, so that different fields never give the same bytes.
        head = f"{len(key)} {len(data)} {log_ns} {publish_ns} {sequence} {key}"
        self._hash.update(head.encode(errors="surrogatepass"))
        self._hash.update(data)

    @property
    def sha256(self) -> str:
        return self._hash.hexdigest()
