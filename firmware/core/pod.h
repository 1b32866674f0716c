/* The wing pod: everything it knows, and the two calls that run it.
 * pod_init() once, then pod_step() whenever something happened or a millisecond passed; it never
 * blocks longer than the sensor access it makes. Called by main.c, the host library and tests.
 */
#ifndef POD_H
#define POD_H

#include <stdbool.h>
#include <stdint.h>

#include "bno055.h"
#include "pod_clock.h"
#include "pod_hal.h"

#define POD_LAYOUT_VERSION 1U /* of drivers/can/pod/pod.dbc */
#define POD_VERSION_MAJOR 1U
#define POD_VERSION_MINOR 0U
#define POD_VERSION_PATCH 0U

#define POD_NODES 16U
#define POD_NODE_NONE 0xFFU
#define POD_UID_BYTES 12U
/* Samples of four frames each, about 80 ms; replies; one round of status, counters, identity. */
#define POD_QUEUE_FRAMES 32U

typedef enum {
    POD_STATE_STARTING,
    POD_STATE_RUNNING,
    POD_STATE_CHIP_MISSING,
    POD_STATE_RECOVERING,
    POD_STATE_REFUSED
} pod_state_t;

typedef enum {
    POD_REFUSAL_NONE,
    POD_REFUSAL_DUPLICATE,
    POD_REFUSAL_LAYOUT,
    POD_REFUSAL_NO_NODE
} pod_refusal_t;

/* Values of pod.dbc, Identity.reset_cause. */
typedef enum {
    POD_RESET_UNKNOWN,
    POD_RESET_POWER_ON,
    POD_RESET_PIN,
    POD_RESET_WATCHDOG,
    POD_RESET_SOFTWARE,
    POD_RESET_BROWN_OUT
} pod_reset_cause_t;

/* What the board found out before the core starts. */
typedef struct {
    uint8_t node; /* by strap or store; POD_NODE_NONE if neither gives one */
    uint8_t uid[POD_UID_BYTES];
    pod_reset_cause_t reset_cause;
    uint16_t watchdog_resets;
} pod_boot_t;

typedef struct {
    uint16_t rate_hz;
    uint8_t streams; /* POD_STREAM_* */
    bool is_triggered;
} pod_sampling_t;

#define POD_STREAM_ACCEL 1U
#define POD_STREAM_MAG 2U

/* One queue per hardware mailbox: order within it is kept, urgency lies between them. */
typedef enum { POD_MAILBOX_DATA, POD_MAILBOX_REPLY, POD_MAILBOX_STATUS } pod_mailbox_t;

typedef struct {
    uint16_t id;
    uint8_t length;
    uint8_t data[POD_FRAME_BYTES];
} pod_queued_t;

typedef struct {
    pod_queued_t frames[POD_QUEUE_FRAMES];
    uint8_t first;
    uint8_t count;
} pod_queue_t;

typedef struct {
    uint16_t bus_recoveries;
    uint16_t tx_dropped;
    uint16_t bus_offs;
    uint16_t rx_bad;
    uint16_t sample_late;
    uint16_t sample_missed;
    uint16_t config_refused;
    uint32_t samples_sent;
} pod_counters_t;

typedef struct {
    bool is_pending;
    uint8_t token;
    uint8_t key;
    uint32_t value;
    uint64_t deadline_us;
} pod_pending_t;

typedef struct {
    bool has_listened; /* no other node with our number was received */
    uint64_t listen_until_us;
    uint64_t answer_after_us;
    uint64_t claim_until_us;   /* another pod that runs announces itself with our number */
    uint64_t refused_until_us; /* one that is refused does */
    uint8_t wrong_layouts;
    uint8_t right_layouts;
    uint8_t same_uid_part; /* of the other pod's Identity 1, when it equals ours */
} pod_identity_t;

typedef struct {
    const pod_hal_t *hal;
    pod_boot_t boot;
    bno055_t imu;
    pod_clock_t clock;
    pod_sampling_t sampling;
    pod_counters_t counters;
    pod_identity_t identity;
    pod_pending_t pending;
    pod_queue_t queues[POD_MAILBOXES];
    pod_refusal_t refusal;
    bool is_measuring;
    bool was_measuring;
    bool is_sampling;
    bool has_sampled; /* in this step */
    uint64_t boot_us;
    uint64_t due_us;     /* next sample of the own timer, put off by every trigger */
    uint64_t trigger_us; /* arrival of the sync that asked for a sample */
    bool has_trigger;
    uint64_t status_us;
    uint64_t counters_us;
    uint64_t identity_us;
    uint8_t counters_page;
    uint64_t restart_us; /* end of the wait before rejoining the bus */
    uint32_t restart_wait_us;
    bool is_bus_off;
    uint16_t lost_seen; /* of hal->can_lost */
} pod_t;

void pod_init(pod_t *pod, const pod_hal_t *hal, const pod_boot_t *boot);
/* Does everything that is due; returns how long nothing else will be, microseconds. */
uint32_t pod_step(pod_t *pod);
pod_state_t pod_state(const pod_t *pod);

#endif
