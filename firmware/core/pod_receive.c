/* Frames in: what is ours is checked for form, length and check byte before it may act. */
#include "../gen/pod_dbc.h"
#include "pod_parts.h"

/* Per step, so that a flooded bus cannot keep the pod from sampling. */
#define FRAMES_PER_STEP 8U
#define NODE_MASK 0x0FU

static void receive_sync(pod_t *const pod, const pod_frame_t *const frame) {
    struct pod_dbc_sync_t sync;
    (void)pod_dbc_sync_unpack(&sync, frame->data, frame->length);
    pod_identity_layout(pod, sync.layout);
    if (sync.layout != POD_LAYOUT_VERSION) {
        return;
    }
    pod_clock_sync(&pod->clock, sync.seq, frame->received_us);
    if (sync.trigger != 0U) {
        pod->has_trigger = true;
        pod->trigger_us = frame->received_us;
    }
    struct pod_dbc_sync_reply_t reply = {
        .seq = sync.seq,
        .t_local_us = (uint32_t)(frame->received_us & UINT32_MAX),
        .error_us = POD_CLOCK_UNSYNCED,
    };
    if (pod_clock_is_synced(&pod->clock, frame->received_us)) {
        reply.error_us = pod->clock.error_us;
    }
    uint8_t payload[POD_DBC_SYNC_REPLY_LENGTH];
    (void)pod_dbc_sync_reply_pack(payload, &reply, sizeof payload);
    if (pod->identity.has_listened && pod->refusal == POD_REFUSAL_NONE) {
        pod_queue_frame(pod, POD_MAILBOX_REPLY, POD_DBC_SYNC_REPLY_FRAME_ID, payload,
                        (uint8_t)sizeof payload);
    }
}

/* Judged at its own arrival: that may lie after the beginning of this step. */
static void receive_follow_up(pod_t *const pod, const pod_frame_t *const frame) {
    struct pod_dbc_follow_up_t follow_up;
    (void)pod_dbc_follow_up_unpack(&follow_up, frame->data, frame->length);
    if (!pod_clock_follow_up(&pod->clock, follow_up.seq, follow_up.t_sync_us,
                             frame->received_us)) {
        pod_count(&pod->counters.rx_bad);
    }
}

static uint8_t length_of_own(const uint32_t base_id) {
    switch (base_id) {
    case POD_DBC_GYRO_FRAME_ID:
    case POD_DBC_ACCEL_FRAME_ID:
    case POD_DBC_MAG_FRAME_ID:
    case POD_DBC_SYNC_REPLY_FRAME_ID:
    case POD_DBC_CONFIG_REPLY_FRAME_ID:
    case POD_DBC_STATUS_FRAME_ID:
    case POD_DBC_COUNTERS_FRAME_ID:
    case POD_DBC_IDENTITY_FRAME_ID:
        return POD_FRAME_BYTES;
    case POD_DBC_SAMPLE_FRAME_ID:
        return POD_DBC_SAMPLE_LENGTH;
    default:
        return 0U;
    }
}

/* Length that a frame with this identifier must have; 0 if it is none of our business. */
static uint8_t expected_length(const pod_t *const pod, const uint32_t id) {
    if (id == POD_DBC_SYNC_FRAME_ID) {
        return POD_DBC_SYNC_LENGTH;
    }
    if (id == POD_DBC_FOLLOW_UP_FRAME_ID) {
        return POD_DBC_FOLLOW_UP_LENGTH;
    }
    if ((id & NODE_MASK) != pod_wire_node(pod)) {
        return 0U;
    }
    const uint32_t base_id = id & ~(uint32_t)NODE_MASK;
    return base_id == POD_DBC_CONFIG_REQUEST_FRAME_ID ? POD_DBC_CONFIG_REQUEST_LENGTH
                                                      : length_of_own(base_id);
}

static void act_on(pod_t *const pod, const pod_frame_t *const frame, const uint64_t now_us) {
    const uint32_t base_id = frame->id & ~(uint32_t)NODE_MASK;
    if (frame->id == POD_DBC_SYNC_FRAME_ID) {
        receive_sync(pod, frame);
    } else if (frame->id == POD_DBC_FOLLOW_UP_FRAME_ID) {
        receive_follow_up(pod, frame);
    } else if (base_id == POD_DBC_CONFIG_REQUEST_FRAME_ID) {
        pod_config_request(pod, frame, now_us);
    } else {
        pod_identity_heard_own(pod, frame, base_id, now_us);
    }
}

void pod_receive(pod_t *const pod, const uint64_t now_us) {
    pod_frame_t frame;
    const uint16_t lost = pod->hal->can_lost(pod->hal->context);
    pod_count_many(&pod->counters.rx_bad, (uint16_t)(lost - pod->lost_seen));
    pod->lost_seen = lost;
    for (uint8_t i = 0; i < FRAMES_PER_STEP; i++) {
        if (!pod->hal->can_receive(pod->hal->context, &frame)) {
            return;
        }
        if (frame.is_extended) {
            pod_count(&pod->counters.rx_bad);
            continue;
        }
        const uint8_t length = expected_length(pod, frame.id);
        if (length == 0U) {
            continue;
        }
        if (frame.is_remote || !pod_frame_is_sound(&frame, length)) {
            pod_count(&pod->counters.rx_bad);
        } else {
            act_on(pod, &frame, now_us);
        }
    }
}
