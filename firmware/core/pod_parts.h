/* The parts of the pod, each a file of its own, that pod.c strings together.
 * Not for callers from outside the core: those use pod.h.
 */
#ifndef POD_PARTS_H
#define POD_PARTS_H

#include "pod.h"

/* pod_frames.c: bounded queues, sealing with the check byte, saturating counters. */
void pod_count(uint16_t *counter);
void pod_count_many(uint16_t *counter, uint64_t amount);
void pod_queue_frame(pod_t *pod, pod_mailbox_t mailbox, uint32_t base_id, const uint8_t *payload,
                     uint8_t length);
bool pod_frame_is_sound(const pod_frame_t *frame, uint8_t length);
void pod_drop_data(pod_t *pod);

/* pod_link.c: queues to mailboxes, and back from bus-off. */
void pod_transmit(pod_t *pod);
void pod_watch_bus(pod_t *pod, uint64_t now_us);

/* pod_receive.c: frames in. */
void pod_receive(pod_t *pod, uint64_t now_us);

/* pod_imu.c: when to sample, and the frames of a sample. */
void pod_sample(pod_t *pod, uint64_t now_us);
uint32_t pod_period_us(const pod_t *pod);

/* pod_config.c: requests and their replies. */
void pod_config_default(pod_t *pod);
void pod_config_request(pod_t *pod, const pod_frame_t *frame, uint64_t now_us);
void pod_config_finish(pod_t *pod, uint64_t now_us);

/* pod_identity.c: who may use this node number, and with which layout. */
void pod_identity_init(pod_t *pod, uint64_t now_us);
void pod_identity_step(pod_t *pod, uint64_t now_us);
void pod_identity_heard_own(pod_t *pod, const pod_frame_t *frame, uint32_t base_id,
                            uint64_t now_us);
void pod_identity_layout(pod_t *pod, uint8_t layout);
uint8_t pod_wire_node(const pod_t *pod);

/* pod_report.c: status, counters and identity frames. */
void pod_report(pod_t *pod, uint64_t now_us);
void pod_announce(pod_t *pod);
uint64_t pod_uid_part(const pod_t *pod, uint8_t part);

#endif
