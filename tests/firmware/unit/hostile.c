/* The proof on hostile frames: every identifier with every length, then two million random frames,
 * none with a right check byte. After each the pod's state, less its counters, is what it was, and
 * nothing was sent; what concerned it was counted.
 */
#include <stdio.h>
#include <stdlib.h>

#include "chip.h"

#define NODE 3U
#define FRAMES 2000000UL
#define IDENTIFIERS 0x800U
#define NEAR_BITS 0x0FU

static uint64_t random_state = 88172645463325252ULL;

static uint64_t random64(void) { /* xorshift64, Marsaglia 2003 */
    random_state ^= random_state << 13;
    random_state ^= random_state >> 7;
    random_state ^= random_state << 17;
    return random_state;
}

static void expect_nothing(pod_host_t *const pod, const uint32_t digest, const uint32_t id,
                           const uint8_t length) {
    if (pod_host_digest(pod) != digest || rig.sent_count != 0U) {
        printf("frame 0x%03X of %u bytes changed the pod\n", id, length);
        exit(1);
    }
}

static void hear(pod_host_t *const pod, const uint32_t id, const uint8_t length,
                 const uint64_t payload, const bool is_extended, const bool is_remote) {
    uint8_t data[8];
    memcpy(data, &payload, 8U);
    if (length > 0U && data[length - 1U] == pod_crc8_of_frame(id, data, (uint8_t)(length - 1U))) {
        data[length - 1U] ^= 0x80U;
    }
    (void)pod_host_receive(pod, id, is_extended, is_remote, data, length, rig.now_us);
    (void)pod_host_step(pod);
}

static uint32_t identifier(const uint64_t dice) {
    static const uint16_t bases[] = {0x080, 0x100, 0x110, 0x120, 0x130, 0x180,
                                     0x200, 0x210, 0x280, 0x290, 0x300};
    const uint32_t near = bases[dice % 11U] | ((uint32_t)(dice >> 8) & NEAR_BITS);
    return (dice & 0x10000U) != 0U ? near : (uint32_t)(dice >> 20) % IDENTIFIERS;
}

int main(void) {
    pod_host_t *const pod = rig_pod(NODE);
    rig_run(pod, 2000000U);
    for (unsigned i = 0; i < 4U; i++) {
        (void)pod_host_step(pod);
    }
    rig.sent_count = 0U;
    const uint32_t digest = pod_host_digest(pod);
    for (uint32_t id = 0; id < IDENTIFIERS; id++) {
        for (uint8_t length = 0; length <= 8U; length++) {
            hear(pod, id, length, 0U, false, false);
            hear(pod, id, length, 0U, true, false);
            hear(pod, id, length, 0U, false, true);
            expect_nothing(pod, digest, id, length);
        }
    }
    for (unsigned long i = 0; i < FRAMES; i++) {
        const uint64_t dice = random64();
        const uint32_t id = identifier(dice);
        const uint8_t length = (uint8_t)((dice >> 40) % 9U);
        hear(pod, id, length, random64(), (dice >> 50) % 16U == 0U, (dice >> 54) % 16U == 0U);
        expect_nothing(pod, digest, id, length);
    }
    /* Alive all the same: time goes on and so does sampling, and the counter page says why not. */
    rig_run(pod, 2000000U);
    const sent_t *page = NULL;
    for (unsigned i = 0; i < rig.sent_count; i++) {
        const bool is_page_2 = rig.sent[i].id == 0x290U + NODE && rig.sent[i].data[0] == 2U;
        page = is_page_2 ? &rig.sent[i] : page;
    }
    const unsigned counted = page == NULL ? 0U : page->data[5] | ((unsigned)page->data[6] << 8);
    printf("%u identifiers of every length and %lu random frames: %u counted, nothing changed\n",
           IDENTIFIERS, FRAMES, counted);
    const bool is_alive = rig_sent_with(0x100U + NODE) >= 199U && counted == 0xFFFFU;
    pod_host_free(pod);
    return is_alive ? 0 : 1;
}
