#!/usr/bin/env bash
# SPDX-FileCopyrightText: The LightTransport authors
# SPDX-License-Identifier: BSD-3-Clause
#
# Lights volumes from outside: VTK's own shading, with shadows, and in a studio, by the same lights:
#   bash lighting-gallery.sh LIGHT_VOLUME DATA FOLDER
# DATA has thorax_ct.vti, engine.nii.gz, bonsai.nii.gz and f3_crop.sgy, or some of them; the MR head
# is that of Debian's mricron-data. Makes FOLDER/NAME-shaded.png, -shadows.png, -environment.png.

set -eu
light_volume=$1
data=$2
gallery=$3
mkdir -p "$gallery/runs"

# run NAME FILE OPTION...
run()
{
  local name=$1 file=$2
  shift 2
  [ -e "$file" ] || {
    echo "no $file: $name left out"
    return 0
  }
  "$light_volume" "$file" --out "$gallery/runs/$name" --files none --size 300x300 \
    --pictures shaded,shadows,environment --title " " "$@" >"$gallery/runs/$name.log" || {
    cat "$gallery/runs/$name.log" >&2
    echo "error: light-volume failed in the run '$name'" >&2
    return 1
  }
  for kind in shaded shadows environment; do
    cp "$gallery/runs/$name/$kind.png" "$gallery/$name-$kind.png"
  done
}

run head /usr/share/mricron/templates/ch2.nii.gz --camera 40,12,1.1 \
  --tf 28:0:8c5a4a,50:.15:b98468,80:.5:dbb49a,150:.8:f2e6da
run thorax "$data/thorax_ct.vti" --camera 165,8,1.25 --up -z \
  --tf 98:0:7a2a1c,108:.03:9b4630,125:.12:c06a4a,150:.3:e0b890,170:.7:f2e8d0,255:.9:fffbef
run engine "$data/engine.nii.gz" --camera 130,25,1.15 \
  --tf 40:0:b0a79c,75:.1:c4bbb0,150:.2:cfc6ba,180:.9:e2925c
run bonsai "$data/bonsai.nii.gz" --camera 20,12,1.15 \
  --tf 28:0:5d8a34,40:.3:7eb04a,70:.5:8d9a50,90:.6:aa835d,200:.8:d9b38f
run seismic "$data/f3_crop.sgy" --camera 35,25,1 --shadow-strength .5
