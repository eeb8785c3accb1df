# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""A node of ROS 1 by rospy, where that is installed. It publishes the bag's bytes, and needs no packages of messages.

Publishers have queues as those of drivers: of a subscriber that is slower than that, old messages are dropped by ROS.
"""

import os
from collections.abc import Sequence
from functools import cache
from types import SimpleNamespace
from typing import Any, Final

from fieldtruth.bag.messages import STORE
from fieldtruth.bag.topics import COMMANDS
from fieldtruth.core.errors import OutputError
from fieldtruth.experiment.sensor_config import Topic
from fieldtruth.live.commands import ALLOWED, CONTROLS, Inbox, answer_of
from fieldtruth.live.loop import LOOPBACK, Sink
from fieldtruth.live.messages import Message

NODE: Final = "fieldtruth"
_QUEUE_S: Final = 2.0
"""Simulated time [s] that a queue holds."""


@cache
def message_class(msgtype: str) -> Any:
    """Return a class of rospy for messages of a type that are serialised already."""
    import rospy

    text, md5sum = STORE.generate_msgdef(msgtype)
    name = msgtype.replace("/msg/", "/")
    return type(name, (rospy.AnyMsg,), {"_type": name, "_md5sum": md5sum, "_full_text": text, "_has_header": False})


class Ros1Sink(Sink):
    """The node.

    Args:
        inbox: gets the commands.
        host: address on which the node listens, and by which others know it.

    Raises:
        OutputError: rospy is missing, or no master answers.
    """

    def __init__(self, inbox: Inbox, host: str = LOOPBACK) -> None:
        try:
            import rosgraph
            import rospy
        except ImportError as error:
            what = f"rospy is not installed for this Python ({error})"
            raise OutputError(f"{what}; see docs/live.md for Debian's and Ubuntu's packages") from error
        os.environ |= {"ROS_IP": host}
        os.environ.pop("ROS_HOSTNAME", None)
        uri = os.environ.setdefault("ROS_MASTER_URI", "http://localhost:11311")
        try:
            rosgraph.Master(f"/{NODE}").getPid()
        except Exception as error:  # of several kinds, from sockets to XML-RPC
            raise OutputError(f"no ROS master answers at {uri}; start roscore, or set ROS_MASTER_URI") from error
        self._inbox, self._rospy = inbox, rospy
        rospy.init_node(NODE, disable_signals=True)
        rospy.set_param("/use_sim_time", True)
        self._publishers = dict[str, Any]()
        self.where = f"node /{NODE} on {host} of the ROS master {uri}" + ", for this machine only" * (host == LOOPBACK)
        kinds = {COMMANDS: rospy.AnyMsg} | {topic: message_class(kind) for topic, (kind, _) in CONTROLS.items()}
        self._subscribers = [
            rospy.Subscriber(topic, kind, self._take, topic, queue_size=10) for topic, kind in kinds.items()
        ]
        self._services = self._serve()

    def _serve(self) -> list[Any]:
        """Return the services, if ROS's package with their types is installed."""
        try:
            from std_srvs.srv import SetBool, SetBoolResponse, Trigger, TriggerResponse
        except ImportError:
            return []
        pause, reset = "/fieldtruth/pause", "/fieldtruth/reset"

        def answered(topic: str, value: Any) -> tuple[bool, str]:
            return answer_of(self._inbox.take(topic, CONTROLS[topic][0], SimpleNamespace(data=value)))

        return [
            self._rospy.Service(pause, SetBool, lambda asked: SetBoolResponse(*answered(pause, asked.data))),
            self._rospy.Service(reset, Trigger, lambda _: TriggerResponse(*answered(reset, -1))),
        ]

    def _take(self, message: Any, topic: str) -> None:
        msgtype = str(message._connection_header.get("type", "")).replace("/", "/msg/")
        if msgtype in ALLOWED[topic]:
            self._inbox.take_bytes(topic, msgtype, message._buff)
        else:
            self._inbox.refuse_type(topic, msgtype)

    def advertise(self, topics: Sequence[Topic]) -> None:
        """Make a publisher for each topic."""
        for topic in topics:
            size = 1 if topic.rate_hz is None else max(10, round(_QUEUE_S * topic.rate_hz))
            self._publishers[topic.name] = self._rospy.Publisher(
                topic.name, message_class(topic.msgtype), latch=topic.latched, queue_size=size, tcp_nodelay=True
            )

    def wants(self, topic: str) -> bool:
        """Return whether a node has subscribed."""
        return bool(self._publishers[topic].get_num_connections())

    def send(self, message: Message) -> None:
        """Publish a message."""
        publisher = self._publishers[message.topic]
        made = publisher.data_class()
        made._buff = message.data
        publisher.publish(made)

    def is_commanded(self) -> bool:
        """Return whether a node publishes commands."""
        return any(each.get_num_connections() for each in self._subscribers if each.resolved_name == COMMANDS)

    def close(self) -> None:
        """Leave the graph of ROS."""
        self._rospy.signal_shutdown("ended")
