# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Bag files: how they are stored (in any format, and in that of ROS 1), errors of reading, and the files beside a bag.

Errors of the libraries below become one clear line. Of a bag of ROS 1 (version 2.0), only the list of chunks is read:
ROS's readers, and that of rosbags, first read the index of all messages, which at 1000 Hz is larger than all images in
memory at once, and takes longer to read than a trajectory.
"""

import json
import stat
import struct
from abc import ABC, abstractmethod
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Final, NamedTuple, Protocol

from rosbags.interfaces import Connection
from rosbags.rosbag1 import Reader, ReaderError
from rosbags.rosbag1.reader import Chunk, Header, IndexData, RecordType
from rosbags.typesys import TypesysError

from fieldtruth.core.errors import FieldtruthError
from fieldtruth.experiment.config import Experiment
from fieldtruth.experiment.files import load_experiment
from fieldtruth.experiment.sensor_config import TRUTH

_DAMAGE: Final = (ReaderError, OSError, EOFError, RuntimeError, ValueError, KeyError, struct.error, TypesysError)
"""Errors that the libraries raise for invalid bytes."""
_BAG: Final = b"#ROSBAG V2.0"
MCAP: Final = b"\x89MCAP0\r\n"
"""First bytes of an MCAP file."""
_KINDS: Final = {
    b"PK\x03\x04": "it is a Zip file; unpack it and use the bag in it",
    b"\x89MCAP": "it is an MCAP file of another version",
    b"SQLite": "it is a database; one of ROS 2 has a name that ends in .db3",
    b"#ROSBAG": "its bag version is not 2.0",
}
"""Files that users confuse with bags, by their first bytes."""
_LONGEST: Final = 200
"""Characters of a library's message, which may quote what it read."""


class BagError(FieldtruthError):
    """A file that is not a readable bag, or a bag that lacks required topics or fields."""


@contextmanager
def read_errors(path: Path) -> Iterator[None]:
    """Turn any error while a bag is read into one clear line.

    Raises:
        BagError: the path and the reason.
    """
    try:
        yield
    except FieldtruthError:
        raise
    except _DAMAGE as error:
        raise BagError(f"cannot read {path}: {_other_kind(path) or _in_words(error)}") from error


def first_bytes(path: Path, size: int = len(_BAG)) -> bytes:
    """Return the first bytes of a file.

    Raises:
        BagError: it cannot be read, or is not a file: reading a named pipe would wait for a process that writes to it.
    """
    with read_errors(path):
        mode = path.stat().st_mode
        if not stat.S_ISREG(mode):
            kinds = {stat.S_IFDIR: "a folder", stat.S_IFIFO: "a named pipe", stat.S_IFSOCK: "a socket"}
            raise BagError(f"cannot read {path}: it is {kinds.get(stat.S_IFMT(mode), 'a device')}, not a file")
        with path.open("rb") as file:
            return file.read(size)


def is_ros1(path: Path) -> bool:
    """Return whether a bag is one of ROS 1, by its first bytes; raises as ``first_bytes``."""
    return not is_database(path) and first_bytes(path) == _BAG


def _other_kind(path: Path) -> str:
    """Describe a file that is not a bag at all; empty for bags."""
    try:
        with path.open("rb") as file:
            start = file.read(len(_BAG))
    except OSError:
        return ""
    if start.startswith((_BAG, MCAP)):
        return ""
    kinds = [words for magic, words in _KINDS.items() if start.startswith(magic)] if start else ["it is empty"]
    other = f"it is not an MCAP file, a database of ROS 2 or a ROS 1 bag, which begins with {_BAG.decode()}"
    return kinds[0] if kinds else other


def _in_words(error: BaseException) -> str:
    if isinstance(error, OSError) and error.strerror:
        return error.strerror
    if isinstance(error, KeyError):
        return f"a record lacks its field {error}"
    text = str(error)
    if "not indexed" in text:
        return "it has no index, as after an aborted recording; `rosbag reindex` may repair it"
    if text.startswith("Bag index looks damaged"):
        return "its index is damaged, as in a truncated file"
    return " ".join(text.split())[:_LONGEST] or type(error).__name__


class ChunkInfo(NamedTuple):
    """A chunk: its position in the file, first and last stamp [ns], and its connections."""

    pos: int
    start_ns: int
    end_ns: int
    counts: Mapping[int, int]
    """Messages by connection, 1 where the file does not state their number."""


Row = tuple[int, int, int, int]
"""Stamp [ns] of a message, its connection, start and size of its bytes in the chunk."""


class Layout(Protocol):
    """Format of stored chunks; it holds no open file and can be pickled."""

    def unpack(self, path: Path, position: int) -> bytes:
        """Read and decompress the chunk at a position in a file."""
        ...

    def rows(self, chunk: bytes, at: int = 0) -> Iterator[Row]:
        """Yield the messages in a decompressed chunk, from an offset on, where one begins."""
        ...

    def ros1(self, connection: int, data: bytes) -> bytes:
        """Return a message as ROS 1 serialises it."""
        ...


class StoredFile(ABC):
    """An open bag file."""

    layout: Layout
    connections: Sequence[Connection]
    """With types as ROS 1 defines them and the number of their messages."""
    chunks: Sequence[ChunkInfo]
    start_ns: int
    end_ns: int
    """First and last stamp [ns]."""

    @abstractmethod
    def index(self, chunk: ChunkInfo) -> Iterator[tuple[int, int, int]]:
        """Yield connection, stamp [ns] and offset in its chunk of each message."""

    @abstractmethod
    def close(self) -> None:
        """Close the file."""


_OPERATION: Final = b"op="
_CONNECTION: Final = b"conn="
_TIME: Final = b"time="


class Ros1Layout:
    """Chunks of a bag of ROS 1."""

    def unpack(self, path: Path, position: int) -> bytes:
        """Read and decompress the chunk at a position in a file."""
        with path.open("rb") as source:
            reader = _LeanReader(path)
            reader.bio = source
            source.seek(position)
            return reader.unpack(reader.read_chunk())

    def rows(self, chunk: bytes, at: int = 0) -> Iterator[Row]:
        """Yield the messages in a decompressed chunk, from an offset on, where one begins."""
        while at < len(chunk):
            (size,) = struct.unpack_from("<L", chunk, at)
            fields, at = _fields(chunk, at + 4, size), at + 4 + size
            (size,) = struct.unpack_from("<L", chunk, at)
            at += 4
            if at + size > len(chunk):
                raise ReaderError("a message is truncated at the end of its chunk")
            if fields[_OPERATION] == bytes([RecordType.MSGDATA]):
                seconds, nanoseconds = struct.unpack("<LL", fields[_TIME])
                yield seconds * 10**9 + nanoseconds, int.from_bytes(fields[_CONNECTION], "little"), at, size
            at += size

    def ros1(self, connection: int, data: bytes) -> bytes:
        """Return a message as ROS 1 serialises it."""
        return data


class Ros1File(StoredFile):
    """An open bag of ROS 1; the list of its chunks is in memory, but not the index of messages."""

    def __init__(self, path: Path) -> None:
        self.layout = Ros1Layout()
        self._reader = _LeanReader(path)
        self._reader.open()
        self.chunks = [
            ChunkInfo(info.pos, info.start_time, info.end_time, info.connection_counts)
            for info in self._reader.chunk_infos
        ]
        counts: Counter[int] = Counter()
        for info in self.chunks:
            counts.update(info.counts)
        self.connections = [each._replace(msgcount=counts[each.id]) for each in self._reader.connections]
        self.start_ns, self.end_ns = self._reader.start_time, self._reader.end_time - 1

    def index(self, chunk: ChunkInfo) -> Iterator[tuple[int, int, int]]:
        """Yield connection, stamp [ns] and offset in its chunk of each message."""
        found, source = self._reader.chunks[chunk.pos], self._reader.bio
        assert source is not None
        source.seek(found.datapos + found.datasize)
        for _ in chunk.counts:
            number = Header.read(source, RecordType.IDXDATA).get_uint32("conn")
            data = source.read(int.from_bytes(source.read(4), "little"))
            for seconds, nanoseconds, offset in struct.iter_unpack("<LLL", data):
                yield number, seconds * 10**9 + nanoseconds, offset

    def close(self) -> None:
        """Close the file."""
        self._reader.close()


class _LeanReader(Reader):
    """Reads the list of chunks, but not the index of messages."""

    def read_index_data(self, pos: int, indexes: dict[int, list[IndexData]]) -> None:
        """Skip the index of messages."""

    def read_chunk(self) -> Chunk:
        """Read the position of a chunk's data, which must lie within the file."""
        chunk = super().read_chunk()
        if chunk.datapos + chunk.datasize > self.path.stat().st_size:
            raise ReaderError("it is truncated within a chunk")
        return chunk

    def unpack(self, chunk: Chunk) -> bytes:
        """Read and decompress a chunk."""
        assert self.bio is not None
        self.bio.seek(chunk.datapos)
        packed = self.bio.read(chunk.datasize)
        if len(packed) < chunk.datasize:
            raise ReaderError("it is truncated within a chunk")
        return chunk.decompressor(packed)


def _fields(data: bytes, at: int, size: int) -> dict[bytes, bytes]:
    """Return the fields of a record's header by ``name=``."""
    fields: dict[bytes, bytes] = {}
    end = at + size
    if end > len(data):
        raise ReaderError("a record's header is truncated")
    while at < end:
        (size,) = struct.unpack_from("<L", data, at)
        name, sign, value = data[at + 4 : at + 4 + size].partition(b"=")
        fields[name + sign] = value
        at += 4 + size
    return fields


# ---------------------------------------------------------------------------------------------------------------------
# A bag and its description

EXPERIMENT: str = "experiment.yaml"
"""The experiment beside a bag."""
CARD: str = "DATASET.md"
"""The data card beside a bag."""
MADE_BY: str = "made_by.json"
"""Processors and libraries that made the readings, beside a bag; see ``bag.provenance``."""
TRACK: str = "track.csv"
"""The poses of the track file beside a bag, if its experiment has one."""
BAG_ENDINGS: Final = (".bag", ".mcap")
"""Endings of the names of bags, the preferred one first."""


@dataclass(frozen=True)
class BagFile:
    """A bag and its metadata, which is known without reading all of it."""

    bag: Path
    experiment: Experiment | None
    """The experiment that generated it; None for a bag from elsewhere."""
    counts: Mapping[str, int]
    """Messages by topic; every topic has at least one."""
    msgtypes: Mapping[str, str]
    """Message type by topic, like ``sensor_msgs/msg/Imu``."""
    start_ns: int
    end_ns: int
    """First and last stamp [ns]."""

    @property
    def name(self) -> str:
        """The bag's name without its suffix."""
        return self.bag.stem

    @property
    def folder(self) -> Path:
        """The folder of the bag."""
        return self.bag.parent

    @property
    def clocked(self) -> frozenset[str]:
        """Topics whose headers have a sensor's own time, while their stamps in the bag are the true ones."""
        if self.experiment is None:
            return frozenset()
        sensors = (sensor for sensor in self.experiment.rig.sensors if sensor.clock is not None)
        topics = (topic.name for sensor in sensors for topic in sensor.topics())
        return frozenset(name for name in topics if name in self.counts and not name.endswith(TRUTH))

    @property
    def world(self) -> str | None:
        """Text that is equal for runs in the same world; None for a bag from elsewhere, whose world is unknown."""
        if self.experiment is None:
            return None
        parts = self.experiment.model_dump(mode="json", include={"environment", "seed", "layout"})
        return json.dumps(parts, sort_keys=True)

    @property
    def is_frames(self) -> bool:
        """True if each pose stands for itself, so that nothing moves from one to the next."""
        return self.experiment is not None and self.experiment.frames is not None

    @property
    def duration_s(self) -> float:
        """Time [s] from the first to the last stamp."""
        return (self.end_ns - self.start_ns) / 1e9

    def require(self, *topics: str) -> None:
        """Check that the bag has messages of all these topics.

        Raises:
            BagError: lists the missing and the available topics.
        """
        missing = [topic for topic in topics if topic not in self.counts]
        if missing:
            raise BagError(f"{self.bag} has no {', '.join(missing)}; available: {', '.join(sorted(self.counts))}")

    def require_instances(self, *topics: str) -> None:
        """Check that the bag has these topics of instance images.

        Raises:
            BagError: lists the missing ones and states how to make them.
        """
        missing = [topic for topic in topics if topic not in self.counts]
        if missing:
            name = "NAME" if self.experiment is None else self.experiment.name
            hint = f"`fieldtruth generate {name} --extras instances` makes a bag that has them"
            raise BagError(f"{self.bag} has no {', '.join(missing)}, the object of each pixel; {hint}")


def is_database(path: Path) -> bool:
    """Return whether a path looks like a bag of ROS 2 other than an MCAP file."""
    return path.suffix == ".db3" or (path / "metadata.yaml").is_file()


def bag_files(bag: Path) -> list[Path]:
    """Return the files of a bag: those in it if it is a folder of ROS 2, else itself."""
    return sorted(path for path in bag.rglob("*") if path.is_file()) if bag.is_dir() else [bag]


def find_bag(path: Path | str) -> Path:
    """Return the path of the bag: the file itself, or the one in the folder of a run.

    In a folder, a bag of ROS 1 goes before MCAP files, and one with the folder's name before others. A folder of ROS 2,
    which has metadata.yaml, is itself the bag, unless there is one MCAP file in it.

    Raises:
        BagError: no such path, something else than a file or a folder, no bag in the folder, or several.
    """
    path = Path(path)
    if not path.is_dir():
        if not path.exists():
            raise BagError(f"{path} does not exist; a run must be the folder of a run, or a bag")
        first_bytes(path)
        return path
    bags: list[Path] = []
    for ending in BAG_ENDINGS:
        own = path / f"{path.resolve().name}{ending}"
        bags = bags or ([own] if own.exists() else sorted(path.glob(f"*{ending}")))
    if len(bags) != 1 and is_database(path):
        return path
    if not bags and (robots := runs_of_robots(path)):
        given = ", ".join(map(str, robots))
        raise BagError(f"{path} has a run of each of several robots; give one: {given}")
    if len(bags) != 1:
        what = f"{len(bags)} bags ({', '.join(bag.name for bag in bags)})" if bags else "no bag"
        raise BagError(f"{path} has {what}; a run must be a folder with one bag, or a bag")
    first_bytes(bags[0])
    return bags[0]


def runs_of_robots(path: Path | str) -> list[Path]:
    """Return the folders of the runs of several robots in the folder of an experiment; none in other folders."""
    folder = Path(path)
    return sorted(
        bag.parent for bag in folder.glob("*/*.bag") if bag.stem == f"{folder.resolve().name}_{bag.parent.name}"
    )


def experiment_of(bag: Path) -> Experiment | None:
    """Return the experiment beside a bag if it has the bag's name, else it belongs to another bag."""
    path = bag.parent / EXPERIMENT
    if not path.exists():
        return None
    experiment = load_experiment(path)
    return experiment if experiment.name == bag.stem else None
