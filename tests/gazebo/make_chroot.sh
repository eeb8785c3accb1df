#!/usr/bin/env bash
# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
# Makes a chroot of Debian bullseye with Gazebo 11, the last release that Debian packaged, and builds the recorder in it.
# Run as root on Debian: GZ_CHROOT=FOLDER tests/gazebo/make_chroot.sh. It takes about four minutes and 2.5 GB; a run that was
# interrupted continues with the same command. Packages come from the mirror that this machine's apt uses.
set -euo pipefail
here=$(cd "$(dirname "$0")" && pwd)
export GZ_CHROOT=${GZ_CHROOT:-${XDG_CACHE_HOME:-$HOME/.cache}/fieldtruth/gazebo_chroot}

if [ "$(id -u)" != 0 ]; then
  echo "make_chroot.sh must be run by root" >&2
  exit 2
fi
command -v debootstrap >/dev/null || { apt-get update -q && apt-get install -y -q --no-install-recommends debootstrap; }

if [ ! -e "$GZ_CHROOT/etc/gazebo_packages" ]; then
  mirror=$(apt-get indextargets --format '$(REPO_URI)' | sort -u | grep '/debian/$' | head -n 1)
  if [ ! -x "$GZ_CHROOT/usr/bin/apt-get" ]; then
    mkdir -p "$GZ_CHROOT"
    debootstrap --variant=minbase bullseye "$GZ_CHROOT" "$mirror"
  fi
  # This machine's proxy and its settings of expired indices hold there, too.
  apt-config dump | grep -E '^Acquire::(https?|Check-|Retries)' >"$GZ_CHROOT/etc/apt/apt.conf.d/90host" || true
  cp /etc/resolv.conf "$GZ_CHROOT/etc/resolv.conf"
  "$here/in_chroot.sh" apt-get update -q
  "$here/in_chroot.sh" apt-get install -y -q --no-install-recommends \
    gazebo libgazebo-dev xvfb libgl1-mesa-dri libgl1 cmake g++ make
  touch "$GZ_CHROOT/etc/gazebo_packages"
fi

mkdir -p "$GZ_CHROOT/opt/recorder"
cp "$here"/recorder/* "$GZ_CHROOT/opt/recorder/"
"$here/in_chroot.sh" sh -c 'cmake -S /opt/recorder -B /opt/recorder/build && make -C /opt/recorder/build'
echo "ready: GZ_CHROOT=$GZ_CHROOT ($(du -smx "$GZ_CHROOT" | cut -f1) MB)"
