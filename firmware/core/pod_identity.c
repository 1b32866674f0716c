/* Node number and layout: two pods with one number, or a master with another layout, are
 * refused, and the refusal goes out in the Identity frame.
 *
 * A pod listens before it speaks. Whoever already runs keeps the number; of two that run, the one
 * with the higher microcontroller id gives way. A pod that says it is refused takes no number from
 * anyone, whatever its id. Announcements are spread by that id, since equal identifiers with
 * different data break each other on the bus.
 */
#include "../gen/pod_dbc.h"
#include "pod_parts.h"

/* Longer than the 200 ms between two Counters frames, which every living pod sends. */
#define LISTEN_US 300000U
#define SPREAD_STEP_US 1000U
#define SPREAD_MASK 0x3FU
#define ANSWER_PAUSE_US 500000U
/* The id follows its Identity 0 at once; the lowest priority of a full bus may take this long. */
#define ANNOUNCEMENT_US 500000U
/* One damaged frame must not silence a flying pod, nor bring a wrong one back. */
#define LAYOUT_AGREE 3U
#define NODE_FALLBACK 15U
#define UID_PARTS 2U

uint8_t pod_wire_node(const pod_t *const pod) {
    return pod->boot.node < POD_NODES ? pod->boot.node : NODE_FALLBACK;
}

void pod_identity_init(pod_t *const pod, const uint64_t now_us) {
    uint8_t mixed = 0U;
    for (uint8_t i = 0; i < POD_UID_BYTES; i++) {
        mixed = (uint8_t)((uint8_t)(mixed << 1) ^ (mixed >> 7) ^ pod->boot.uid[i]);
    }
    pod->identity.listen_until_us = now_us + LISTEN_US + (mixed & SPREAD_MASK) * SPREAD_STEP_US;
    if (pod->boot.node >= POD_NODES) {
        pod->refusal = POD_REFUSAL_NO_NODE;
    }
}

void pod_identity_step(pod_t *const pod, const uint64_t now_us) {
    if (!pod->identity.has_listened && now_us >= pod->identity.listen_until_us) {
        pod->identity.has_listened = true;
        pod->identity_us = now_us;
        pod->counters_us = now_us;
        pod->status_us = now_us;
    }
}

static void give_way(pod_t *const pod) {
    if (pod->refusal == POD_REFUSAL_NONE) {
        pod->refusal = POD_REFUSAL_DUPLICATE;
        pod_drop_data(pod);
        pod_announce(pod);
    }
}

/* True when an id that a running pod announced is lower than ours. */
static bool other_goes_first(pod_t *const pod, const struct pod_dbc_identity_t *const identity) {
    if (identity->part == 1U) {
        const uint64_t own = pod_uid_part(pod, 0U);
        pod->identity.same_uid_part = identity->mcu_uid_0_5 == own ? 1U : 0U;
        return identity->mcu_uid_0_5 < own;
    }
    if (identity->part == UID_PARTS && pod->identity.same_uid_part != 0U) {
        pod->identity.same_uid_part = 0U;
        return identity->mcu_uid_6_11 < pod_uid_part(pod, 1U);
    }
    return false;
}

/* Whether this part of an announcement is a running pod's. Part 0 says so for those that follow;
 * while a refused pod announces, no part is used, since its sender is not known. */
static bool is_claim(pod_identity_t *const own, const struct pod_dbc_identity_t *const identity,
                     const uint64_t now_us) {
    if (identity->part == 0U && identity->refusal != POD_DBC_IDENTITY_REFUSAL_NONE_CHOICE) {
        own->refused_until_us = now_us + ANNOUNCEMENT_US;
    } else if (identity->part == 0U) {
        own->claim_until_us = now_us + ANNOUNCEMENT_US;
    }
    return now_us >= own->refused_until_us && now_us < own->claim_until_us;
}

/* Frames that refused pods send too are no evidence, unless they say that the sender runs. */
static bool is_of_running(const pod_frame_t *const frame, const uint32_t base_id) {
    struct pod_dbc_status_t status;
    if (base_id == POD_DBC_STATUS_FRAME_ID) {
        (void)pod_dbc_status_unpack(&status, frame->data, frame->length);
        return status.state != POD_DBC_STATUS_STATE_REFUSED_CHOICE;
    }
    return base_id != POD_DBC_CONFIG_REPLY_FRAME_ID;
}

void pod_identity_heard_own(pod_t *const pod, const pod_frame_t *const frame,
                            const uint32_t base_id, const uint64_t now_us) {
    pod_identity_t *const own = &pod->identity;
    struct pod_dbc_identity_t identity;
    bool must_go = !own->has_listened;
    pod_count(&pod->counters.rx_bad);
    if (base_id == POD_DBC_IDENTITY_FRAME_ID) {
        (void)pod_dbc_identity_unpack(&identity, frame->data, frame->length);
        if (!is_claim(own, &identity, now_us)) {
            return;
        }
        must_go = must_go || other_goes_first(pod, &identity);
    } else if (!is_of_running(frame, base_id)) {
        return;
    }
    own->has_listened = true;
    if (must_go) {
        give_way(pod);
    } else if (pod->refusal == POD_REFUSAL_NONE && now_us >= own->answer_after_us) {
        own->answer_after_us = now_us + ANSWER_PAUSE_US;
        pod_announce(pod);
    }
}

static void count_agreement(uint8_t *const agreeing, uint8_t *const others) {
    *others = 0U;
    if (*agreeing < LAYOUT_AGREE) {
        (*agreeing)++;
    }
}

void pod_identity_layout(pod_t *const pod, const uint8_t layout) {
    pod_identity_t *const identity = &pod->identity;
    if (layout == POD_LAYOUT_VERSION) {
        count_agreement(&identity->right_layouts, &identity->wrong_layouts);
    } else {
        pod_count(&pod->counters.rx_bad);
        count_agreement(&identity->wrong_layouts, &identity->right_layouts);
    }
    if (pod->refusal == POD_REFUSAL_NONE && identity->wrong_layouts == LAYOUT_AGREE) {
        pod->refusal = POD_REFUSAL_LAYOUT;
        pod_drop_data(pod);
        pod_announce(pod);
    } else if (pod->refusal == POD_REFUSAL_LAYOUT && identity->right_layouts == LAYOUT_AGREE) {
        pod->refusal = POD_REFUSAL_NONE;
        pod_announce(pod);
    }
}
