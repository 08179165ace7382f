#!/usr/bin/env bash
# SPDX-FileCopyrightText: The LightTransport authors
# SPDX-License-Identifier: BSD-3-Clause
#
# Installs what is missing (Debian 12), builds with tests, and runs them all:
#   bash Testing/test.sh
# Before the tests come the format (clang-format 14), lint (clang-tidy 14) and
# sanitizer checks; these are repeated only for what changed since they passed.
# Exits with 0 if and only if everything passed; ctest's closing lines come last.

set -u
cd "$(dirname "${BASH_SOURCE[0]}")/.."
. Module/packages.sh
lighttransport_log=$PWD/build/log
mkdir -p "$lighttransport_log"

failed=()
stage() # NAME COMMAND...: a failure is remembered, and the later stages still run.
{
  local name=$1
  shift
  say "$name"
  "$@" >"$lighttransport_log/$name.log" 2>&1 && return 0
  failed+=("$name")
  grep -v '^-- ' "$lighttransport_log/$name.log" | tail -n 60
  echo "error: $name failed; all of its output: build/log/$name.log" >&2
  return 1
}

check_format()
{
  local files
  # An unpacked archive has no git to ask.
  files=$(git -c safe.directory='*' ls-files '*.h' '*.cxx' 2>/dev/null) && [ -n "$files" ] ||
    files=$(find Filters Rendering Module Testing Examples -name '*.h' -o -name '*.cxx')
  clang-format-14 --dry-run -Werror $files
}

lighttransport_install $lighttransport_build_packages $lighttransport_test_packages || exit 1

stage format check_format
stage build lighttransport_build dev || exit 1
stage tidy cmake --build build/dev --target tidy -- -k 0
stage asan lighttransport_build asan check-Core check-Filters
stage tsan lighttransport_build tsan check-Core

say "ctest"
ctest --test-dir build/dev -j 2 --output-on-failure --no-tests=error \
  -LE '^(long|benchmark)$' >"$lighttransport_log/ctest.log" 2>&1 || failed+=(ctest)
# All of a failing test's output, then the summary.
if [[ " ${failed[*]-} " == *" ctest "* ]]; then
  cat "$lighttransport_log/ctest.log"
fi

if [ ${#failed[@]} -gt 0 ]; then say "failed: ${failed[*]}"; else say "all passed"; fi
sed -n '/tests passed/,$p' "$lighttransport_log/ctest.log"
[ ${#failed[@]} -eq 0 ]
