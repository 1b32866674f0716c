/* A chip that answers anything: bring-up, watch and screening survive it, and no sample leaves
 * before the ids and settings have read back right.
 */
#include <stdlib.h>

#include "chip.h"

int LLVMFuzzerTestOneInput(const uint8_t *bytes, size_t size);

static const uint8_t *script;
static size_t script_size, script_at;

static uint8_t next(void) {
    return script_at < script_size ? script[script_at++] : 0U;
}

static int lie_read(uint8_t first, uint8_t *const data, uint8_t length) {
    const uint8_t kind = next();
    if (kind < 0x20U) {
        return kind < 0x10U ? POD_HOST_REFUSED : POD_HOST_TIMED_OUT;
    }
    const int result = rig_read(first, data, length);
    for (uint8_t i = 0; kind >= 0xC0U && i < length; i++) {
        data[i] = next();
    }
    return result;
}

int LLVMFuzzerTestOneInput(const uint8_t *const bytes, const size_t size) {
    static const uint8_t uid[POD_UID_BYTES] = {9};
    const pod_host_calls_t calls = {rig_now,  lie_read,  rig_write, rig_recover,
                                    rig_send, rig_store, rig_reset};
    pod_host_free(rig_pod(0U));
    script = bytes;
    script_size = size;
    script_at = 0U;
    pod_host_t *const pod = pod_host_new(&calls, 5U, uid, POD_RESET_POWER_ON, 0U);
    for (unsigned i = 0; i < 400U && script_at < script_size; i++) {
        const uint32_t rest_us = pod_host_step(pod);
        if (rig_sent_with(0x105U) != rig_sent_with(0x135U)) {
            abort();
        }
        rig.now_us += rest_us > 0U ? rest_us : 1U;
    }
    pod_host_free(pod);
    return 0;
}
