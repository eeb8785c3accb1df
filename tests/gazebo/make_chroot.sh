#!/usr/bin/env bash
# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
# Makes a chroot of Debian bullseye with Gazebo 11, the last release that Debian packaged, and with ROS 1, and builds the
# recorder and the plugin for ROS in it.
# Run as root on Debian: GZ_CHROOT=FOLDER tests/gazebo/make_chroot.sh. It takes about five minutes and 2.8 GB; a run that was
# interrupted continues with the same command. Packages come from the mirror that this machine's apt uses.
set -euo pipefail
here=$(cd "$(dirname "$0")" && pwd)
export GZ_CHROOT=${GZ_CHROOT:-${XDG_CACHE_HOME:-$HOME/.cache}/fieldtruth/gazebo_chroot}

if [ "$(id -u)" != 0 ]; then
  echo "make_chroot.sh must be run by root" >&2
  exit 2
fi
command -v debootstrap >/dev/null || { apt-get update -q && apt-get install -y -q --no-install-recommends debootstrap; }

packages="gazebo libgazebo-dev xvfb libgl1-mesa-dri libgl1 cmake g++ make
  libroscpp-dev libsensor-msgs-dev libnav-msgs-dev libros-rosgraph-msgs-dev python3-rosmaster python3-rosbag
  python3-rospy python3-sensor-msgs python3-nav-msgs python3-geometry-msgs python3-yaml"
if [ "$(cat "$GZ_CHROOT/etc/gazebo_packages" 2>/dev/null)" != "$packages" ]; then
  mirror=$(apt-get indextargets --format '$(REPO_URI)' | sort -u | grep '/debian/$' | head -n 1)
  if [ -e "$GZ_CHROOT/debootstrap" ] || [ ! -x "$GZ_CHROOT/usr/bin/apt-get" ]; then # the folder is there until it is done
    mkdir -p "$GZ_CHROOT"
    debootstrap --variant=minbase bullseye "$GZ_CHROOT" "$mirror"
  fi
  # This machine's proxy and its settings of expired indices hold there, too.
  apt-config dump | grep -E '^Acquire::(https?|Check-|Retries)' >"$GZ_CHROOT/etc/apt/apt.conf.d/90host" || true
  cp /etc/resolv.conf "$GZ_CHROOT/etc/resolv.conf"
  "$here/in_chroot.sh" apt-get update -q
  # shellcheck disable=SC2086  # a list
  "$here/in_chroot.sh" apt-get install -y -q --no-install-recommends $packages
  echo "$packages" >"$GZ_CHROOT/etc/gazebo_packages"
fi

for plugin in recorder ros_plugin; do
  mkdir -p "$GZ_CHROOT/opt/$plugin"
  cp "$here/$plugin"/* "$GZ_CHROOT/opt/$plugin/"
  "$here/in_chroot.sh" sh -c "cmake -Wno-dev -S /opt/$plugin -B /opt/$plugin/build && make -C /opt/$plugin/build"
done
echo "ready: GZ_CHROOT=$GZ_CHROOT ($(du -smx "$GZ_CHROOT" | cut -f1) MB)"
