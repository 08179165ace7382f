#!/usr/bin/env bash
# SPDX-FileCopyrightText: The LightTransport authors
# SPDX-License-Identifier: BSD-3-Clause
#
# Measures what a solve that is no better than the scene requires costs and how wrong it is:
#   bash Testing/Benchmarks/bench-frugal.sh [--output FOLDER] [--sections target,...] ...
# Builds in build/dev, runs bench-frugal with the options given (see BenchFrugal.cxx), and leaves
# frugal.md, *.csv and *.png in build/dev/frugal, or where --output says. Without options, judges
# the scenes that were held out too (--seed 7 to 11). A quarter of an hour.

set -u
cd "$(dirname "${BASH_SOURCE[0]}")/../.."
. Module/packages.sh
lighttransport_log=$PWD/build/log
mkdir -p "$lighttransport_log"

output=build/dev/frugal
for ((i = 1; i < $#; ++i)); do
  if [ "${!i}" = --output ]; then
    ((++i))
    output=${!i}
  fi
done

lighttransport_install $lighttransport_build_packages python3-matplotlib || exit 1
lighttransport_build dev bench-frugal >"$lighttransport_log/frugal.log" 2>&1 || {
  tail -n 40 "$lighttransport_log/frugal.log" >&2
  exit 1
}
mkdir -p "$output"
build/dev/bin/bench-frugal --output "$output" "$@" | tee "$output/frugal.md"
code=${PIPESTATUS[0]}
if (($# == 0)); then # all of it: the scenes held out as well
  for seed in 7 8 9 10 11; do
    mkdir -p "$output/seed-$seed"
    build/dev/bin/bench-frugal --output "$output/seed-$seed" --sections target --seed $seed |
      tee "$output/seed-$seed/frugal.md" || code=1
  done
fi
/usr/bin/python3 -B Testing/Benchmarks/bench-frugal-plots.py "$output" || code=1
exit "$code"
