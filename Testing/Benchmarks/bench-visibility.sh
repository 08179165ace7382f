#!/usr/bin/env bash
# SPDX-FileCopyrightText: The LightTransport authors
# SPDX-License-Identifier: BSD-3-Clause
#
# The numbers and the figure of Module/Documentation/visibility.md (Debian 12), a minute once built:
#   bash Testing/Benchmarks/bench-visibility.sh [FOLDER [SECTION ...]]
# leaves tables as CSV and visibility.png in FOLDER (build/dev/bench-visibility); the sections are
# those of BenchVisibility.cxx. Installs matplotlib, which nothing else needs.

set -u
cd "$(dirname "${BASH_SOURCE[0]}")/../.."
. Module/packages.sh
lighttransport_log=$PWD/build/log
folder=${1:-build/dev/bench-visibility}
shift
mkdir -p "$lighttransport_log" "$folder"
lighttransport_install $lighttransport_build_packages python3-matplotlib || exit 1
lighttransport_build dev bench-visibility >"$lighttransport_log/bench.log" 2>&1 || {
  tail -n 40 "$lighttransport_log/bench.log" >&2
  exit 1
}
build/dev/bin/bench-visibility "$folder" --data ../shared/data "$@" &&
  /usr/bin/python3 -B Testing/Benchmarks/bench-visibility.py "$folder"
