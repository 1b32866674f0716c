/* Hostile frames: whatever is malformed changes nothing in a running pod but a counter, sends
 * nothing and breaks nothing. Eleven bytes of input are a frame; the first bit decides whether its
 * check byte is made right (then it may act) or wrong (then it must not).
 */
#include <stdlib.h>

#include "chip.h"

#define FRAME_BYTES 11U
#define NODE 3U

int LLVMFuzzerTestOneInput(const uint8_t *bytes, size_t size);

static pod_host_t *running_pod(void) {
    pod_host_t *const pod = rig_pod(NODE);
    rig_run(pod, 1500000U);
    return pod;
}

/* Half the identifiers are ours: those are the ones that matter. */
static uint32_t identifier(const uint8_t *const bytes) {
    static const uint16_t ours[] = {0x080, 0x081, 0x103, 0x113, 0x123, 0x133, 0x183,
                                    0x203, 0x213, 0x283, 0x293, 0x303, 0x083, 0x202, 0x30F, 0x7FF};
    if ((bytes[0] & 0x08U) != 0U) {
        return ours[bytes[1] & 0x0FU];
    }
    return ((uint32_t)bytes[1] | ((uint32_t)bytes[2] << 8)) & 0x7FFU;
}

static void hear(pod_host_t *const pod, const uint8_t *const bytes) {
    const bool is_sound = (bytes[0] & 1U) != 0U;
    const bool is_extended = (bytes[0] & 2U) != 0U;
    const bool is_remote = (bytes[0] & 4U) != 0U;
    const uint8_t length = (uint8_t)((bytes[0] >> 4) % 9U);
    const uint32_t id = identifier(bytes);
    uint8_t data[8];
    memcpy(data, &bytes[3], 8U);
    if (length > 0U) {
        const uint8_t crc = pod_crc8_of_frame(id, data, (uint8_t)(length - 1U));
        if (is_sound) {
            data[length - 1U] = crc;
        } else if (data[length - 1U] == crc) {
            data[length - 1U] ^= 0x01U;
        }
    }
    /* What is due now must not be taken for an effect of the frame. */
    for (unsigned i = 0; i < 4U && pod_host_step(pod) == 0U; i++) {
    }
    const uint32_t before = pod_host_digest(pod);
    const unsigned sent = rig.sent_count;
    (void)pod_host_receive(pod, id, is_extended, is_remote, data, length, rig.now_us);
    (void)pod_host_step(pod);
    if (!is_sound && (pod_host_digest(pod) != before || rig.sent_count != sent)) {
        abort();
    }
}

int LLVMFuzzerTestOneInput(const uint8_t *const bytes, const size_t size) {
    static pod_host_t *pod;
    if (pod == NULL || pod_host_refusal(pod) != POD_REFUSAL_NONE || rig.now_us > 60000000U) {
        pod_host_free(pod);
        pod = running_pod();
    }
    for (size_t at = 0; at + FRAME_BYTES <= size; at += FRAME_BYTES) {
        hear(pod, &bytes[at]);
    }
    /* Time goes on between inputs, so that accepted settings take their course. */
    rig.sent_count = 0U;
    rig_run(pod, 20000U);
    return 0;
}
