#!/bin/busybox sh
# First process of the virtual machine, in a memory of its own: reach the host's tree, read-only.
/bin/busybox --install -s /bin
export PATH=/bin
. /guest.sh
mount -t proc proc /proc || exit 1
mount -t tmpfs tmpfs /run || die "no tmpfs"
for module in $(cat /modules.list); do
    insmod "/modules/$module" || die "no module $module"
done
mount -t 9p -o trans=virtio,version=9p2000.L,ro,cache=loose,msize=512000 host /host ||
    die "cannot reach the host's files"
mount_out() { mount -t 9p -o trans=virtio,version=9p2000.L,msize=512000 out "$1"; }
load_modules() {
    # The host's modprobe finds this kernel's modules where it looks for its own.
    mkdir -p "$R/lib/modules/$(uname -r)"
    mount -o bind "/host$RIG_MODULES" "$R/lib/modules/$(uname -r)" || die "no modules"
    chroot $R /bin/sh -c 'PATH=/usr/sbin:/sbin:/usr/bin:/bin; for m; do modprobe "$m"; done' - "$@"
}
run_over /host
