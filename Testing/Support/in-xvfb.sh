#!/bin/sh
# SPDX-FileCopyrightText: The LightTransport authors
# SPDX-License-Identifier: BSD-3-Clause
#
# sh in-xvfb.sh PROGRAM [ARGUMENT...]: runs it with the DISPLAY of an X server of its
# own, and exits as it does (125 where there is no Xvfb). The server itself takes a
# free number and says when it is ready; xvfb-run guesses both, and loses the race on
# a busy machine.
command -v Xvfb >/dev/null || exit 125
folder=$(mktemp -d) || exit 1
mkfifo "$folder/number"
Xvfb -displayfd 3 -screen 0 1280x1024x24 -nolisten tcp -noreset -ac 3>"$folder/number" \
  >"$folder/log" 2>&1 &
server=$!
trap 'kill $server 2>/dev/null; wait $server 2>/dev/null; rm -rf "$folder"' EXIT
trap 'exit 1' HUP INT TERM
if ! read -r number <"$folder/number"; then
  cat "$folder/log" >&2
  exit 1
fi
unset XAUTHORITY
DISPLAY=:$number "$@"
