"""The texts beside arrays, read from the bytes of an HDF5 file without asking HDF5.

HDF5 keeps them in heaps that no checksum guards: one wrong byte there, and it never returns, or clears gigabytes for a
text of one letter. Here every step is bounded. Only what h5py writes since format 1.8 is known: object headers of
version 2 ("OHDR", continued in "OCHK"), texts of variable length in attributes of version 3, heaps ("GCOL").
"""

from __future__ import annotations

import mmap
import re
import struct
from collections.abc import Iterator

from koopcli.store.files import UntrustedFileError

FACTS = 16 << 20  # bytes of all texts
STEPS = 200_000  # messages and texts passed on the way
HEAD = re.compile(rb"\x89HDF\r\n\x1a\n[\x02\x03]\x08\x08")  # places and lengths of 8 bytes
ATTRIBUTE, CONTINUATION = 0x0C, 0x10
SHARED = 0x02  # flag of a message that is kept elsewhere

Content = bytes | mmap.mmap


class Texts:
    """The texts of a file with the bytes ``content``. Raises ``UntrustedFileError`` or ``struct.error``."""

    def __init__(self, content: Content) -> None:
        if not HEAD.match(content):
            raise UntrustedFileError("it is not HDF5 of format 1.8 or later")
        self._content = content
        self._steps = self._length = 0
        self._heaps: dict[int, dict[int, tuple[int, int]]] = {}

    def of(self, address: int) -> dict[str, str]:
        """The texts of the object whose header is at ``address``, by name."""
        texts = {}
        for message in self._attributes(address):
            version, flags, name, kind, space = struct.unpack_from("<BBHHH", message)
            start = 9 + name + kind + space  # of the value: length, heap, number in the heap
            text = message[9 + name : 11 + name]
            if version == 3 and not flags and len(message) == start + 16 and (text[0] & 15, text[1] & 15) == (9, 1):
                texts[message[9 : 8 + name].decode()] = self._text(*struct.unpack_from("<IQI", message, start))
        return texts

    def _attributes(self, address: int) -> Iterator[bytes]:
        """The attribute messages of an object header and of all that continues it."""
        signature, version, flags = struct.unpack_from("<4sBB", self._content, address)
        if (signature, version) != (b"OHDR", 2):
            raise UntrustedFileError("an object of it is not of format 1.8 or later")
        start = address + 6 + (16 if flags & 0x20 else 0) + (4 if flags & 0x10 else 0)
        width = 1 << (flags & 3)
        size = int.from_bytes(self._content[start : start + width], "little")
        waiting = [(start + width, start + width + size)]
        head = 6 if flags & 4 else 4
        while waiting:
            place, end = waiting.pop()
            while place + head <= end:
                self._step()
                kind, length, marks = struct.unpack_from("<BHB", self._content, place)
                message = self._content[place + head : place + head + length]
                place += head + length
                if kind == ATTRIBUTE and not marks & SHARED:
                    yield message
                elif kind == CONTINUATION:
                    offset, length = struct.unpack("<QQ", message)
                    waiting.append((offset + 4, offset + length - 4))

    def _text(self, length: int, heap: int, number: int) -> str:
        if not length:
            return ""
        if heap not in self._heaps:
            self._heaps[heap] = dict(self._heap(heap))
        place, stored = self._heaps[heap].get(number, (0, 0))
        self._length += length
        if stored != length or self._length > FACTS:
            raise UntrustedFileError("a text of it is not where it should be")
        return self._content[place : place + length].decode()

    def _heap(self, address: int) -> Iterator[tuple[int, tuple[int, int]]]:
        """(number, (place, length)) of every text in the heap at ``address``."""
        signature, size = struct.unpack_from("<4s4xQ", self._content, address)
        place, end = address + 16, min(address + size, len(self._content))
        while signature == b"GCOL" and place + 16 <= end:
            self._step()
            number, length = struct.unpack_from("<H6xQ", self._content, place)
            if not number:  # the rest is free
                return
            yield number, (place + 16, length)
            place += 16 + -(-length // 8) * 8

    def _step(self) -> None:
        self._steps += 1
        if self._steps > STEPS:
            raise UntrustedFileError("its texts have no end")
