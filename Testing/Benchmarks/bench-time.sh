#!/usr/bin/env bash
# SPDX-FileCopyrightText: The LightTransport authors
# SPDX-License-Identifier: BSD-3-Clause
#
# The numbers and pictures of Module/Documentation/time.md (Debian 12), half a minute once built:
#   bash Testing/Benchmarks/bench-time.sh [FOLDER]
# leaves them in FOLDER (build/dev/bench-time). Installs matplotlib, which nothing else needs.

set -u
cd "$(dirname "${BASH_SOURCE[0]}")/../.."
. Module/packages.sh
lighttransport_log=$PWD/build/log
folder=${1:-build/dev/bench-time}
mkdir -p "$lighttransport_log" "$folder"
lighttransport_install $lighttransport_build_packages python3-matplotlib || exit 1
lighttransport_build dev bench-time >"$lighttransport_log/bench.log" 2>&1 || {
  tail -n 40 "$lighttransport_log/bench.log" >&2
  exit 1
}
build/dev/bin/bench-time "$folder" && /usr/bin/python3 -B Testing/Benchmarks/bench-time.py "$folder"
