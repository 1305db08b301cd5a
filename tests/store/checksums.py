"""The checksums of HDF5's metadata: without them put right, hardly a change gets past the first look."""

from __future__ import annotations

import struct


def sums(content: bytes) -> list[tuple[int, int]]:
    """Where in a file of format 1.10 a checksum follows: the superblock, object headers, what continues them."""
    found = [(0, 44)]
    at = -1
    while (at := content.find(b"OHDR\2", at + 1)) >= 0:
        flags = content[at + 5]
        start = at + 6 + 16 * bool(flags & 0x20) + 4 * bool(flags & 0x10)
        width = 1 << (flags & 3)
        found.append((at, start + width + int.from_bytes(content[start : start + width], "little")))
    while (at := content.find(b"OCHK", at + 1)) >= 0:
        ends = range(at + 8, min(at + 1000, len(content) - 4))
        found += [(at, end) for end in ends if lookup3(content[at:end]) == content[end : end + 4]][:1]
    return found


def with_sums(content: bytearray, places: list[tuple[int, int]]) -> bytes:
    for start, end in places:
        content[end : end + 4] = lookup3(bytes(content[start:end]))
    return bytes(content)


def lookup3(data: bytes) -> bytes:
    """Jenkins' checksum that HDF5 guards its metadata with."""
    state = [(0xDEADBEEF + len(data)) % 2**32] * 3
    words = struct.unpack(f"<{-(-len(data) // 12) * 3}I", data.ljust(-(-len(data) // 12) * 12, b"\0"))
    for i in range(0, len(words), 3):
        state = [(s + w) % 2**32 for s, w in zip(state, words[i : i + 3], strict=True)]
        if i + 3 < len(words):
            for n, bits in enumerate((4, 6, 8, 16, 19, 4)):
                one, last, other = n % 3, (n + 2) % 3, (n + 1) % 3
                state[one] = (state[one] - state[last]) % 2**32 ^ _turned(state[last], bits)
                state[last] = (state[last] + state[other]) % 2**32
        else:
            for one, last, bits in ((2, 1, 14), (0, 2, 11), (1, 0, 25), (2, 1, 16), (0, 2, 4), (1, 0, 14), (2, 1, 24)):
                state[one] = ((state[one] ^ state[last]) - _turned(state[last], bits)) % 2**32
    return struct.pack("<I", state[2])


def _turned(word: int, bits: int) -> int:
    return (word << bits | word >> (32 - bits)) % 2**32
