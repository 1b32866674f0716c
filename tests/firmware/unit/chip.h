/* A pod in C for the unit tests: a register-array BNO055, a clock and a list of sent frames.
 * Timing and noise are the Python chip's business; here the core runs under the sanitizers.
 */
#ifndef CHIP_H
#define CHIP_H

#include <stdbool.h>
#include <stdint.h>
#include <string.h>

#include "pod_crc.h"
#include "pod_host.h"

#define SENT_MAX 4096U

typedef struct {
    uint32_t id;
    uint8_t length;
    uint8_t data[8];
} sent_t;

static struct {
    uint64_t now_us;
    uint8_t pages[2][256];
    uint8_t page;
    uint64_t silent_until_us;
    int answer; /* of every access, unless the chip is silent */
    int refusals; /* accesses to refuse before that */
    int16_t rate[3];
    bool is_frozen;
    unsigned flips; /* bursts whose top bit is misread */
    unsigned recoveries, resets;
    int stored_node;
    bool is_store_full, is_can_busy;
    sent_t sent[SENT_MAX];
    unsigned sent_count;
} rig;

static inline uint64_t rig_now(void) { return rig.now_us; }

static inline int rig_access(void) {
    if (rig.refusals > 0) {
        rig.refusals--;
        return POD_HOST_REFUSED;
    }
    return rig.now_us < rig.silent_until_us ? POD_HOST_REFUSED : rig.answer;
}

static inline void rig_power_on(void) {
    memset(rig.pages, 0, sizeof rig.pages);
    memcpy(rig.pages[0], (const uint8_t[]){0xA0, 0xFB, 0x32, 0x0F}, 4);
    rig.pages[0][0x3B] = 0x80;
    for (unsigned i = 0; i < 16U; i++) {
        rig.pages[1][0x50 + i] = (uint8_t)(0xC0 + i);
    }
    rig.page = 0;
}

static inline int rig_read(uint8_t first, uint8_t *data, uint8_t length) {
    const int result = rig_access();
    if (result != POD_HOST_DONE) {
        return result;
    }
    if (rig.page == 0 && !rig.is_frozen && rig.pages[0][0x3D] != 0U) {
        for (unsigned axis = 0; axis < 3U; axis++) {
            rig.rate[axis] = (int16_t)(rig.rate[axis] + (int16_t)(axis + 1U));
            const uint16_t word = (uint16_t)rig.rate[axis];
            rig.pages[0][0x14 + 2U * axis] = (uint8_t)word;
            rig.pages[0][0x15 + 2U * axis] = (uint8_t)(word >> 8);
        }
    }
    for (unsigned i = 0; i < length; i++) {
        data[i] = rig.pages[rig.page][(uint8_t)(first + i)];
    }
    if (rig.flips > 0U && (first == 0x14U || first == 0x08U)) {
        rig.flips--;
        data[length - 1U] ^= 0x80U;
    }
    return POD_HOST_DONE;
}

static inline int rig_write(uint8_t target, uint8_t value) {
    const int result = rig_access();
    if (result != POD_HOST_DONE) {
        return result;
    }
    if (target == 0x07U) {
        rig.page = value & 1U;
    } else if (rig.page == 0U && target == 0x3FU && (value & 0x20U) != 0U) {
        rig_power_on();
        rig.silent_until_us = rig.now_us + 650000U;
    } else {
        rig.pages[rig.page][target] = value;
    }
    return POD_HOST_DONE;
}

static inline int rig_recover(void) {
    rig.recoveries++;
    return POD_HOST_DONE;
}

static inline int rig_send(uint8_t mailbox, uint32_t id, const uint8_t *data, uint8_t length) {
    (void)mailbox;
    if (rig.is_can_busy) {
        return POD_HOST_REFUSED;
    }
    if (rig.sent_count < SENT_MAX) {
        sent_t *const slot = &rig.sent[rig.sent_count++];
        slot->id = id;
        slot->length = length;
        memcpy(slot->data, data, length);
    }
    return POD_HOST_DONE;
}

static inline int rig_store(uint8_t node) {
    rig.stored_node = node;
    return rig.is_store_full ? POD_HOST_REFUSED : POD_HOST_DONE;
}

static inline void rig_reset(void) { rig.resets++; }

static inline pod_host_t *rig_pod(uint8_t node) {
    static const pod_host_calls_t calls = {rig_now,  rig_read,  rig_write, rig_recover,
                                           rig_send, rig_store, rig_reset};
    static const uint8_t uid[POD_UID_BYTES] = {1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12};
    memset(&rig, 0, sizeof rig);
    rig.now_us = 1000000U;
    rig.stored_node = -1;
    rig_power_on();
    return pod_host_new(&calls, node, uid, POD_RESET_POWER_ON, 0U);
}

static inline void rig_run(pod_host_t *const pod, const uint64_t duration_us) {
    const uint64_t end_us = rig.now_us + duration_us;
    while (rig.now_us < end_us) {
        const uint32_t rest_us = pod_host_step(pod);
        rig.now_us += rest_us > 0U ? rest_us : 1U;
    }
}

/* Sends a frame to the pod with its check byte put right. */
static inline void rig_hear(pod_host_t *const pod, uint32_t id, const uint8_t *body,
                            uint8_t length) {
    uint8_t data[8] = {0};
    memcpy(data, body, length - 1U);
    data[length - 1U] = pod_crc8_of_frame(id, data, (uint8_t)(length - 1U));
    (void)pod_host_receive(pod, id, false, false, data, length, rig.now_us);
    (void)pod_host_step(pod);
}

static inline unsigned rig_sent_with(uint32_t id) {
    unsigned count = 0;
    for (unsigned i = 0; i < rig.sent_count; i++) {
        count += rig.sent[i].id == id ? 1U : 0U;
    }
    return count;
}

static inline const sent_t *rig_last(uint32_t id) {
    const sent_t *found = NULL;
    for (unsigned i = 0; i < rig.sent_count; i++) {
        found = rig.sent[i].id == id ? &rig.sent[i] : found;
    }
    return found;
}

#endif
