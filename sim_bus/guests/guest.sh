# What every guest's first process does: an overlay over the host's tree, the modules, the command.
# Sourced. The host tells RIG_OUT, the only folder that is written there, on the kernel's command
# line; the one who sources defines `mount_out TARGET` and `load_modules NAME...`.
power_off() { sync; echo o >/proc/sysrq-trigger; sleep 10; }
die() { echo "guest: $*" >"${OUT:-$RIG_OUT}/guest-error" 2>/dev/null; echo "guest: $*"; power_off; }

run_over() { # LOWER: where the host's tree is
    R=/run/r
    mkdir -p /run/u /run/w $R
    mount -t overlay -o "lowerdir=$1,upperdir=/run/u,workdir=/run/w" overlay $R || die "no overlay"
    mount -t proc proc $R/proc
    mount -t sysfs sysfs $R/sys
    mount -t devtmpfs devtmpfs $R/dev
    mkdir -p $R/dev/pts $R/dev/shm
    mount -t devpts -o newinstance,ptmxmode=0666 devpts $R/dev/pts
    rm -f $R/dev/ptmx; ln -s pts/ptmx $R/dev/ptmx
    mount -t tmpfs -o mode=1777 tmpfs $R/dev/shm
    mount -t tmpfs tmpfs $R/run
    mkdir -p "$R$RIG_OUT"
    mount_out "$R$RIG_OUT" || die "cannot reach RIG_OUT"
    OUT=$R$RIG_OUT
    load_modules $(cat "$OUT/.guest/modules") 2>>"$OUT/modules.log"
    chroot $R ip link set lo up 2>/dev/null
    chroot $R /bin/sh "$RIG_OUT/.guest/command.sh" </dev/null >"$OUT/stdout" 2>"$OUT/stderr"
    echo $? >"$OUT/.guest/rc.part"
    mv "$OUT/.guest/rc.part" "$OUT/.guest/rc"
    power_off
}
