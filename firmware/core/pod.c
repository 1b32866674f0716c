/* The pod's one loop body: receive, measure, report, send. */
#include "pod.h"

#include "pod_parts.h"

/* The longest rest: the watchdog wants a kick, and a received frame a quick look. */
#define REST_MAX_US 10000U
/* Without samples the watch goes its own way after this. */
#define WATCH_GRACE_US 100000U

void pod_init(pod_t *const pod, const pod_hal_t *const hal, const pod_boot_t *const boot) {
    *pod = (pod_t){.hal = hal, .boot = *boot};
    pod->boot_us = hal->now_us(hal->context);
    pod_config_default(pod);
    pod_identity_init(pod, pod->boot_us);
}

pod_state_t pod_state(const pod_t *const pod) {
    if (pod->refusal != POD_REFUSAL_NONE) {
        return POD_STATE_REFUSED;
    }
    if (pod->is_measuring) {
        return POD_STATE_RUNNING;
    }
    if (pod->imu.fault == BNO055_FAULT_BUS || pod->imu.fault == BNO055_FAULT_CHIP_ID) {
        return POD_STATE_CHIP_MISSING;
    }
    return pod->was_measuring ? POD_STATE_RECOVERING : POD_STATE_STARTING;
}

static void run_imu(pod_t *const pod, const uint64_t now_us) {
    /* The watch reads for 2 ms: right after a sample it delays none. */
    const bool may_watch = pod->has_sampled || now_us > pod->imu.watch_us + WATCH_GRACE_US;
    pod->has_sampled = false;
    pod->is_measuring = bno055_step(&pod->imu, now_us, may_watch);
    if (pod->is_measuring && !pod->was_measuring) {
        pod->was_measuring = true;
        pod->identity_us = now_us; /* once more, now with the chip's unique id */
    }
    if (pod->imu.wants_recovery) {
        pod->imu.wants_recovery = false;
        pod_count(&pod->counters.bus_recoveries);
        (void)pod->hal->imu_recover(pod->hal->context);
    }
}

static uint64_t earlier(const uint64_t a, const uint64_t b) { return a < b ? a : b; }

static uint32_t rest_us(const pod_t *const pod, const uint64_t now_us) {
    uint64_t next_us = now_us + REST_MAX_US;
    if (pod->has_sampled) {
        return 0U;
    }
    if (!pod->is_measuring) {
        next_us = earlier(next_us, pod->imu.resume_us);
    }
    if (pod->is_sampling) {
        next_us = earlier(next_us, pod->due_us);
    }
    next_us = earlier(next_us, pod->identity.has_listened ? pod->counters_us
                                                          : pod->identity.listen_until_us);
    return next_us > now_us ? (uint32_t)(next_us - now_us) : 0U;
}

uint32_t pod_step(pod_t *const pod) {
    const pod_hal_t *const hal = pod->hal;
    const uint64_t begin_us = hal->now_us(hal->context);
    pod_watch_bus(pod, begin_us);
    pod_receive(pod, begin_us);
    pod_identity_step(pod, begin_us);
    run_imu(pod, begin_us);
    pod_sample(pod, hal->now_us(hal->context));
    pod_config_finish(pod, begin_us);
    pod_report(pod, begin_us);
    pod_transmit(pod);
    hal->kick(hal->context);
    return rest_us(pod, hal->now_us(hal->context));
}
