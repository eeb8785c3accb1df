#!/usr/bin/env bash
# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
# drive_with_ros.sh WORLD CONFIG: inside the chroot, a ROS master, gzserver with the file WORLD of a package and the plugin
# that publishes to ROS, `rosbag record`, and the package's nodes, which drive along the waypoints of its file CONFIG
# until the plugin says that the drive has ended. The bag and the output of each program are in the folder RESULTS.
# ROS_MASTER_URI and GAZEBO_MASTER_URI have free ports.
set -u
cd "$RESULTS"
export ROS_HOSTNAME=127.0.0.1 ROS_HOME=$RESULTS/home
world=$1 config=$2 package=$(dirname "$(dirname "$2")")
rosmaster --core -p "${ROS_MASTER_URI##*:}" >master.log 2>&1 &
for _ in $(seq 100); do (: >"/dev/tcp/127.0.0.1/${ROS_MASTER_URI##*:}") 2>/dev/null && break; sleep 0.1; done

gzserver --verbose -s /opt/ros_plugin/build/libgazebo_to_ros.so "$world" >gazebo.log 2>&1 &
server=$!
wait_for() { until grep -qs "$1" gazebo.log; do kill -0 $server 2>/dev/null || exit 1; sleep 0.1; done; }
wait_for "waiting for the recorder"
/usr/lib/rosbag/record --all --exclude "/rosout.*" --lz4 --buffsize=0 --output-name drive.bag >record.log 2>&1 &
recorder=$!
"$package/scripts/relay.py" "$package/config/cameras.yaml" >relay.log 2>&1 &
"$package/scripts/waypoints.py" "$config" >waypoints.log 2>&1 &
wait_for "drive ends"
sleep 0.5
kill -INT $recorder
wait $recorder
