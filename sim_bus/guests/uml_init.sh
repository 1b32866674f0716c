#!/bin/sh
# First process of the User Mode Linux guest, whose root already is the host's tree, read-only.
export PATH=/usr/local/sbin:/usr/local/bin:/usr/sbin:/usr/bin:/sbin:/bin
# A page fault takes 0.15 ms here, 19 ms for a copy of one picture: what was freed is kept.
export MALLOC_MMAP_THRESHOLD_=33000000 MALLOC_TRIM_THRESHOLD_=33000000 MALLOC_TOP_PAD_=4000000
. "${0%/*}/guest.sh"
mount -t proc proc /proc || exit 1
mount -t tmpfs tmpfs /run || die "no tmpfs"
MODULES=/usr/lib/uml/modules/$(uname -r)/kernel
insmod "$MODULES/fs/overlayfs/overlay.ko" || die "no overlay module"
mount_out() { mount -t hostfs -o "$RIG_OUT" none "$1"; }
load_modules() {
    for module in "$@"; do
        insmod "$MODULES/$module.ko" || true
    done
}
run_over /
