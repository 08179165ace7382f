#!/usr/bin/env bash
# SPDX-FileCopyrightText: The LightTransport authors
# SPDX-License-Identifier: BSD-3-Clause
#
# Installs what is missing (Debian 12), builds, and lights a ventricle inside
# the MR head of Debian's mricron-data:
#   bash Examples/demo.sh
# The pictures and the report are then in gallery/.

set -eu
cd "$(dirname "${BASH_SOURCE[0]}")/.."
. Module/packages.sh
lighttransport_log=$PWD/build/log
mkdir -p "$lighttransport_log" gallery

lighttransport_install $lighttransport_build_packages $lighttransport_demo_packages

say "build"
lighttransport_build release >"$lighttransport_log/release.log" 2>&1 || {
  tail -n 60 "$lighttransport_log/release.log"
  echo "error: the build failed; all of its output: build/log/release.log" >&2
  exit 1
}

say "light"
bash Examples/LightVolume/gallery.sh build/release/bin/light-volume \
  /usr/share/mricron/templates/ch2.nii.gz gallery

say "done; in gallery/:"
find gallery -type f | sort
