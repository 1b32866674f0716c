/* From the queues into the controller's mailboxes, and back onto the bus after bus-off. */
#include "pod_parts.h"

/* First wait before rejoining, doubled each time up to the last: a pod that only breaks the bus
 * gets quieter. A stretch without bus-off starts over. */
#define REJOIN_FIRST_US 100000U
#define REJOIN_LAST_US 3200000U
#define REJOIN_CALM_US 10000000U
/* Rejoining takes 128 times 11 recessive bits: 3 ms on an idle bus, some 30 ms on a full one. */
#define REJOIN_GRACE_US 200000U

static bool send_first(const pod_t *const pod, const uint8_t mailbox) {
    const pod_queue_t *const queue = &pod->queues[mailbox];
    const pod_queued_t *const slot = &queue->frames[queue->first];
    pod_frame_t frame = {.id = slot->id, .length = slot->length};
    for (uint8_t i = 0; i < slot->length; i++) {
        frame.data[i] = slot->data[i];
    }
    return pod->hal->can_send(pod->hal->context, mailbox, &frame);
}

void pod_transmit(pod_t *const pod) {
    if (pod->is_bus_off) {
        return;
    }
    for (uint8_t mailbox = 0; mailbox < POD_MAILBOXES; mailbox++) {
        pod_queue_t *const queue = &pod->queues[mailbox];
        while (queue->count > 0U && send_first(pod, mailbox)) {
            queue->first = (uint8_t)((queue->first + 1U) % POD_QUEUE_FRAMES);
            queue->count--;
        }
    }
}

static void enter_bus_off(pod_t *const pod, const uint64_t now_us) {
    pod_count(&pod->counters.bus_offs);
    const bool was_calm = now_us > pod->restart_us + REJOIN_CALM_US;
    if (was_calm || pod->restart_wait_us == 0U) {
        pod->restart_wait_us = REJOIN_FIRST_US;
    } else if (pod->restart_wait_us < REJOIN_LAST_US) {
        pod->restart_wait_us *= 2U;
    }
    pod->restart_us = now_us + pod->restart_wait_us;
    pod->is_bus_off = true;
}

void pod_watch_bus(pod_t *const pod, const uint64_t now_us) {
    const pod_hal_t *const hal = pod->hal;
    if (!pod->is_bus_off) {
        const bool is_rejoining =
            pod->restart_wait_us != 0U && now_us < pod->restart_us + REJOIN_GRACE_US;
        if (!is_rejoining && hal->can_is_bus_off(hal->context)) {
            enter_bus_off(pod, now_us);
        }
    } else if (now_us >= pod->restart_us) {
        hal->can_restart(hal->context);
        pod->is_bus_off = false;
        pod->restart_us = now_us;
    }
}
