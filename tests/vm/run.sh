#!/usr/bin/env bash
# Runs a command where there is a CAN bus and a systemd: in a throw-away guest on a kernel of its own.
#
#   tests/vm/run.sh [-c] [-r ROOT] [-b COMMAND] [-t SECONDS] [-w FOLDER] COMMAND ARGUMENT...
#
# The guest is User-Mode Linux (Debian package user-mode-linux): an ordinary process of this machine, its processor at full
# speed, no rights needed. Its root is this machine's own, seen through an overlay in memory: the same programs, libraries and
# paths, nothing to install into an image, and whatever the guest changes is gone when it ends. Only FOLDER is shared for writing.
# systemd boots with no unit of this machine enabled but those of the guest (guest.sh), then COMMAND runs as root in FOLDER.
# Its output and status come through; 124: not done within SECONDS (120), 125: the guest did not come up. -c: a CAN bus is all
# that is wanted; where this machine's own kernel has vcan, COMMAND runs straight on it, in a network of its own.
# -r: another root than this machine's, as make_root.sh makes them. -b: what runs in FOLDER, as root, before systemd is started.
#
# Traps: one processor, system calls of 20 us, timers late by 15 ms at times: let no test there assert on latency.
set -euo pipefail
here=$(cd "$(dirname "$0")" && pwd)
limit_s=120
shared=
can_alone=
root=/
before_boot=
while getopts cr:b:t:w: option; do
  case $option in
    c) can_alone=yes ;;
    r) root=$(cd "$OPTARG" && pwd) ;;
    b) before_boot=$OPTARG ;;
    t) limit_s=$OPTARG ;;
    w) shared=$OPTARG ;;
    *) sed -n '2,16s/^# \{0,1\}//p' "$0" >&2; exit 2 ;;
  esac
done
shift $((OPTIND - 1))
[ $# -gt 0 ] || { sed -n '2,16s/^# \{0,1\}//p' "$0" >&2; exit 2; }

if [ -n "$can_alone" ] && unshare -rn ip link add vcan0 type vcan 2>/dev/null; then
  cd "${shared:-.}"
  exec timeout "$limit_s" unshare -rn sh -c 'ip link set lo up && exec "$@"' sh "$@"
fi
kernel=$(command -v linux.uml) && [ -x /lib/systemd/systemd ] && command -v kmod >/dev/null || {
  echo "tests/vm/run.sh: no linux.uml, systemd or kmod: run tools/packages.sh test" >&2
  exit 125
}
work=$(mktemp -d)
guest=
stop() {
  local group
  for group in ${guest:+"$guest"} $(cat "$work/guest/pid" 2>/dev/null); do  # the kernel is a group of its own
    kill -KILL -- "-$group" 2>/dev/null || true
  done
  rm -rf "$work"
}
trap stop EXIT
trap 'exit 130' INT TERM
shared=$(cd "${shared:-$work}" && pwd)

mkdir "$work/job"
{
  export -p | grep -E ' (ROADVEC_[A-Z_]*|PYTHONPATH)=' || true
  printf '%q ' "$@"
} >"$work/job/command"
printf '%s' "$shared" >"$work/job/shared"
printf '%s\n' "$before_boot" >"$work/job/before_boot"
init=$here/guest.sh
if [ "$root" != / ]; then
  init=/guest/guest.sh
  cp "$here/guest.sh" "$root$init"
fi
: >"$work/job/out"
: >"$work/job/err"
# Kernels before 6.13 cannot give this processor's registers back where they are more than they know (AMX): xsave_area.cpp.
g++ -O1 -std=c++20 -shared -fPIC -o "$work/xsave_area.so" "$here/xsave_area.cpp"

set -m  # a process group of its own: User-Mode Linux is many processes
LD_PRELOAD=$work/xsave_area.so timeout -k 2 "$limit_s" "$kernel" mem=1G uml_dir="$work/" umid=guest \
  rootfstype=hostfs rootflags="$root" ro init="$init" roadvec_job="$work/job" \
  con=null con0=null,fd:1 con1=null ssl=null quiet panic=1 selinux=0 apparmor=0 audit=0 systemd.show_status=0 \
  </dev/null >"$work/console" 2>&1 &
guest=$!
set +m
tail -q -n +1 -s 0.1 -f --pid="$guest" "$work/job/out" &
out=$!
tail -q -n +1 -s 0.1 -f --pid="$guest" "$work/job/err" >&2 &
err=$!
ended=0
wait "$guest" || ended=$?
wait "$out" "$err" || true
[ ! -f "$work/job/status" ] || exit "$(<"$work/job/status")"
if [ "$ended" -eq 124 ] || [ "$ended" -eq 137 ]; then
  echo "tests/vm/run.sh: not done within $limit_s s" >&2
  exit 124
fi
echo "tests/vm/run.sh: the guest did not run the command; the end of its console:" >&2
head -n 40 "$work/console" >&2
exit 125
