#!/usr/bin/env bash
# SPDX-FileCopyrightText: The LightTransport authors
# SPDX-License-Identifier: BSD-3-Clause
#
# Measures the diffusion solver against its floor and its competitors (Debian 12):
#   bash Testing/Benchmarks/bench-diffusion.sh [--all] [--quick] [--sizes 64,128] ...
# Installs what only the benchmark needs (hypre with MPI, Eigen, matplotlib), builds
# in build/bench, runs bench-diffusion with the options given (see BenchDiffusion.cxx),
# and leaves bench-diffusion.md, *.csv and *.png in build/bench/results, or where
# --output says; what is there when it is interrupted is drawn. 40 minutes and 16 GB of
# memory on an idle machine (--limit SECONDS: less); --quick: half a minute.
# --all: then also the error against time of the filter's other knobs (grid, region,
# precision, target; bench-frugal.sh --sections knobs), two minutes more.

set -u
cd "$(dirname "${BASH_SOURCE[0]}")/../.."
. Module/packages.sh
lighttransport_log=$PWD/build/log
mkdir -p "$lighttransport_log"

output=build/bench/results
all=0
options=()
while (($#)); do
  case $1 in
    --all) all=1 ;;
    --output)
      output=${2:?a folder after --output}
      shift
      ;;
    *) options+=("$1") ;;
  esac
  shift
done

lighttransport_install $lighttransport_build_packages \
  libhypre-dev libopenmpi-dev openmpi-bin libeigen3-dev python3-matplotlib || exit 1
lighttransport_build bench bench-diffusion >"$lighttransport_log/bench.log" 2>&1 || {
  tail -n 40 "$lighttransport_log/bench.log" >&2
  exit 1
}
mkdir -p "$output"
trap : INT # ends the program; what it has measured is drawn
build/bench/bin/bench-diffusion --output "$output" ${options[@]+"${options[@]}"} |
  tee -i "$output/bench-diffusion.md"
code=${PIPESTATUS[0]}
/usr/bin/python3 -B Testing/Benchmarks/bench-diffusion-plots.py "$output" || code=1
if ((all)); then
  bash Testing/Benchmarks/bench-frugal.sh --output "$output" --sections knobs || code=1
fi
exit "$code"
