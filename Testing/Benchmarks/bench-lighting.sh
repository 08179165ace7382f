#!/usr/bin/env bash
# SPDX-FileCopyrightText: The LightTransport authors
# SPDX-License-Identifier: BSD-3-Clause
#
# bench-lighting, and VTK 9.2's own secondary rays on the same scene in the same run:
#   bash bench-lighting.sh BENCH_LIGHTING [PARAVIEW_PREFIX [FRAMES]]
# BENCH_LIGHTING is the program of the build tree (bin/bench-lighting), PARAVIEW_PREFIX the usr/ of
# Debian's unpacked ParaView 5.11 (apt-get download paraview python3-paraview; dpkg -x each into
# one folder). Without it the comparison is left out.

set -eu
bench=$1
prefix=${2-}
frames=${3-3}
here=$(cd "$(dirname "$0")" && pwd)
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
"$bench" -f "$frames" -d "$folder"
[ -n "$prefix" ] || exit 0
libraries=$(dirname "$(find "$prefix/lib" -name 'libvtkRenderingVolumeOpenGL2-pv*.so' | head -n 1)")
times=$(LD_LIBRARY_PATH=$libraries PYTHONPATH=$prefix/lib/python3/dist-packages \
  xvfb-run -a "$prefix/bin/pvpython" --force-offscreen-rendering \
  "$here/bench-lighting-paraview.py" "$folder/volume.vti" 512 "$frames" "$folder/rays.png")
echo "VTK 9.2 (ParaView): shaded ${times% *} ms, GlobalIlluminationReach 1 ${times#* } ms," \
  "against ray traced $("$bench" --psnr "$folder/rays.png" "$folder/reference.png") dB"
