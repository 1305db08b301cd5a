"""What a disk may hold after a power cut.

A file has content, a folder has entries, and each operation changes one of the two. fsync of a file makes its content
last, fsync of a folder its entries; nothing else does. Whatever was not made to last may be there or not, each
operation by itself. A journal allows fewer states: entries last in the order of their operations, and every fsync takes
all entries before it along, as ext4, xfs and btrfs do by default.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from tests.powercut.recorder import Event

RECENT = 20  # operations before the cut of which each is left out, and kept, by itself
TOP = 0  # the number of the folder that is recorded


@dataclass(frozen=True)
class Named:
    """A new file or folder gets its name."""

    folder: int
    name: str
    node: int
    is_folder: bool


@dataclass(frozen=True)
class Moved:
    """A file gets another name, perhaps in another folder; what had that name is gone."""

    source: int
    old: str
    folder: int
    name: str
    node: int


@dataclass(frozen=True)
class Removed:
    """A name is gone."""

    folder: int
    name: str
    node: int


@dataclass(frozen=True)
class Written:
    """A file has ``content`` at ``place``; ``content`` None: it only has room up to ``place``."""

    node: int
    place: int
    content: bytes | None


@dataclass(frozen=True)
class Synced:
    """What a file or a folder holds lasts."""

    node: int


@dataclass(frozen=True)
class Said:
    """A text was printed."""

    text: str


Content = Callable[[bytes], bytes]
CONTENTS: dict[str, Content] = {
    "zeros": lambda written: bytes(len(written)),
    "cut in half": lambda written: written[: len(written) // 2],
    "half zeros": lambda written: written[: len(written) // 2].ljust(len(written), b"\0"),
}
"""What may be left of bytes that were written and not synced."""

Entry = Named | Moved | Removed
Operation = Entry | Written | Synced | Said


@dataclass
class Disk:
    """Folders and files by number."""

    folders: dict[int, dict[str, int]] = field(default_factory=lambda: {TOP: {}})
    files: dict[int, bytes] = field(default_factory=dict)

    def copy(self) -> Disk:
        return Disk({node: dict(entries) for node, entries in self.folders.items()}, dict(self.files))

    def apply(self, operation: Operation, kept: Content = bytes, keep_source: bool = False) -> None:
        """Let an operation be on the disk, whatever of those before it is; of what it writes, what is ``kept``."""
        match operation:
            case Named(folder, name, node, is_folder):
                self.folders.setdefault(folder, {})[name] = node
                if is_folder:
                    self.folders.setdefault(node, {})
            case Moved(source, old, folder, name, node):
                if not keep_source:
                    self._forget(source, old, node)
                self.folders.setdefault(folder, {})[name] = node
            case Removed(folder, name, node):
                self._forget(folder, name, node)
            case Written(node, place, None):
                self.files[node] = self.files.get(node, b"").ljust(place, b"\0")
            case Written(node, place, bytes(written)):
                written = kept(written)
                before = self.files.get(node, b"").ljust(place, b"\0")
                self.files[node] = before[:place] + written + before[place + len(written) :]

    def _forget(self, folder: int, name: str, node: int) -> None:
        entries = self.folders.setdefault(folder, {})
        if entries.get(name) == node:
            del entries[name]

    def tree(self, folder: int = TOP, above: str = "") -> dict[str, bytes | None]:
        """path -> content of every file, None for a folder; folders come before what is in them."""
        tree: dict[str, bytes | None] = {}
        for name, node in sorted(self.folders.get(folder, {}).items()):
            if node in self.folders:
                tree[above + name] = None
                tree |= self.tree(node, f"{above}{name}/")
            else:
                tree[above + name] = self.files.get(node, b"")
        return tree


def disk_of(top: Path) -> Disk:
    """What lies in a folder, all of it lasting."""
    disk, numbers = Disk(), {top: TOP}
    for number, path in enumerate(sorted(top.rglob("*")), 1):
        numbers[path] = number
        disk.folders[numbers[path.parent]][path.name] = number
        if path.is_dir():
            disk.folders[number] = {}
        else:
            disk.files[number] = path.read_bytes()
    return disk


def lay_out(tree: dict[str, bytes | None], top: Path) -> None:
    """Write what :meth:`Disk.tree` gives into the folder ``top``."""
    top.mkdir(parents=True)
    for path, content in tree.items():
        if content is None:
            (top / path).mkdir()
        else:
            (top / path).write_bytes(content)


def operations(start: Disk, events: Sequence[Event], top: Path) -> list[Operation]:
    """What recorded ``events`` under ``top`` did to a disk, by numbers that names lead to at the time."""
    live, done = start.copy(), list[Operation]()
    fresh = 1 + max([*live.folders, *live.files])

    def place(path: str) -> tuple[int, str]:
        *above, name = Path(path).relative_to(top).parts or ("",)
        folder = TOP
        for part in above:
            folder = live.folders[folder][part]
        return folder, name

    def node(path: str) -> int:
        folder, name = place(path)
        return live.folders[folder][name] if name else TOP

    def add(operation: Operation) -> None:
        live.apply(operation)
        done.append(operation)

    for kind, *what in events:
        match kind, what:
            case "say", [text]:
                add(Said(text))
            case "sync", [path]:
                add(Synced(node(path)))
            case "mkdir" | "create", [path]:
                add(Named(*place(path), fresh, kind == "mkdir"))
                fresh += 1
            case "move", [source, target]:
                add(Moved(*place(source), *place(target), node(source)))
            case "remove", [path]:
                add(Removed(*place(path), node(path)))
            case "write", [path, start_of, content]:
                add(Written(node(path), start_of, content))
            case "extend", [path, size]:
                add(Written(node(path), size, None))
            case "holds", [path, content]:
                folder, name = place(path)
                if name not in live.folders[folder]:
                    add(Named(folder, name, fresh, False))
                    fresh += 1
                if live.files.get(node(path), b"") != content:
                    add(Written(node(path), 0, content))
    return done


@dataclass(frozen=True)
class State:
    """One state of a disk: what it is, and whether a journal ``allows`` it too."""

    what: str
    tree: dict[str, bytes | None]
    allowed: bool


def states(start: Disk, done: Sequence[Operation]) -> Iterator[State]:
    """The states in which a power cut after ``done`` may leave a disk."""
    strict, journal = _lasting(done)
    entries = [i for i, operation in enumerate(done) if isinstance(operation, Entry)]
    contents = [i for i, operation in enumerate(done) if isinstance(operation, Written)]
    every = sorted(entries + contents)
    loose = [i for i in every if i not in strict]

    def state(what: str, chosen: Sequence[int], content: Content = bytes, keep_source: bool = False) -> State:
        disk, kept = start.copy(), strict.union(chosen)
        for i in every:
            if i in kept:
                disk.apply(done[i], bytes if i in strict else content, keep_source and i not in strict)
        in_order = [i in kept for i in entries]
        ordered = journal <= kept and in_order == sorted(in_order, reverse=True) and not keep_source
        return State(what, disk.tree(), ordered)

    yield state("nothing that was not synced", [])
    yield state("everything", every)
    for i in loose:
        # Litter of long ago is there as a whole or not at all.
        if i >= len(done) - RECENT or (isinstance(made := done[i], Named) and made.is_folder):
            yield state(f"all but {done[i]!s:.99}", [j for j in every if j != i])
            yield state(f"only {done[i]!s:.99}", [i])
    for name, content in CONTENTS.items():
        yield state(f"everything, its contents {name}", every, content)
    yield state("entries without contents", entries)
    yield state("contents without entries", contents)
    yield state("moves of which both names are there", every, keep_source=True)
    last = [i for i in entries if i in loose]
    for n in range(max(1, len(last) - RECENT // 2), len(last)):
        yield state(f"the first {n} entries", last[:n])
        yield state(f"the first {n} entries, all contents", [*last[:n], *contents])
        yield state(f"the first {n} entries, the contents zeros", [*last[:n], *contents], CONTENTS["zeros"])


def _lasting(done: Sequence[Operation]) -> tuple[set[int], set[int]]:
    """Which operations last: by the strict rule, and on a disk with a journal."""
    strict, journal = set[int](), set[int]()
    for j, last in enumerate(done):
        if not isinstance(last, Synced):
            continue
        for i, operation in enumerate(done[:j]):
            match operation:
                case Written(node=node):
                    folders: tuple[int, ...] = (node,)
                case Moved(source=source, folder=folder):
                    folders = (source, folder)
                case Named(folder=folder) | Removed(folder=folder):
                    folders = (folder,)
                case _:
                    continue
            if last.node in folders:
                strict.add(i)
            if isinstance(operation, Entry) or last.node in folders:
                journal.add(i)
    return strict, journal
