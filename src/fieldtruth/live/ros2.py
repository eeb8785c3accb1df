# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""ROS 2 without its installation: topics over DDS, with the names, types and quality of service of its drivers.

A topic /tf is ``rt/tf`` in DDS, and a type sensor_msgs/msg/Imu is ``sensor_msgs::msg::dds_::Imu_``, all members final,
as XCDR version 1. Since Iron, an endpoint says the hash of its type in its user data (REP-2016); older releases pass
over it. Services identify requests in ways that differ between middlewares; so pause, step and reset are topics.
"""

import os
import socket
import stat
from collections.abc import Sequence
from contextlib import suppress
from typing import Any, Final

from rosbags.interfaces import Nodetype
from rosbags.typesys.store import Typestore

from fieldtruth.bag.messages import STORE
from fieldtruth.bag.ros2 import Ros2Types
from fieldtruth.bag.topics import CLOCK, COMMANDS, ODOMETRY, TF
from fieldtruth.core.errors import ConfigurationError, OutputError
from fieldtruth.experiment.sensor_config import Topic
from fieldtruth.live.commands import ALLOWED, Inbox
from fieldtruth.live.loop import LOOPBACK, Sink
from fieldtruth.live.messages import Message

_DOMAINS: Final = range(233)
_RELIABLE: Final = {CLOCK: 1, ODOMETRY: 10, TF: 100}
"""Depth of the topics that drivers and nodes publish reliably; others are sensor data."""
_SENSOR_DEPTH: Final = 5
_LARGEST: Final = "64 MB"
"""Samples above are refused before they are put together."""
_CONFIG: Final = """
<CycloneDDS><Domain>
  <General>
    <Interfaces><NetworkInterface address="{host}"/></Interfaces><AllowMulticast>{multicast}</AllowMulticast>
  </General>
  <Discovery>
    <ParticipantIndex>auto</ParticipantIndex><MaxAutoParticipantIndex>{most}</MaxAutoParticipantIndex>{peers}
    <SPDPInterval>1s</SPDPInterval>
  </Discovery>
  <Internal><MaxSampleSize>{largest}</MaxSampleSize></Internal>
</Domain></CycloneDDS>
"""
_MOST_PARTICIPANTS: Final = 32
"""Per machine, as in ROS 2."""


def domain_id() -> int:
    """Return the DDS domain, that of ROS_DOMAIN_ID or 0.

    Raises:
        ConfigurationError: it is no domain.
    """
    text = os.environ.get("ROS_DOMAIN_ID") or "0"
    if not text.isascii() or not text.isdigit() or int(text) not in _DOMAINS:
        raise ConfigurationError(f"ROS_DOMAIN_ID must be a number from 0 to {_DOMAINS[-1]}, got {text!r}")
    return int(text)


def udp_sockets() -> set[int]:
    """Return the descriptors of this process that are sockets of UDP and receive at all addresses."""
    found = set()
    for number in map(int, os.listdir("/proc/self/fd") if os.path.isdir("/proc/self/fd") else ()):  # noqa: PTH208, PTH112
        with suppress(OSError):
            if not stat.S_ISSOCK(os.fstat(number).st_mode):
                continue  # the copy of what no socket can be made of would stay open
            with socket.socket(fileno=os.dup(number)) as each:
                udp = each.type == socket.SOCK_DGRAM and each.family == socket.AF_INET
                if udp and each.getsockname()[0] == "0.0.0.0":
                    found.add(number)
    return found


def bind_to_loopback(numbers: set[int]) -> bool:
    """Let sockets receive from this machine only; return whether the system has done so.

    Cyclone DDS sends from the address that it is given, but receives at all.
    """
    try:
        for number in numbers:
            with socket.socket(fileno=os.dup(number)) as each:
                each.setsockopt(socket.SOL_SOCKET, socket.SO_BINDTODEVICE, b"lo\0")
    except OSError:  # before Linux 5.7, root alone may
        return False
    return bool(numbers)


class DdsTypes:
    """Classes of ``cyclonedds`` for types of messages."""

    def __init__(self, store: Typestore) -> None:
        self._store, self._made = store, dict[str, Any]()

    def __call__(self, msgtype: str) -> Any:
        """Return the class of a type, like ``sensor_msgs/msg/Imu``."""
        from cyclonedds.idl import make_idl_struct

        if msgtype not in self._made:
            package, _, name = msgtype.split("/")
            fields = {name: self._field(kind) for name, kind in self._store.fielddefs[msgtype][1]}
            self._made[msgtype] = make_idl_struct(name, f"{package}::msg::dds_::{name}_", fields)
        return self._made[msgtype]

    def _field(self, kind: Any) -> Any:
        from cyclonedds.idl import types

        node, of = kind
        if node == Nodetype.NAME:
            return self(of)
        if node == Nodetype.ARRAY:
            return types.array[self._field(of[0]), of[1]]
        if node == Nodetype.SEQUENCE:
            return types.sequence[self._field(of[0])]
        own = {"string": str, "bool": bool}
        return own.get(of[0]) or getattr(types, of[0])


class _Writer:
    """Writes messages that are serialised already."""

    def __init__(self, participant: Any, topic: str, kind: Any, qos: Any) -> None:
        from cyclonedds.pub import DataWriter
        from cyclonedds.topic import Topic as DdsTopic

        self._writer = DataWriter(participant, DdsTopic(participant, f"rt{topic}", kind), qos)
        self._sample, self._data = object.__new__(kind), b""
        self._sample.serialize = lambda **_: self._data

    @property
    def is_heard(self) -> bool:
        return bool(self._writer.get_matched_subscriptions())

    def write(self, data: bytes) -> None:
        from cyclonedds.core import DDSException

        self._data = data
        with suppress(DDSException):  # a reliable subscriber hangs; there is a time limit to waiting for it
            self._writer.write(self._sample)


class Ros2Sink(Sink):
    """A participant of a DDS domain.

    Args:
        inbox: gets the commands.
        host: address of the interface that is used.

    Raises:
        OutputError: the library is missing, the address is not of this machine, or the domain is full.
        ConfigurationError: ROS_DOMAIN_ID is no domain.
    """

    def __init__(self, inbox: Inbox, host: str = LOOPBACK) -> None:
        try:
            from cyclonedds.core import DDSException
            from cyclonedds.domain import Domain, DomainParticipant
        except ImportError as error:
            raise OutputError("cyclonedds is not installed; run: pip install 'fieldtruth[live]'") from error
        number, is_local = domain_id(), host == LOOPBACK
        self._inbox = inbox
        peers = f'<Peers><Peer address="{LOOPBACK}"/></Peers>' if is_local else ""
        config = _CONFIG.format(
            host=host,
            multicast=str(not is_local).lower(),
            most=_MOST_PARTICIPANTS,
            peers=peers,
            largest=_LARGEST,
        )
        others = udp_sockets()
        try:
            self._domain = Domain(number, config)
            # A participant has one type of a topic, and /cmd_vel may have two.
            self._participant, self._second = DomainParticipant(number), DomainParticipant(number)
        except DDSException as error:
            what = f"DDS domain {number} cannot be joined at {host}"
            hint = f"it may be full ({_MOST_PARTICIPANTS} participants), or this machine has no such address"
            raise OutputError(f"{what}: {hint}; choose another ROS_DOMAIN_ID or --host") from error
        self._types = Ros2Types(STORE, {kind for kinds in ALLOWED.values() for kind in kinds}, "commands")
        self._classes = DdsTypes(self._types.store)
        self._writers, self._msgtypes = dict[str, _Writer](), dict[str, str]()
        only = is_local and bind_to_loopback(udp_sockets() - others)
        self.where = (
            f"DDS domain {number} at {host}, {'for this machine only' if only else 'received at all addresses'}"
        )
        self._listen()

    def _qos(self, msgtype: str, *, depth: int, reliable: bool, latched: bool = False) -> Any:
        from cyclonedds.qos import Policy, Qos
        from cyclonedds.util import duration

        reliability = Policy.Reliability.Reliable(duration(milliseconds=100))
        return Qos(
            reliability if reliable else Policy.Reliability.BestEffort,
            Policy.Durability.TransientLocal if latched else Policy.Durability.Volatile,
            Policy.History.KeepLast(depth),
            Policy.DataRepresentation(use_cdrv0_representation=True),
            Policy.Userdata(f"typehash={self._types.digest(msgtype)};".encode()),
        )

    def _listen(self) -> None:
        from cyclonedds.builtin import BuiltinDataReader, BuiltinTopicDcpsPublication
        from cyclonedds.sub import DataReader
        from cyclonedds.topic import Topic as DdsTopic

        self._readers = []
        for topic, kinds in ALLOWED.items():
            for participant, msgtype in zip((self._participant, self._second), kinds, strict=False):
                named = DdsTopic(participant, f"rt{topic}", self._classes(msgtype))
                qos = self._qos(msgtype, depth=10, reliable=topic != COMMANDS)
                self._readers.append((topic, msgtype, DataReader(participant, named, qos)))
        self._publications = BuiltinDataReader(self._participant, BuiltinTopicDcpsPublication)

    def advertise(self, topics: Sequence[Topic]) -> None:
        """Make a writer for each topic."""
        self._msgtypes = {topic.name: topic.msgtype for topic in topics}
        self._types.add(self._msgtypes.values())
        for topic in topics:
            depth = 1 if topic.latched else _RELIABLE.get(topic.name, _SENSOR_DEPTH)
            reliable = topic.latched or topic.name in _RELIABLE
            qos = self._qos(topic.msgtype, depth=depth, reliable=reliable, latched=topic.latched)
            self._writers[topic.name] = _Writer(self._participant, topic.name, self._classes(topic.msgtype), qos)

    def wants(self, topic: str) -> bool:
        """Return whether a reader is matched."""
        return self._writers[topic].is_heard

    def send(self, message: Message) -> None:
        """Write a message as CDR."""
        data = self._types.cdr(self._msgtypes[message.topic], message.data)
        self._writers[message.topic].write(bytes(data))

    def poll(self) -> None:
        """Take what was published to the topics of commands, and name publishers of wrong types."""
        for topic, msgtype, reader in self._readers:
            try:
                samples = reader.take(10)
            except Exception as error:  # of any kind, for a text that is no UTF-8
                self._inbox.refuse(topic, f"is no {msgtype}: {error}")
                continue
            for sample in samples:
                if type(sample) is self._classes(msgtype):  # not the end of a publisher
                    self._inbox.take(topic, msgtype, sample)
        for each in self._publications.take(100):
            topic = getattr(each, "topic_name", "").removeprefix("rt")
            known = {self._classes(kind).__idl_typename__ for kind in ALLOWED.get(topic, ())}
            if known and each.type_name not in known:
                self._inbox.refuse_type(topic, each.type_name)

    def is_commanded(self) -> bool:
        """Return whether a writer of commands is matched."""
        return any(reader.get_matched_publications() for topic, _, reader in self._readers if topic == COMMANDS)

    def close(self) -> None:
        """Leave the domain, now and not when the last reference is gone."""
        self._domain.__del__()
