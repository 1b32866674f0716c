/* The core as a shared library: one pod behind plain calls, for simulated buses.
 * Sensor, clock and outgoing frames are call backs; incoming frames are pushed. Bound by
 * sim_bus/buses/pod_core.py and used by the unit tests and the fuzzers.
 */
#ifndef POD_HOST_H
#define POD_HOST_H

#include <stdbool.h>
#include <stdint.h>

#include "../core/pod.h"

#define POD_HOST_RECEIVE_FRAMES 64U
/* Answers of the sensor call backs. */
#define POD_HOST_DONE 0
#define POD_HOST_REFUSED 1
#define POD_HOST_TIMED_OUT 2

typedef struct {
    uint64_t (*now_us)(void);
    int (*imu_read)(uint8_t first, uint8_t *data, uint8_t length);
    int (*imu_write)(uint8_t target, uint8_t value);
    int (*imu_recover)(void);
    int (*can_send)(uint8_t mailbox, uint32_t id, const uint8_t *data, uint8_t length);
    int (*store_node)(uint8_t node);
    void (*reset)(void);
} pod_host_calls_t;

typedef struct pod_host pod_host_t;

pod_host_t *pod_host_new(const pod_host_calls_t *calls, uint8_t node, const uint8_t *uid,
                         uint8_t reset_cause, uint16_t watchdog_resets);
void pod_host_free(pod_host_t *host);
/* Starts the same board over: what a reset does to the core. */
void pod_host_restart(pod_host_t *host, uint8_t node, uint8_t reset_cause,
                      uint16_t watchdog_resets);
/* False when the receive ring is full; the frame is lost, as on the board. */
bool pod_host_receive(pod_host_t *host, uint32_t id, bool is_extended, bool is_remote,
                      const uint8_t *data, uint8_t length, uint64_t received_us);
void pod_host_set_bus_off(pod_host_t *host, bool is_bus_off);
bool pod_host_is_bus_off(const pod_host_t *host);
uint32_t pod_host_step(pod_host_t *host);
uint8_t pod_host_state(const pod_host_t *host);
uint8_t pod_host_refusal(const pod_host_t *host);
uint64_t pod_host_master_us(const pod_host_t *host, uint64_t local_us);
bool pod_host_is_synced(const pod_host_t *host);
uint32_t pod_host_kicks(const pod_host_t *host);
/* Copy of all state that a frame could change besides counters and the receive ring. */
uint32_t pod_host_digest(const pod_host_t *host);

#endif
