/* From the values of a request to the chip's own codes. */
#include "pod_config_keys.h"

#define RANGES 5U
#define BANDWIDTHS 8U

/* Indexed by the chip's own codes (data sheet Table 3-9). */
static const uint16_t RANGE_DPS[RANGES] = {2000, 1000, 500, 250, 125};
static const uint16_t BANDWIDTH_HZ[BANDWIDTHS] = {523, 230, 116, 47, 23, 12, 64, 32};

static uint8_t code_of(const uint16_t *const table, const uint8_t count, const uint32_t value) {
    for (uint8_t code = 0; code < count; code++) {
        if (table[code] == value) {
            return code;
        }
    }
    return count;
}

static bool is_mode(const uint32_t value) {
    return value == BNO055_MODE_GYRONLY || value == BNO055_MODE_AMG || value == BNO055_MODE_IMU ||
           value == BNO055_MODE_NDOF;
}

/* Puts the value into the settings; false if the chip has no such setting. */
bool pod_config_change(bno055_settings_t *const settings, const uint8_t key,
                       const uint32_t value) {
    const uint8_t range = code_of(RANGE_DPS, RANGES, value);
    const uint8_t bandwidth = code_of(BANDWIDTH_HZ, BANDWIDTHS, value);
    switch (key) {
    case KEY_RANGE_DPS:
        settings->range = range < RANGES ? range : settings->range;
        return range < RANGES;
    case KEY_BANDWIDTH_HZ:
        settings->bandwidth = bandwidth < BANDWIDTHS ? bandwidth : settings->bandwidth;
        return bandwidth < BANDWIDTHS;
    case KEY_MODE:
        settings->mode = is_mode(value) ? (uint8_t)value : settings->mode;
        return is_mode(value);
    default:
        settings->external_crystal = value == 1U;
        return value <= 1U;
    }
}

bool pod_config_is_equal(const bno055_settings_t *const a,
                         const bno055_settings_t *const b) {
    return a->mode == b->mode && a->range == b->range && a->bandwidth == b->bandwidth &&
           a->external_crystal == b->external_crystal;
}
