/* Frames out: the check byte, the bounded queues, what is dropped when one is full. */
#include "pod_crc.h"
#include "pod_parts.h"

#define COUNTER_MAX 0xFFFFU

_Static_assert(POD_QUEUE_FRAMES <= 128U, "ring arithmetic is done in uint8_t");

void pod_count(uint16_t *const counter) {
    if (*counter < COUNTER_MAX) {
        (*counter)++;
    }
}

void pod_count_many(uint16_t *const counter, const uint64_t amount) {
    const uint64_t room = COUNTER_MAX - *counter;
    *counter = (uint16_t)(*counter + (amount < room ? amount : room));
}

/* The oldest goes first: the newest sample is worth most, and the gap shows in seq. */
static void drop_oldest(pod_t *const pod, pod_queue_t *const queue) {
    queue->first = (uint8_t)((queue->first + 1U) % POD_QUEUE_FRAMES);
    queue->count--;
    pod_count(&pod->counters.tx_dropped);
}

void pod_drop_data(pod_t *const pod) {
    while (pod->queues[POD_MAILBOX_DATA].count > 0U) {
        drop_oldest(pod, &pod->queues[POD_MAILBOX_DATA]);
    }
}

void pod_queue_frame(pod_t *const pod, const pod_mailbox_t mailbox, const uint32_t base_id,
                     const uint8_t *const payload, const uint8_t length) {
    pod_queue_t *const queue = &pod->queues[mailbox];
    if (queue->count == POD_QUEUE_FRAMES) {
        drop_oldest(pod, queue);
    }
    pod_queued_t *const slot = &queue->frames[(queue->first + queue->count) % POD_QUEUE_FRAMES];
    queue->count++;
    slot->id = (uint16_t)(base_id + pod_wire_node(pod));
    slot->length = length;
    for (uint8_t i = 0; i + 1U < length; i++) {
        slot->data[i] = payload[i];
    }
    slot->data[length - 1U] = pod_crc8_of_frame(slot->id, slot->data, (uint8_t)(length - 1U));
}

bool pod_frame_is_sound(const pod_frame_t *const frame, const uint8_t length) {
    const uint8_t last = (uint8_t)(length - 1U);
    return frame->length == length &&
           pod_crc8_of_frame(frame->id, frame->data, last) == frame->data[last];
}
