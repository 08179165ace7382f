#!/usr/bin/env bash
# SPDX-FileCopyrightText: The LightTransport authors
# SPDX-License-Identifier: BSD-3-Clause
#
# Sourced by Testing/test.sh and Examples/demo.sh: the Debian packages that the
# project needs, once, and how a script installs the missing ones and builds.

# To build the libraries, the Python package and the programs.
lighttransport_build_packages="
  ca-certificates cmake ninja-build g++
  libvtk9-dev python3-vtk9 python3-numpy
  libegl-dev libegl1 libgl1-mesa-dri
  libopenvdb-dev libboost-iostreams-dev libglm-dev
  libsegyio-dev libvtk-dicom-dev"

# To check them as well: formats, lints, and an X server without a screen.
lighttransport_test_packages="git clang-format-14 clang-tidy-14 xvfb"

# What the demo lights: an MR head.
lighttransport_demo_packages="mricron-data"

lighttransport_start=$SECONDS
say() { printf '== %4d s  %s\n' $((SECONDS - lighttransport_start)) "$*"; }

# lighttransport_install PACKAGE...: apt is asked only for what dpkg does not
# know as installed, so that a second run needs neither network nor root.
lighttransport_install()
{
  local package missing=() as_root=()
  for package in "$@"; do
    [ "$(dpkg-query -W -f '${db:Status-Status}' "$package" 2>/dev/null)" = installed ] ||
      missing+=("$package")
  done
  [ ${#missing[@]} -gt 0 ] || return 0
  if [ "$(id -u)" -ne 0 ]; then
    command -v sudo >/dev/null || {
      echo "error: not root and no sudo; install by hand: ${missing[*]}" >&2
      return 1
    }
    as_root=(sudo)
  fi
  say "apt installs: ${missing[*]}"
  local apt=("${as_root[@]}" env DEBIAN_FRONTEND=noninteractive apt-get -o DPkg::Lock::Timeout=120)
  "${apt[@]}" update -qq || return 1
  "${apt[@]}" install -y -qq --no-install-recommends "${missing[@]}" >"$lighttransport_log/apt.log" 2>&1 || {
    tail -n 20 "$lighttransport_log/apt.log" >&2
    echo "error: apt-get could not install ${missing[*]}" >&2
    return 1
  }
}

# lighttransport_build PRESET [TARGET...]: configures (only where the build
# folder has no build system yet; later ninja itself sees to that), then builds.
lighttransport_build()
{
  local preset=$1
  shift
  [ -f "build/$preset/build.ninja" ] || cmake --preset "$preset" || return 1
  cmake --build "build/$preset" ${1:+--target "$@"}
}
