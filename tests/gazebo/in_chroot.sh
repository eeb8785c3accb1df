#!/usr/bin/env bash
# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
# in_chroot.sh [--bind FOLDER]... COMMAND...: runs a command as root in the chroot GZ_CHROOT. The folders are visible there
# under the same path. Mounts and processes live in namespaces of their own, so nothing of either is left at the end.
set -euo pipefail
if [ "$$" != 1 ]; then
  exec setpriv --pdeathsig KILL unshare --mount --pid --fork --kill-child --propagation private "$0" "$@"
fi
mount -t proc proc "$GZ_CHROOT/proc"
mount --rbind /sys "$GZ_CHROOT/sys"
mount --rbind /dev "$GZ_CHROOT/dev"
while [ "$1" = --bind ]; do
  mkdir -p "$2" "$GZ_CHROOT$2"
  mount --bind "$2" "$GZ_CHROOT$2"
  shift 2
done
exec chroot "$GZ_CHROOT" env -i HOME=/root LANG=C PATH=/usr/sbin:/usr/bin:/sbin:/bin DEBIAN_FRONTEND=noninteractive "$@"
