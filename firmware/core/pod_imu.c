/* When to sample, and the frames of a sample.
 *
 * The own timer runs at the configured rate; once the pod knows the master's time it is pulled,
 * by at most 1/64 period a sample, onto whole periods of that time, so that all pods sample
 * together. In triggered mode a Sync does it, and the timer steps in when triggers stop.
 */
#include "../gen/pod_dbc.h"
#include "pod_parts.h"

#define US_PER_S 1000000U
#define LATE_US 200U
#define TRIGGER_SILENCE_US 50000U
#define PULL_SHARE 64
#define SCALE_FUSION 5U

uint32_t pod_period_us(const pod_t *const pod) { return US_PER_S / pod->sampling.rate_hz; }

static uint8_t stream_payload(uint8_t *const payload, const int16_t *const triple,
                              const uint8_t seq) {
    /* Gyro, Accel and Mag have one form (checked below), so one packer serves them all. */
    const struct pod_dbc_gyro_t frame = {
        .x = triple[0], .y = triple[1], .z = triple[2], .seq = seq};
    (void)pod_dbc_gyro_pack(payload, &frame, POD_DBC_GYRO_LENGTH);
    return POD_DBC_GYRO_LENGTH;
}

_Static_assert(POD_DBC_ACCEL_LENGTH == POD_DBC_GYRO_LENGTH, "Accel is packed as Gyro");
_Static_assert(POD_DBC_MAG_LENGTH == POD_DBC_GYRO_LENGTH, "Mag is packed as Gyro");

static void send_stream(pod_t *const pod, const uint32_t base_id, const int16_t *const triple) {
    uint8_t payload[POD_FRAME_BYTES];
    const uint8_t seq = (uint8_t)(pod->counters.samples_sent & 0xFFU);
    const uint8_t length = stream_payload(payload, triple, seq);
    pod_queue_frame(pod, POD_MAILBOX_DATA, base_id, payload, length);
}

static uint8_t live_streams(const pod_t *const pod) {
    switch (pod->imu.settings.mode) {
    case BNO055_MODE_GYRONLY:
        return 0U;
    case BNO055_MODE_IMU:
        return pod->sampling.streams & POD_STREAM_ACCEL;
    default:
        return pod->sampling.streams;
    }
}

static void send_sample(pod_t *const pod, const bno055_sample_t *const sample,
                        const uint8_t streams, const bool is_triggered, const uint64_t now_us) {
    const bool has_accel = (streams & POD_STREAM_ACCEL) != 0U;
    const bool has_mag = (streams & POD_STREAM_MAG) != 0U;
    send_stream(pod, POD_DBC_GYRO_FRAME_ID, sample->rate);
    if (has_accel) {
        send_stream(pod, POD_DBC_ACCEL_FRAME_ID, sample->force);
    }
    if (has_mag) {
        send_stream(pod, POD_DBC_MAG_FRAME_ID, sample->field);
    }
    const struct pod_dbc_sample_t closing = {
        .seq = (uint8_t)(pod->counters.samples_sent & 0xFFU),
        .scale = bno055_is_fusion(pod->imu.settings.mode) ? SCALE_FUSION : pod->imu.settings.range,
        .has_accel = has_accel ? 1U : 0U,
        .has_mag = has_mag ? 1U : 0U,
        .synced = pod_clock_is_synced(&pod->clock, now_us) ? 1U : 0U,
        .triggered = is_triggered ? 1U : 0U,
        .repeated = sample->repeated ? 1U : 0U,
        .t_local_us = (uint32_t)(sample->measured_us & 0xFFFFFFU),
    };
    uint8_t payload[POD_DBC_SAMPLE_LENGTH];
    (void)pod_dbc_sample_pack(payload, &closing, sizeof payload);
    pod_queue_frame(pod, POD_MAILBOX_DATA, POD_DBC_SAMPLE_FRAME_ID, payload,
                    (uint8_t)sizeof payload);
    pod->counters.samples_sent++;
}

static void take(pod_t *const pod, const bool is_triggered, const uint64_t now_us) {
    bno055_sample_t sample = {0};
    const uint8_t streams = live_streams(pod);
    if (!pod->is_measuring || !bno055_sample(&pod->imu, streams != 0U, &sample)) {
        pod_count(&pod->counters.sample_missed);
        return;
    }
    send_sample(pod, &sample, streams, is_triggered, now_us);
    pod->has_sampled = true;
}

/* How far after a whole period of the master's time the sample was due, signed. */
static int64_t pull_us(const pod_t *const pod, const uint64_t now_us) {
    if (!pod_clock_is_synced(&pod->clock, now_us)) {
        return 0;
    }
    const int64_t period_us = pod_period_us(pod);
    const uint64_t master_us = pod_clock_master_us(&pod->clock, pod->due_us);
    int64_t phase_us = (int64_t)(master_us % (uint64_t)period_us);
    if (phase_us > period_us / 2) {
        phase_us -= period_us;
    }
    const int64_t limit_us = period_us / PULL_SHARE;
    return phase_us > limit_us ? limit_us : (phase_us < -limit_us ? -limit_us : phase_us);
}

static void count_lateness(pod_t *const pod, const uint64_t wanted_us, const uint64_t now_us) {
    if (pod->is_measuring && now_us - wanted_us > LATE_US) {
        pod_count(&pod->counters.sample_late);
    }
}

static void run_timer(pod_t *const pod, const uint64_t now_us) {
    if (now_us < pod->due_us) {
        return;
    }
    count_lateness(pod, pod->due_us, now_us);
    take(pod, false, now_us);
    const uint32_t period_us = pod_period_us(pod);
    pod->due_us = (uint64_t)((int64_t)(pod->due_us + period_us) - pull_us(pod, now_us));
    /* What fell behind, in a long bus recovery for example, is not made up for. */
    if (now_us >= pod->due_us) {
        const uint64_t missed = (now_us - pod->due_us) / period_us + 1U;
        pod_count_many(&pod->counters.sample_missed, missed);
        pod->due_us += missed * period_us;
    }
}

void pod_sample(pod_t *const pod, const uint64_t now_us) {
    const bool may_sample =
        pod->was_measuring && pod->identity.has_listened && pod->refusal == POD_REFUSAL_NONE;
    if (may_sample && !pod->is_sampling) {
        pod->due_us = now_us;
    }
    pod->is_sampling = may_sample;
    if (!may_sample) {
        pod->has_trigger = false;
        return;
    }
    if (pod->has_trigger) {
        pod->has_trigger = false;
        if (pod->sampling.is_triggered) {
            count_lateness(pod, pod->trigger_us, now_us);
            take(pod, true, now_us);
            pod->due_us = pod->trigger_us + TRIGGER_SILENCE_US;
        }
    }
    run_timer(pod, now_us);
}
