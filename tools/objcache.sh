#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# usage: OBJCACHE="objcache.sh DIR", before the compiler in Verilator's makefile. Compiles Verilator's own files once
# per set of flags instead of once per test bench (10 of the 12 s of a small one); every other file as usual.
set -e
cache=$1; shift
source=${!#}
case "${source##*/}" in verilated*.cpp) ;; *) exec "$@" ;; esac
for ((i = 1; i < $#; i++)); do [ "${!i}" = -o ] && { ((i++)); object=${!i}; break; }; done
key=$(printf '%s\n' "$@" "$(stat -c %Y "$source")" | sha256sum)
hit=$cache/${key:0:16}.o
if [ ! -f "$hit" ]; then
  "$@"
  mkdir -p "$cache"
  cp "$object" "$hit.$$" && mv "$hit.$$" "$hit"  # whole or not at all: tests may run in parallel
else
  cp "$hit" "$object"
fi
