#include "pod_host.h"

#include <stdlib.h>
#include <string.h>

struct pod_host {
    pod_t pod;
    pod_hal_t hal;
    pod_boot_t boot;
    pod_host_calls_t calls;
    pod_frame_t received[POD_HOST_RECEIVE_FRAMES];
    uint8_t first;
    uint8_t count;
    int last_access;
    uint16_t lost;
    bool is_bus_off;
    uint32_t kicks;
};

static uint64_t now_us(void *const context) {
    const pod_host_t *const host = context;
    return host->calls.now_us();
}

static bool imu_read(void *const context, const uint8_t first, uint8_t *const data,
                     const uint8_t length) {
    pod_host_t *const host = context;
    host->last_access = host->calls.imu_read(first, data, length);
    return host->last_access == POD_HOST_DONE;
}

static bool imu_write(void *const context, const uint8_t target, const uint8_t value) {
    pod_host_t *const host = context;
    host->last_access = host->calls.imu_write(target, value);
    return host->last_access == POD_HOST_DONE;
}

static bool imu_timed_out(void *const context) {
    const pod_host_t *const host = context;
    return host->last_access == POD_HOST_TIMED_OUT;
}

static bool imu_is_ready(void *const context) {
    (void)context;
    return true;
}

static bool imu_recover(void *const context) {
    const pod_host_t *const host = context;
    return host->calls.imu_recover() == POD_HOST_DONE;
}

static bool can_send(void *const context, const uint8_t mailbox, const pod_frame_t *const frame) {
    const pod_host_t *const host = context;
    return !host->is_bus_off &&
           host->calls.can_send(mailbox, frame->id, frame->data, frame->length) == POD_HOST_DONE;
}

static bool can_receive(void *const context, pod_frame_t *const frame) {
    pod_host_t *const host = context;
    if (host->count == 0U) {
        return false;
    }
    *frame = host->received[host->first];
    host->first = (uint8_t)((host->first + 1U) % POD_HOST_RECEIVE_FRAMES);
    host->count--;
    return true;
}

static uint16_t can_lost(void *const context) {
    const pod_host_t *const host = context;
    return host->lost;
}

static bool can_is_bus_off(void *const context) {
    const pod_host_t *const host = context;
    return host->is_bus_off;
}

static void can_restart(void *const context) {
    pod_host_t *const host = context;
    host->is_bus_off = false;
}

static bool store_node(void *const context, const uint8_t node) {
    const pod_host_t *const host = context;
    return host->calls.store_node(node) == POD_HOST_DONE;
}

static void kick(void *const context) {
    pod_host_t *const host = context;
    host->kicks++;
}

static void reset(void *const context) {
    const pod_host_t *const host = context;
    host->calls.reset();
}

pod_host_t *pod_host_new(const pod_host_calls_t *const calls, const uint8_t node,
                         const uint8_t *const uid, const uint8_t reset_cause,
                         const uint16_t watchdog_resets) {
    pod_host_t *const host = calloc(1, sizeof *host);
    if (host == NULL) {
        return NULL;
    }
    host->calls = *calls;
    host->hal = (pod_hal_t){
        .context = host,
        .now_us = now_us,
        .imu = {.context = host,
                .read = imu_read,
                .write = imu_write,
                .timed_out = imu_timed_out,
                .is_ready = imu_is_ready,
                .now_us = now_us},
        .imu_recover = imu_recover,
        .can_send = can_send,
        .can_receive = can_receive,
        .can_lost = can_lost,
        .can_is_bus_off = can_is_bus_off,
        .can_restart = can_restart,
        .store_node = store_node,
        .kick = kick,
        .reset = reset,
    };
    memcpy(host->boot.uid, uid, POD_UID_BYTES);
    pod_host_restart(host, node, reset_cause, watchdog_resets);
    return host;
}

void pod_host_free(pod_host_t *const host) { free(host); }

void pod_host_restart(pod_host_t *const host, const uint8_t node, const uint8_t reset_cause,
                      const uint16_t watchdog_resets) {
    host->boot.node = node;
    host->boot.reset_cause = (pod_reset_cause_t)reset_cause;
    host->boot.watchdog_resets = watchdog_resets;
    host->count = 0U;
    host->lost = 0U;
    host->is_bus_off = false;
    pod_init(&host->pod, &host->hal, &host->boot);
}

bool pod_host_receive(pod_host_t *const host, const uint32_t id, const bool is_extended,
                      const bool is_remote, const uint8_t *const data, const uint8_t length,
                      const uint64_t received_us) {
    if (host->count == POD_HOST_RECEIVE_FRAMES || length > POD_FRAME_BYTES) {
        host->lost++;
        return false;
    }
    pod_frame_t *const frame =
        &host->received[(host->first + host->count) % POD_HOST_RECEIVE_FRAMES];
    *frame = (pod_frame_t){.id = id,
                           .is_extended = is_extended,
                           .is_remote = is_remote,
                           .length = length,
                           .received_us = received_us};
    if (length > 0U && data != NULL) {
        memcpy(frame->data, data, length);
    }
    host->count++;
    return true;
}

void pod_host_set_bus_off(pod_host_t *const host, const bool is_bus_off) {
    host->is_bus_off = is_bus_off;
}

bool pod_host_is_bus_off(const pod_host_t *const host) { return host->is_bus_off; }

uint32_t pod_host_step(pod_host_t *const host) { return pod_step(&host->pod); }

uint8_t pod_host_state(const pod_host_t *const host) { return (uint8_t)pod_state(&host->pod); }

uint8_t pod_host_refusal(const pod_host_t *const host) { return (uint8_t)host->pod.refusal; }

uint64_t pod_host_master_us(const pod_host_t *const host, const uint64_t local_us) {
    return pod_clock_master_us(&host->pod.clock, local_us);
}

bool pod_host_is_synced(const pod_host_t *const host) {
    return pod_clock_is_synced(&host->pod.clock, host->calls.now_us());
}

uint32_t pod_host_kicks(const pod_host_t *const host) { return host->kicks; }

uint32_t pod_host_digest(const pod_host_t *const host) {
    pod_t pod;
    memcpy(&pod, &host->pod, sizeof pod);
    memset(&pod.counters, 0, sizeof pod.counters);
    const uint8_t *const bytes = (const uint8_t *)&pod;
    uint32_t digest = 2166136261U; /* FNV-1a */
    for (size_t i = 0; i < sizeof pod; i++) {
        digest = (digest ^ bytes[i]) * 16777619U;
    }
    return digest;
}
