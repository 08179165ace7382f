#!/usr/bin/env bash
# SPDX-FileCopyrightText: The LightTransport authors
# SPDX-License-Identifier: BSD-3-Clause
#
# Measures the diffusion solver against its floor and its competitors (Debian 12):
#   bash Testing/Benchmarks/bench-diffusion.sh [--quick] [--large] [--sizes 64,128] ...
# Installs what only the benchmark needs (hypre with MPI, Eigen, matplotlib), builds
# in build/bench, runs bench-diffusion with the options given (see BenchDiffusion.cxx),
# and leaves bench-diffusion.md, *.csv and *.png in build/bench/results, or where
# --output says. A quarter of an hour and 8 GB of memory; --quick: half a minute.

set -u
cd "$(dirname "${BASH_SOURCE[0]}")/../.."
. Module/packages.sh
lighttransport_log=$PWD/build/log
mkdir -p "$lighttransport_log"

output=build/bench/results
for ((i = 1; i < $#; ++i)); do
  if [ "${!i}" = --output ]; then
    ((++i))
    output=${!i}
  fi
done

lighttransport_install $lighttransport_build_packages \
  libhypre-dev libopenmpi-dev openmpi-bin libeigen3-dev python3-matplotlib || exit 1
lighttransport_build bench bench-diffusion >"$lighttransport_log/bench.log" 2>&1 || {
  tail -n 40 "$lighttransport_log/bench.log" >&2
  exit 1
}
mkdir -p "$output"
build/bench/bin/bench-diffusion --output "$output" "$@" | tee "$output/bench-diffusion.md"
code=${PIPESTATUS[0]}
/usr/bin/python3 -B Testing/Benchmarks/bench-diffusion-plots.py "$output" || code=1
exit "$code"
