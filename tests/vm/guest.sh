#!/bin/bash
# The guest's side of run.sh: the kernel's first process, which makes the root and becomes systemd ("furnish"), and what systemd
# then runs as guest.service ("run").
set -eu
export PATH=/usr/local/sbin:/usr/local/bin:/usr/sbin:/usr/bin:/sbin:/bin LANG=C.UTF-8 HOME=/root
# User-Mode Linux does not keep AVX-512 registers over a signal: string functions that do not use them.
export GLIBC_TUNABLES=glibc.cpu.hwcaps=-AVX512F_Usable,-AVX512VL_Usable,-AVX512F,-AVX512VL,-AVX512BW
job=/run/roadvec-job
modules=(/usr/lib/uml/modules/*)  # of the one kernel there is

# The fewest programs: what is read straight from the machine's root is not kept in memory; through the overlay it is.
enter_overlay() {
  mount -n -t tmpfs tmpfs /mnt
  mkdir /mnt/upper /mnt/work /mnt/root
  insmod "${modules[0]}/kernel/fs/overlayfs/overlay.ko"
  mount -n -t overlay overlay -o lowerdir=/,upperdir=/mnt/upper,workdir=/mnt/work /mnt/root
  cd /mnt/root
  mount -n --move . /
  exec chroot . "$0" furnish
}

furnish() {
  cd /
  mount -t proc proc /proc
  mount -t devtmpfs devtmpfs /dev
  mount -t sysfs sysfs /sys
  mount -t tmpfs -o mode=755 tmpfs /run
  mkdir -p "$job" /lib/modules
  mount -t hostfs none "$job" -o "$roadvec_job"
  local shared
  shared=$(<"$job/shared")
  mkdir -p "$shared"
  mount -t hostfs none "$shared" -o "$shared"
  ln -sfn "${modules[0]}" "/lib/modules/${modules[0]##*/}"
  make_units /etc/systemd/system
  rm -f /etc/fstab /.dockerenv  # the latter: systemd would take the guest for a container
  echo guest >/etc/hostname
  echo 0123456789abcdef0123456789abcdef >/etc/machine-id
  (cd "$shared" && bash -e "$job/before_boot" >>"$job/out" 2>>"$job/err")
  exec /lib/systemd/systemd
}

# Nothing that this machine has enabled, and of what comes with packages only what services lean on.
make_units() {
  rm -rf "$1" "$1-generators"
  mkdir -p "$1" "$1-generators" /etc/systemd/system.conf.d
  local unit masks=()
  for unit in /lib/systemd/system-generators/*; do masks+=("$1-generators/${unit##*/}"); done
  for unit in /lib/systemd/system/{sysinit,local-fs,timers,paths,sockets,multi-user}.target.wants/*; do
    case ${unit##*/} in
      systemd-journald* | systemd-tmpfiles-setup.service | dbus.socket) ;;
      *) masks+=("$1/${unit##*/}") ;;
    esac
  done
  for unit in systemd-remount-fs.service systemd-journal-flush.service systemd-journald-audit.socket \
    systemd-udevd{.service,-control.socket,-kernel.socket}; do
    masks+=("$1/$unit")
  done
  for unit in "${masks[@]}"; do ln -sf /dev/null "$unit"; done
  printf '[Manager]\nDefaultEnvironment=GLIBC_TUNABLES=%s\n' "$GLIBC_TUNABLES" >/etc/systemd/system.conf.d/guest.conf
  printf '[Unit]\nRequires=basic.target\nAfter=basic.target\nWants=guest.service multi-user.target\n' >"$1/default.target"
  printf '[Unit]\nAfter=basic.target\nSuccessAction=poweroff-force\nFailureAction=poweroff-force\n%s' \
    "[Service]"$'\n'"ExecStart=/bin/bash $0 run"$'\n' >"$1/guest.service"
  mkdir -p /etc/tmpfiles.d
  : >/etc/tmpfiles.d/tmp.conf  # the one that empties /tmp, where this checkout may lie
}

run_job() {
  modprobe -a vcan can_raw
  ip link set lo up
  cd "$(<"$job/shared")"
  local status=0
  bash "$job/command" </dev/null >>"$job/out" 2>>"$job/err" || status=$?
  echo "$status" >"$job/status.part"
  mv "$job/status.part" "$job/status"
}

case ${1:-} in
  furnish) furnish ;;
  run) run_job ;;
  *) enter_overlay ;;
esac
