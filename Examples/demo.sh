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

# Lit again only if the program, the script or the head changed, or a picture is gone.
program=build/release/bin/light-volume
script=Examples/LightVolume/gallery.sh
head=/usr/share/mricron/templates/ch2.nii.gz
made=gallery/.made
up_to_date()
{
  local file
  [ -f "$made" ] || return 1
  [ -z "$(find "$program" build/release/lib "$script" "$head" -newer "$made" -type f -print -quit)" ] ||
    return 1
  while read -r file; do
    [ -s "$file" ] || return 1
  done <"$made"
}

if up_to_date; then
  say "nothing changed since the pictures were made"
else
  say "light"
  rm -f "$made"
  bash "$script" "$program" "$head" gallery
  find gallery -type f -size +0 ! -name .made | sort >"$made"
fi

say "done; in gallery/:"
grep -v '^gallery/runs/' "$made"
