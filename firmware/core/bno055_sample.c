/* Burst read and screening of samples; bring-up and watch are in bno055.c. */
#include "bno055_internal.h"
#include "bno055_registers.h"

#define GYRO_BYTES 6U
#define ALL_BYTES 18U
#define FORCE_AT 0U
#define FIELD_AT 6U
#define RATE_AT 12U

_Static_assert(BNO055_ACC_DATA + RATE_AT == BNO055_GYR_DATA, "one burst covers all sensors");

static int16_t word_at(const uint8_t *const bytes) {
    const uint16_t word = (uint16_t)((uint16_t)bytes[0] | ((uint16_t)bytes[1] << 8));
    return (int16_t)(word < 0x8000U ? (int32_t)word : (int32_t)word - 0x10000);
}

static void triple_at(const uint8_t *const bytes, int16_t *const triple) {
    for (uint8_t axis = 0; axis < BNO055_AXES; axis++) {
        triple[axis] = word_at(&bytes[2U * axis]);
    }
}

static bool read_burst(bno055_t *const imu, const bool all_sensors, bno055_sample_t *const sample) {
    uint8_t bytes[ALL_BYTES] = {0};
    const uint8_t first = all_sensors ? BNO055_ACC_DATA : BNO055_GYR_DATA;
    const uint8_t length = all_sensors ? ALL_BYTES : GYRO_BYTES;
    const uint64_t begin_us = imu->port->now_us(imu->port->context);
    if (!bno055_read(imu, first, bytes, length)) {
        return false;
    }
    const uint64_t end_us = imu->port->now_us(imu->port->context);
    sample->measured_us = begin_us + (end_us - begin_us) / 2U;
    if (all_sensors) {
        triple_at(&bytes[FORCE_AT], sample->force);
        triple_at(&bytes[FIELD_AT], sample->field);
        triple_at(&bytes[RATE_AT], sample->rate);
    } else {
        triple_at(bytes, sample->rate);
    }
    return true;
}

static bool is_near(const int16_t *const a, const int16_t *const b) {
    for (uint8_t axis = 0; axis < BNO055_AXES; axis++) {
        const int32_t step = (int32_t)a[axis] - (int32_t)b[axis];
        if (step > BNO055_STEP_LIMIT || step < -BNO055_STEP_LIMIT) {
            return false;
        }
    }
    return true;
}

static bool is_equal(const int16_t *const a, const int16_t *const b) {
    return a[0] == b[0] && a[1] == b[1] && a[2] == b[2];
}

/* A jump is used only if a second reading confirms it. */
static bool screen(bno055_t *const imu, const bool all_sensors, bno055_sample_t *const sample) {
    if (!imu->has_last || is_near(sample->rate, imu->last_rate)) {
        return true;
    }
    const bno055_sample_t first = *sample;
    if (!read_burst(imu, all_sensors, sample)) {
        return false;
    }
    if (is_near(sample->rate, first.rate)) {
        return true;
    }
    bno055_count(&imu->counts.spikes);
    return is_near(sample->rate, imu->last_rate);
}

/* All zero is what a chip shows that fell back to its configuration mode: ask it. */
static bool zeros_are_true(bno055_t *const imu, const bno055_sample_t *const sample) {
    const int16_t zero[BNO055_AXES] = {0};
    return !is_equal(sample->rate, zero) || bno055_check_mode(imu);
}

bool bno055_sample(bno055_t *const imu, const bool all_sensors, bno055_sample_t *const sample) {
    const bool can_read =
        imu->state == BNO055_STATE_RUNNING && imu->port->is_ready(imu->port->context);
    if (!can_read || !read_burst(imu, all_sensors, sample) ||
        !screen(imu, all_sensors, sample) || !zeros_are_true(imu, sample)) {
        return false;
    }
    sample->repeated = imu->has_last && is_equal(sample->rate, imu->last_rate);
    imu->repeats = sample->repeated ? (uint8_t)(imu->repeats + 1U) : 0U;
    if (imu->repeats == BNO055_REPEATS_FROZEN) {
        bno055_count(&imu->counts.frozen);
        imu->repeats = 0U;
        imu->watch_us = 0U;
    }
    for (uint8_t axis = 0; axis < BNO055_AXES; axis++) {
        imu->last_rate[axis] = sample->rate[axis];
    }
    imu->has_last = true;
    return true;
}
