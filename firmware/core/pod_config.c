/* Configuration requests. What touches the chip is answered once the chip has read it back. */
#include "../gen/pod_dbc.h"
#include "pod_config_keys.h"
#include "pod_parts.h"

#define RESET_MAGIC 0x52535421U
#define RATE_MAX_HZ 200U
#define SETTLE_US 3000000U
#define RESET_DELAY_US 20000U

typedef enum {
    RESULT_DONE,
    RESULT_UNKNOWN_KEY,
    RESULT_RANGE,
    RESULT_OTHER_VALUE,
    RESULT_BUSY,
    RESULT_NOT_NOW,
    RESULT_LATER /* not on the wire: the chip answers first */
} result_t;
_Static_assert(RESULT_NOT_NOW == POD_DBC_CONFIG_REPLY_RESULT_NOT_NOW_CHOICE, "as in pod.dbc");

void pod_config_default(pod_t *const pod) {
    const bno055_settings_t settings = {.mode = BNO055_MODE_AMG, .range = 0U, .bandwidth = 7U};
    pod->sampling = (pod_sampling_t){.rate_hz = 100U};
    bno055_init(&pod->imu, &pod->hal->imu, &settings);
}

static void reply(pod_t *const pod, const uint8_t token, const uint8_t key, const uint32_t value,
                  const result_t result) {
    const struct pod_dbc_config_reply_t answer = {
        .token = token, .key = key, .value = value, .result = (uint8_t)result};
    uint8_t payload[POD_DBC_CONFIG_REPLY_LENGTH];
    (void)pod_dbc_config_reply_pack(payload, &answer, sizeof payload);
    pod_queue_frame(pod, POD_MAILBOX_REPLY, POD_DBC_CONFIG_REPLY_FRAME_ID, payload,
                    (uint8_t)sizeof payload);
    if (result != RESULT_DONE) {
        pod_count(&pod->counters.config_refused);
    }
}

static result_t set_chip(pod_t *const pod, const uint8_t key, const uint32_t value,
                         const uint64_t now_us) {
    bno055_settings_t settings = pod->imu.settings;
    if (!pod_config_change(&settings, key, value)) {
        return RESULT_RANGE;
    }
    /* The fusion modes hold range and bandwidth themselves (data sheet Table 3-14). */
    if (key != KEY_MODE && key != KEY_CRYSTAL && bno055_is_fusion(settings.mode)) {
        return RESULT_NOT_NOW;
    }
    if (pod_config_is_equal(&settings, &pod->imu.settings) && pod->is_measuring) {
        return RESULT_DONE;
    }
    bno055_configure(&pod->imu, &settings, now_us);
    pod->is_measuring = false;
    return RESULT_LATER;
}

static result_t set_rate(pod_t *const pod, const uint32_t value, const uint64_t now_us) {
    if (value < 1U || value > RATE_MAX_HZ) {
        return RESULT_RANGE;
    }
    pod->sampling.rate_hz = (uint16_t)value;
    pod->due_us = now_us + pod_period_us(pod);
    return RESULT_DONE;
}

static result_t store_node(const pod_t *const pod, const uint32_t value) {
    if (value >= POD_NODES) {
        return RESULT_RANGE;
    }
    return pod->hal->store_node(pod->hal->context, (uint8_t)value) ? RESULT_DONE
                                                                   : RESULT_OTHER_VALUE;
}

static result_t set_flags(pod_t *const pod, const uint8_t key, const uint32_t value) {
    if (value > (key == KEY_STREAMS ? POD_STREAM_ACCEL | POD_STREAM_MAG : 1U)) {
        return RESULT_RANGE;
    }
    if (key == KEY_STREAMS) {
        pod->sampling.streams = (uint8_t)value;
    } else {
        pod->sampling.is_triggered = value == 1U;
    }
    return RESULT_DONE;
}

static result_t apply(pod_t *const pod, const uint8_t key, const uint32_t value,
                      const uint64_t now_us) {
    switch (key) {
    case KEY_RATE_HZ:
        return set_rate(pod, value, now_us);
    case KEY_RANGE_DPS:
    case KEY_BANDWIDTH_HZ:
    case KEY_MODE:
    case KEY_CRYSTAL:
        return set_chip(pod, key, value, now_us);
    case KEY_STREAMS:
    case KEY_SAMPLING:
        return set_flags(pod, key, value);
    case KEY_NODE:
        return store_node(pod, value);
    case KEY_RESET:
        return value == RESET_MAGIC ? RESULT_LATER : RESULT_RANGE;
    case KEY_IDENTIFY:
        pod_announce(pod);
        return RESULT_DONE;
    default:
        return RESULT_UNKNOWN_KEY;
    }
}

/* A refused pod accepts a new number, a request for its identity, and a reset; nothing else. */
static bool is_allowed(const pod_t *const pod, const uint8_t key) {
    return pod->refusal == POD_REFUSAL_NONE || key == KEY_RESET || key == KEY_IDENTIFY ||
           (key == KEY_NODE && pod->refusal == POD_REFUSAL_NO_NODE);
}

void pod_config_request(pod_t *const pod, const pod_frame_t *const frame, const uint64_t now_us) {
    struct pod_dbc_config_request_t request;
    (void)pod_dbc_config_request_unpack(&request, frame->data, frame->length);
    if (pod->refusal == POD_REFUSAL_DUPLICATE) {
        return; /* the request is for the rightful owner, who answers it */
    }
    const pod_pending_t *const pending = &pod->pending;
    if (pending->is_pending && pending->token == request.token && pending->key == request.key) {
        return; /* asked again: the answer comes when the chip has given it */
    }
    result_t result = RESULT_NOT_NOW;
    if (pending->is_pending) {
        result = RESULT_BUSY;
    } else if (is_allowed(pod, request.key)) {
        result = apply(pod, request.key, request.value, now_us);
    }
    if (result == RESULT_LATER) {
        const uint32_t delay_us = request.key == KEY_RESET ? RESET_DELAY_US : SETTLE_US;
        pod->pending = (pod_pending_t){.is_pending = true,
                                       .token = request.token,
                                       .key = request.key,
                                       .value = request.value,
                                       .deadline_us = now_us + delay_us};
        result = request.key == KEY_RESET ? RESULT_DONE : RESULT_LATER;
    }
    if (result != RESULT_LATER) {
        reply(pod, request.token, request.key, request.value, result);
    }
}

void pod_config_finish(pod_t *const pod, const uint64_t now_us) {
    pod_pending_t *const pending = &pod->pending;
    const bool is_over = now_us >= pending->deadline_us;
    if (!pending->is_pending) {
        return;
    }
    if (pending->key == KEY_RESET) {
        if (is_over) {
            pending->is_pending = false;
            pod->hal->reset(pod->hal->context);
        }
    } else if (pod->is_measuring || is_over) {
        const bool is_refused = pod->imu.fault == BNO055_FAULT_VERIFY;
        const result_t failure = is_refused ? RESULT_OTHER_VALUE : RESULT_NOT_NOW;
        pending->is_pending = false;
        reply(pod, pending->token, pending->key, pending->value,
              pod->is_measuring ? RESULT_DONE : failure);
    }
}
