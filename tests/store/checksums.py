"""The checksums of HDF5's metadata: without them put right, hardly a change gets past the first look."""

from __future__ import annotations

from koopcli.store.superblock import SUPERBLOCK, lookup3


def sums(content: bytes) -> list[tuple[int, int]]:
    """Where in a file of format 1.10 a checksum follows: the superblock, object headers, what continues them."""
    found = [(0, SUPERBLOCK)]
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
