#include "pod_crc.h"

#define START 0xFFU
#define POLYNOMIAL 0x2FU

static uint8_t fold(uint8_t crc, const uint8_t byte) {
    crc ^= byte;
    for (uint8_t bit = 0; bit < 8U; bit++) {
        const uint8_t shifted = (uint8_t)(crc << 1);
        crc = (crc & 0x80U) != 0U ? (uint8_t)(shifted ^ POLYNOMIAL) : shifted;
    }
    return crc;
}

uint8_t pod_crc8(const uint8_t *const data, const uint8_t length) {
    uint8_t crc = START;
    for (uint8_t i = 0; i < length; i++) {
        crc = fold(crc, data[i]);
    }
    return crc ^ 0xFFU;
}

uint8_t pod_crc8_of_frame(const uint32_t id, const uint8_t *const payload, const uint8_t length) {
    uint8_t crc = fold(START, (uint8_t)(id & 0xFFU));
    crc = fold(crc, (uint8_t)((id >> 8) & 0xFFU));
    for (uint8_t i = 0; i < length; i++) {
        crc = fold(crc, payload[i]);
    }
    return crc ^ 0xFFU;
}
