#!/usr/bin/env bash
# Installs what is missing and checks roadvec: format, layers, build with warnings as errors, drives through the real programs
# and tests of the tools as they are shipped; unit and property tests of what runs in the car, and mutated input for every parser,
# with sanitizers; lint.
#
#   tools/test.sh            all of that, in twenty to thirty minutes on two cores
#   tools/test.sh --quick    format, build, every test as shipped (no sanitizers, mutated input or lint)
#   tools/test.sh --package  the Debian package in a fresh machine with systemd and vcan, from installing to purging (six minutes)
#   tools/test.sh --long     the tools' tests with sanitizers too, libFuzzer on every parser, clang-tidy on every source file (an
#                            hour)
#
# FUZZ_SECONDS=600 fuzzes longer (default 60 per parser). Recordings, if there are any, are looked for in ../shared/data.
set -euo pipefail
cd "$(dirname "$0")/.."
mode=${1:-}
case $mode in
  '' | --quick | --package | --long) ;;
  *)
    sed -n '2,12s/^# \{0,1\}//p' "$0"
    exit 2
    ;;
esac
fuzz_seconds=${FUZZ_SECONDS:-60}
begin=$SECONDS
say() { printf '\n== %s (%d s)\n' "$*" $((SECONDS - begin)); }

# lint FILE...: with the flags of the clang build, file by file.
lint() {
  cmake --preset fuzz -B build/lint -DCMAKE_UNITY_BUILD=OFF -DCMAKE_DISABLE_PRECOMPILE_HEADERS=ON >/dev/null
  git ls-files -z "$@" | xargs -0 -n 1 -P "$(nproc)" clang-tidy-14 -p build/lint --quiet 2>/dev/null
}

say "packages"
tools/packages.sh test

if [ "$mode" = --long ]; then
  say "build and tests: address and undefined-behaviour sanitizers"
  cmake --preset asan-ubsan >/dev/null
  cmake --build --preset asan-ubsan --target unit_tests
  # Drives through the real programs, every shipped scene driven twice and a long drive run in the release build; here they
  # would take minutes and show the same lines.
  ctest --preset asan-ubsan -j 2 -LE drive -E 'ShippedScenes|^long_drive'

  say "fuzz: $fuzz_seconds s per parser"
  cmake --preset fuzz >/dev/null
  cmake --build --preset fuzz --target fuzzers
  /usr/bin/python3 -B tests/fuzz/make_seeds.py build/fuzz/corpus
  fuzz() {
    mkdir -p "build/fuzz/corpus/$1"
    "build/fuzz/bin/$1" -max_total_time="$fuzz_seconds" -timeout=10 -rss_limit_mb=2048 -print_final_stats=0 -verbosity=0 \
      -artifact_prefix="build/fuzz/$1-" "build/fuzz/corpus/$1" >"build/fuzz/$1.log" 2>&1 && echo "$1" ||
      { tail -40 "build/fuzz/$1.log"; return 1; }
  }
  export -f fuzz
  export fuzz_seconds
  fuzzers=(build/fuzz/bin/fuzz_*)
  printf '%s\n' "${fuzzers[@]##*/}" | xargs -n 1 -P "$(nproc)" bash -c 'fuzz "$0"'

  say "lint: every source file"
  lint '*.cpp' ':!tests/bench'
  say "done"
  exit 0
fi

say "format"
git ls-files -z '*.h' '*.cpp' | xargs -0 clang-format-14 --dry-run --Werror

say "build: release"
cmake --preset release >/dev/null
case $mode in
  '') targets=(programs other_tests) ;; # those of what runs in the car come with sanitizers
  --quick) targets=(programs unit_tests) ;;
  --package) targets=(programs) ;;
esac
cmake --build --preset release --target "${targets[@]}"

if [ "$mode" = --package ]; then
  say "tests: the package"
  ctest --preset release -L package
  exit 0
fi

say "tests: release (the package's own: tools/test.sh --package)"
car='^(test_)?(core|drivers|daemon)_'
leave_out=$car
if [ "$mode" = --quick ]; then leave_out='^$'; fi
ctest --preset release -j 2 -LE package -E "$leave_out" --output-junit "$PWD/build/release/tests.xml"
passed=$(grep -c 'status="run"' build/release/tests.xml || true)
if [ "$mode" = --quick ]; then
  printf '%d passed, 0 failed\n' "$passed"
  exit 0
fi

say "build and tests: address and undefined-behaviour sanitizers, what runs in the car"
cmake --preset asan-ubsan >/dev/null
cmake --build --preset asan-ubsan --target car_tests
ctest --preset asan-ubsan -j 2 -R "$car|^fuzz[.]" --output-junit "$PWD/build/asan-ubsan/tests.xml"

say "build and tests: thread sanitizer (everything that has threads)"
cmake --preset tsan >/dev/null
cmake --build --preset tsan --target test_core_ring test_daemon_server test_daemon_stages test_daemon_store test_drivers_imu
ctest --preset tsan -j 2 -L threads --output-junit "$PWD/build/tsan/tests.xml"

say "lint: the parsers of outside bytes"
lint drivers/can/dbc.cpp drivers/can/candump_line.cpp drivers/imu/mtdata2.cpp

passed=0
for report in build/{release,asan-ubsan,tsan}/tests.xml; do
  passed=$((passed + $(grep -c 'status="run"' "$report" || true)))
done
say "done"
printf '%d passed, 0 failed\n' "$passed"
