#include "pod_clock.h"

#define PPB 1000000000LL
/* Shortest and longest pair distance that says something about drift, and its averaging. */
#define DRIFT_MIN_US 50000
#define DRIFT_MAX_US 10000000
#define DRIFT_SHARE 4
#define DRIFT_SPAN_US 100000000

static int32_t clamp(const int64_t value, const int32_t limit) {
    if (value > limit) {
        return limit;
    }
    return value < -limit ? -limit : (int32_t)value;
}

void pod_clock_sync(pod_clock_t *const clock, const uint8_t seq, const uint64_t local_us) {
    clock->has_sync = true;
    clock->sync_seq = seq;
    clock->sync_local_us = local_us;
}

uint64_t pod_clock_master_us(const pod_clock_t *const clock, const uint64_t local_us) {
    const int64_t since_us = (int64_t)(local_us - clock->anchor_local_us);
    /* Beyond that the drift says nothing, and the product must not overflow. */
    const int64_t drift_us = clamp(since_us, DRIFT_SPAN_US) * (int64_t)clock->drift_ppb / PPB;
    return clock->anchor_master_us + (uint64_t)(since_us + drift_us);
}

bool pod_clock_is_synced(const pod_clock_t *const clock, const uint64_t now_us) {
    return clock->pairs >= 2U && now_us - clock->anchor_local_us <= POD_CLOCK_VALID_US;
}

static void learn_drift(pod_clock_t *const clock, const int64_t error_us) {
    const int64_t since_us = (int64_t)(clock->sync_local_us - clock->anchor_local_us);
    if (since_us < DRIFT_MIN_US || since_us > DRIFT_MAX_US) {
        return;
    }
    /* The second pair is the first look at the drift and counts in full. */
    const int64_t share = clock->pairs < 2U ? 1 : DRIFT_SHARE;
    const int64_t change_ppb = error_us * PPB / (since_us * share);
    clock->drift_ppb = clamp(clock->drift_ppb + change_ppb, POD_CLOCK_DRIFT_MAX_PPB);
}

bool pod_clock_follow_up(pod_clock_t *const clock, const uint8_t seq, const uint64_t master_us,
                         const uint64_t now_us) {
    if (!clock->has_sync || clock->sync_seq != seq ||
        now_us - clock->sync_local_us > POD_CLOCK_PAIR_US) {
        return false;
    }
    clock->has_sync = false;
    const int64_t error_us =
        (int64_t)(master_us - pod_clock_master_us(clock, clock->sync_local_us));
    const bool is_old = now_us - clock->anchor_local_us > 2U * POD_CLOCK_VALID_US;
    /* The first pair only places the clock; a step starts over. */
    if (clock->pairs == 0U || is_old || error_us > POD_CLOCK_STEP_US ||
        error_us < -POD_CLOCK_STEP_US) {
        clock->pairs = 1U;
        clock->drift_ppb = 0;
        clock->error_us = POD_CLOCK_UNSYNCED;
    } else {
        learn_drift(clock, error_us);
        clock->pairs = 2U;
        clock->error_us = (int16_t)clamp(error_us, INT16_MAX);
    }
    clock->anchor_local_us = clock->sync_local_us;
    clock->anchor_master_us = master_us;
    return true;
}
