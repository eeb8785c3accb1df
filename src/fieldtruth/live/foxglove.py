# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""A WebSocket server for Foxglove: messages as in the bag, the world as boxes, teleoperation, and services.

Clients may publish to the topics of commands, as ROS 1 or JSON has them, and call services of the same names.
"""

from collections.abc import Sequence
from typing import Any, Final

from fieldtruth.bag.messages import STORE, text_field
from fieldtruth.bag.topics import CLOCK
from fieldtruth.core.errors import OutputError
from fieldtruth.experiment.rig import Rig
from fieldtruth.experiment.sensor_config import Topic
from fieldtruth.live.commands import ALLOWED, CONTROLS, Inbox, answer_of
from fieldtruth.live.loop import LOOPBACK, Sink
from fieldtruth.live.messages import Message
from fieldtruth.live.scene import scene_update
from fieldtruth.world.model import World

_ENCODINGS: Final = ("ros1", "json")
SCENE: Final = "/fieldtruth/scene"
_BACKLOG: Final = 32
"""Messages that wait for a slow client; older ones are dropped."""


class _Listener:
    """Takes what clients publish, and notes who subscribes."""

    def __init__(self, inbox: Inbox) -> None:
        self._inbox, self._channels = inbox, dict[tuple[int, int], Any]()
        self.new = set[str]()
        """Topics with new subscribers."""

    def on_subscribe(self, client: Any, channel: Any) -> None:
        self.new.add(channel.topic)

    def on_unsubscribe(self, client: Any, channel: Any) -> None:
        pass

    def on_client_advertise(self, client: Any, channel: Any) -> None:
        package, _, name = str(channel.schema_name).replace("/msg/", "/").partition("/")
        msgtype = f"{package}/msg/{name}"
        if msgtype in ALLOWED.get(channel.topic, ()) and channel.encoding in _ENCODINGS:
            self._channels[client.id, channel.id] = channel.topic, msgtype, channel.encoding
        else:
            self._inbox.refuse_type(channel.topic, f"{channel.schema_name} in {channel.encoding}")

    def on_client_unadvertise(self, client: Any, client_channel_id: int) -> None:
        self._channels.pop((client.id, client_channel_id), None)

    def on_message_data(self, client: Any, client_channel_id: int, data: bytes) -> None:
        if found := self._channels.get((client.id, client_channel_id)):
            topic, msgtype, encoding = found
            self._inbox.take_bytes(topic, msgtype, data, encoding)


class FoxgloveSink(Sink):
    """The server.

    Args:
        inbox: gets the commands.
        host: address on which it listens.
        port: on which it listens; 0 for any that is free.

    Raises:
        OutputError: the library is missing, or the port is not free.
    """

    def __init__(self, inbox: Inbox, host: str = LOOPBACK, port: int = 8765) -> None:
        try:
            import foxglove
            from foxglove.websocket import Capability
        except ImportError as error:
            raise OutputError("foxglove-sdk is not installed; run: pip install 'fieldtruth[live]'") from error
        self._foxglove, self._inbox, self._listener = foxglove, inbox, _Listener(inbox)
        self._context, self._channels, self._kept = foxglove.Context(), dict[str, Any](), dict[str, Message | None]()
        try:
            self._server = foxglove.start_server(
                name="fieldtruth",
                host=host,
                port=port,
                capabilities=[Capability.ClientPublish, Capability.Services, Capability.Time],
                supported_encodings=[*_ENCODINGS],
                server_listener=self._listener,
                services=[self._service(topic) for topic in CONTROLS],
                context=self._context,
                message_backlog_size=_BACKLOG,
            )
        except (RuntimeError, OSError) as error:
            what = f"cannot listen on port {port} of {host}: {error}"
            raise OutputError(f"{what}; choose another --port, or an address of this machine as --host") from error
        self.where = f"ws://{host}:{self._server.port}" + ", for this machine only" * (host == LOOPBACK)

    def _service(self, topic: str) -> Any:
        """Return a service whose request is a message of a topic of commands."""
        msgtype = CONTROLS[topic][0]

        def schema(name: str, text: str) -> Any:
            made = self._foxglove.Schema(name=name, encoding="ros1msg", data=text.encode())
            return self._foxglove.MessageSchema(encoding="ros1", schema=made)

        def serve(request: Any) -> bytes:
            success, text = answer_of(self._inbox.take_bytes(topic, msgtype, request.payload))
            return bytes([success]) + text_field(text)

        wanted = schema(msgtype.replace("/msg/", "/"), STORE.generate_msgdef(msgtype)[0])
        given = schema("std_srvs/TriggerResponse", "bool success\nstring message")
        known = self._foxglove.ServiceSchema(name=topic, request=wanted, response=given)
        return self._foxglove.Service(topic, schema=known, handler=serve)

    def advertise(self, topics: Sequence[Topic]) -> None:
        """Make a channel for each topic."""
        for topic in topics:
            text, _ = STORE.generate_msgdef(topic.msgtype)
            name = topic.msgtype.replace("/msg/", "/")
            schema = self._foxglove.Schema(name=name, encoding="ros1msg", data=text.encode())
            self._channels[topic.name] = self._foxglove.Channel(
                topic.name, message_encoding="ros1", schema=schema, context=self._context
            )
            if topic.latched:
                self._kept[topic.name] = None

    def show(self, world: World, rig: Rig) -> None:
        """Send the world and the robot as boxes, and let clients begin anew, as time does."""
        update = scene_update(world, rig)
        if SCENE not in self._channels:
            self._channels[SCENE] = self._foxglove.Channel(
                SCENE, message_encoding="protobuf", schema=update.get_schema(), context=self._context
            )
        else:
            self._server.clear_session()
        self._kept[SCENE] = None
        self.send(Message(0, SCENE, update.encode()))

    def wants(self, topic: str) -> bool:
        """Return whether a client has subscribed."""
        return bool(self._channels[topic].has_sinks())

    def send(self, message: Message) -> None:
        """Log a message; the clock is also the time of the server."""
        if message.topic == CLOCK:
            self._server.broadcast_time(message.stamp_ns)
        if message.topic in self._kept:
            self._kept[message.topic] = message
        self._channels[message.topic].log(message.data, log_time=message.stamp_ns)

    def poll(self) -> None:
        """Send what is latched to those who are new."""
        while self._listener.new:
            if message := self._kept.get(self._listener.new.pop()):
                self.send(message)

    def close(self) -> None:
        """Close the connections."""
        self._server.stop()
