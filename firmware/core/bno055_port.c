/* Register access that counts its failures and asks for the bus to be freed after a few. */
#include "bno055_internal.h"

#define COUNTER_MAX 0xFFFFU

void bno055_count(uint16_t *const counter) {
    if (*counter < COUNTER_MAX) {
        (*counter)++;
    }
}

static bool settle(bno055_t *const imu, const bool is_done) {
    if (is_done) {
        imu->failures = 0U;
        return true;
    }
    bno055_count(imu->port->timed_out(imu->port->context) ? &imu->counts.timeouts
                                                          : &imu->counts.naks);
    imu->failures++;
    if (imu->failures % BNO055_FAILURES_RECOVER == 0U) {
        imu->wants_recovery = true;
    }
    return false;
}

bool bno055_read(bno055_t *const imu, const uint8_t first, uint8_t *const data,
                 const uint8_t length) {
    return settle(imu, imu->port->read(imu->port->context, first, data, length));
}

bool bno055_write(bno055_t *const imu, const uint8_t target, const uint8_t value) {
    return settle(imu, imu->port->write(imu->port->context, target, value));
}
