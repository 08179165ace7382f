#!/usr/bin/env bash
# SPDX-FileCopyrightText: The LightTransport authors
# SPDX-License-Identifier: BSD-3-Clause
#
# Lights the left lateral ventricle of the MR head of Debian's mricron-data in
# seven ways and gathers the pictures:
#   bash gallery.sh LIGHT_VOLUME CH2_NII_GZ FOLDER
# Each run's own folder, with its report.json, stays below FOLDER/runs.

set -eu
light_volume=$1
head=$2
gallery=$3
mkdir -p "$gallery/runs"

# run NAME OPTION...: one run of the program, the same view for all.
run()
{
  local name=$1
  shift
  "$light_volume" "$head" --out "$gallery/runs/$name" --size 640x512 --camera 60,22,1.15 \
    --tolerance 1e-6 "$@" >"$gallery/runs/$name.log" || {
    cat "$gallery/runs/$name.log" >&2
    echo "error: light-volume failed in the run '$name'" >&2
    return 1
  }
}
keep() { cp "$gallery/runs/$1" "$gallery/$2"; }

seed=@84,126,90,2,1 # in the left lateral ventricle
edges=(--gradient-scale 3.7 --reach 40)

run ventricle --seed $seed "${edges[@]}" --albedo 0.99 --pictures plain,lit,slices,flux,arrows \
  --title "Light in the left lateral ventricle"
keep ventricle/plain.png 1-head.png
keep ventricle/lit.png 2-ventricle.png
keep ventricle/slices.png 3-ventricle-slices.png
keep ventricle/flux.png 9-flux-direction.png
keep ventricle/arrows.png 10-flux-arrows.png
keep ventricle/report.json report.json
keep ventricle/lit.nii.gz ventricle.nii.gz

run too-little --seed $seed --gradient-scale 7 --reach 0 --albedo 0.9995 --pictures lit --files none \
  --title "Too little absorption: the light leaves the ventricle"
keep too-little/lit.png 4-too-little-absorption.png

run too-much --seed $seed "${edges[@]}" --albedo 0.5 --pictures lit --files none \
  --title "Too much absorption: the light dies near its source"
keep too-much/lit.png 5-too-much-absorption.png

# By grey value alone both ventricles are one, through the gap between them.
values=(--mapping transfer --diffusion-tf 50:1,75:0 --absorption complement --reach 20
  --camera 15,50,1.15)
run leak --seed $seed "${values[@]}" --pictures lit,slices --files none \
  --title "By grey value: the light leaks into the other ventricle"
keep leak/lit.png 6-leak.png
run dam --seed $seed --seed @96,126,90,2,-0.5 "${values[@]}" --pictures lit,slices --files none \
  --title "A negative light beyond the leak dams it"
keep dam/lit.png 7-dam.png
keep dam/slices.png 7-dam-slices.png

run painted --stroke @90,150,88:@90,146,97:@90,136,104:@90,120,107:@90,104,104:@90,94,95:r=2 \
  --gradient-scale 5 --albedo 0.997 --reach 3 --pictures lit --files none \
  --title "A painted source: a stroke along the corpus callosum"
keep painted/lit.png 8-painted.png

run anisotropic --seed $seed --model anisotropic --gradient-scale 5 --steps 4 --courant 80 \
  --tolerance 1e-5 --decades 4 --pictures lit --files none --title "Anisotropic diffusion (Perona-Malik), 4 steps"
keep anisotropic/lit.png 11-anisotropic.png
