/* What the core asks of a board: one table of functions and the context they get first.
 * Calls never block without a bound; `false` means "not done", and the core counts it.
 * Implemented by board_stm32f405/ and host/; called by pod*.c only.
 */
#ifndef POD_HAL_H
#define POD_HAL_H

#include <stdbool.h>
#include <stdint.h>

#include "bno055.h"

#define POD_FRAME_BYTES 8U
#define POD_MAILBOXES 3U

typedef struct {
    uint32_t id;
    bool is_extended;
    bool is_remote;
    uint8_t length;
    uint8_t data[POD_FRAME_BYTES];
    uint64_t received_us; /* local time of reception; receive direction only */
} pod_frame_t;

typedef struct {
    void *context;
    uint64_t (*now_us)(void *context);
    bno055_port_t imu;
    /* Frees a stuck sensor bus: nine clocks on I2C, silence on UART. */
    bool (*imu_recover)(void *context);
    /* Puts a frame into a hardware mailbox; false if that mailbox is still busy. */
    bool (*can_send)(void *context, uint8_t mailbox, const pod_frame_t *frame);
    bool (*can_receive)(void *context, pod_frame_t *frame);
    /* Frames, or lines, that came in and could not be taken: a running count. */
    uint16_t (*can_lost)(void *context);
    bool (*can_is_bus_off)(void *context);
    /* Empties the mailboxes and asks the controller to rejoin the bus. */
    void (*can_restart)(void *context);
    /* Keeps the node number over a reset. */
    bool (*store_node)(void *context, uint8_t node);
    void (*kick)(void *context);
    void (*reset)(void *context);
} pod_hal_t;

#endif
