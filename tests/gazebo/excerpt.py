# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Cut the excerpt of a drive's bag that the default tests annotate: ``python excerpt.py drive.bag excerpt.bag 10 12``.

Messages are copied as they are; of the clouds, which are large, those at whole seconds.
"""

import sys
from pathlib import Path
from typing import Any

from rosbags.interfaces import Connection, ConnectionExtRosbag1
from rosbags.rosbag1 import Reader, Writer

from fieldtruth.bag.decode import stamp_ns
from fieldtruth.bag.messages import STORE
from fieldtruth.experiment.rig import Rig


def excerpt(bag: Path, out: Path, first_s: float, last_s: float) -> None:
    """Write the messages whose stamps in the bag are from ``first_s`` to ``last_s`` to a bag of its own."""
    writer = Writer(out)
    writer.set_compression(Writer.CompressionFormat.BZ2)
    copies: dict[int, Connection] = {}
    with Reader(bag) as reader, writer:
        for connection, stamp, data in reader.messages(start=round(first_s * 1e9), stop=round(last_s * 1e9) + 1):
            if connection.topic == Rig().lidar.topic:
                cloud: Any = STORE.deserialize_ros1(data, connection.msgtype)
                if stamp_ns(cloud.header) % 10**9:
                    continue
            if connection.id not in copies:
                assert isinstance(connection.ext, ConnectionExtRosbag1)
                copies[connection.id] = writer.add_connection(
                    connection.topic,
                    connection.msgtype,
                    msgdef=connection.msgdef.data,
                    md5sum=connection.digest,
                    callerid=connection.ext.callerid,
                    latching=connection.ext.latching,
                )
            writer.write(copies[connection.id], stamp, data)


if __name__ == "__main__":
    excerpt(Path(sys.argv[1]), Path(sys.argv[2]), float(sys.argv[3]), float(sys.argv[4]))
