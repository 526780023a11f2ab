#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# Picture of the waveform view: GTKWave with sim/views/asi.gtkw under a virtual display, the slaves' last data opened.
# usage: screenshot.sh WAVES.fst OUT.png
# Needs gtkwave, Xvfb and ImageMagick (Debian: gtkwave xvfb imagemagick).
set -euo pipefail
waves=$1 out=$2
cd "$(dirname "$0")/.."
for program in gtkwave Xvfb import; do
  command -v "$program" >/dev/null || { echo "screenshot: $program is missing (Debian: gtkwave xvfb imagemagick)" >&2; exit 1; }
done
work=$(mktemp -d)
trap 'kill $(jobs -p) 2>/dev/null; rm -rf "$work"' EXIT
printf 'use_maxtime_display 0\nhide_sst 1\nsplash_disable 1\n' >"$work/rc"
Xvfb :87 -screen 0 1400x760x24 >/dev/null 2>&1 &
sleep 1
sed 's/^@c00200/@800200/; s/^@1401200/@1000200/' sim/views/asi.gtkw >"$work/view.gtkw"
DISPLAY=:87 gtkwave --rcfile "$work/rc" "$waves" "$work/view.gtkw" >/dev/null 2>&1 &
sleep 6
DISPLAY=:87 import -window root -trim "$out"
