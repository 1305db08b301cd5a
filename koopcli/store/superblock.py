"""The block that an HDF5 file of format 1.10 begins with, and its checksum.

While a file is written, a flag there says so, and an image taken meanwhile has it cleared. HDF5 below 2.0 leaves the
checksum of the flagged block in the image, which then no HDF5 opens.
"""

from __future__ import annotations

import re
import struct

from koopcli.store.files import UntrustedFileError

SUPERBLOCK = 44  # bytes of the block before its checksum
ROUND = (4, 6, 8, 16, 19, 4)  # bits to turn by
LAST = ((2, 1, 14), (0, 2, 11), (1, 0, 25), (2, 1, 16), (0, 2, 4), (1, 0, 14), (2, 1, 24))  # word, by which, bits

HEAD = re.compile(rb"\x89HDF\r\n\x1a\n[\x02\x03]\x08\x08")  # places and lengths of 8 bytes


def refuse_other_formats(start: bytes | bytearray) -> None:
    """Raise ``UntrustedFileError`` for a file that does not begin as one of format 1.8 or later does."""
    if not HEAD.match(start):
        raise UntrustedFileError("it is not HDF5 of format 1.8 or later")


def mended(image: bytes) -> bytes:
    """The image with the checksum that its superblock has; itself where that is right."""
    checksum = lookup3(image[:SUPERBLOCK])
    end = SUPERBLOCK + len(checksum)
    return (
        image
        if image[SUPERBLOCK:end] == checksum
        else b"".join((image[:SUPERBLOCK], checksum, memoryview(image)[end:]))
    )


def lookup3(data: bytes) -> bytes:
    """Jenkins' checksum that HDF5 guards its metadata with."""
    padded = -(-len(data) // 12) * 12
    state = [(0xDEADBEEF + len(data)) % 2**32] * 3
    words = struct.unpack(f"<{padded // 4}I", data.ljust(padded, b"\0"))
    for i in range(0, len(words), 3):
        state = [(s + w) % 2**32 for s, w in zip(state, words[i : i + 3], strict=True)]
        if i + 3 < len(words):
            for n, bits in enumerate(ROUND):
                word, last, before = n % 3, (n + 2) % 3, (n + 1) % 3
                state[word] = (state[word] - state[last]) % 2**32 ^ _turned(state[last], bits)
                state[last] = (state[last] + state[before]) % 2**32
        else:
            for word, by, bits in LAST:
                state[word] = ((state[word] ^ state[by]) - _turned(state[by], bits)) % 2**32
    return struct.pack("<I", state[2])


def _turned(word: int, bits: int) -> int:
    return (word << bits | word >> (32 - bits)) % 2**32
