/* The pod's synchronised 64-bit time: microseconds of the master's steady clock.
 * Two steps: Sync n is stamped on arrival, FollowUp n says when it left. Offset from the last
 * pair, drift from pair to pair. Called by pod_receive.c (sync) and pod_imu.c (time).
 */
#ifndef POD_CLOCK_H
#define POD_CLOCK_H

#include <stdbool.h>
#include <stdint.h>

/* A follow-up later than this belongs to another sync; no sync for this long ends validity. */
#define POD_CLOCK_PAIR_US 1000000U
#define POD_CLOCK_VALID_US 5000000U
/* A crystal errs by 50 ppm, the fallback oscillator by 1 % (data sheet DS8626, Table 41). */
#define POD_CLOCK_DRIFT_MAX_PPB 10000000
/* An error above this is a new master or a step, not drift. */
#define POD_CLOCK_STEP_US 20000
#define POD_CLOCK_UNSYNCED INT16_MIN

typedef struct {
    uint64_t anchor_local_us;
    uint64_t anchor_master_us;
    int32_t drift_ppb;
    uint8_t pairs; /* saturates at 2: from then on the time is valid */
    int16_t error_us;
    bool has_sync;
    uint8_t sync_seq;
    uint64_t sync_local_us;
} pod_clock_t;

void pod_clock_sync(pod_clock_t *clock, uint8_t seq, uint64_t local_us);
bool pod_clock_follow_up(pod_clock_t *clock, uint8_t seq, uint64_t master_us, uint64_t now_us);
bool pod_clock_is_synced(const pod_clock_t *clock, uint64_t now_us);
uint64_t pod_clock_master_us(const pod_clock_t *clock, uint64_t local_us);

#endif
