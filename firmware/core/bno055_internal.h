/* What bno055.c and bno055_sample.c share: register access that counts its failures. */
#ifndef BNO055_INTERNAL_H
#define BNO055_INTERNAL_H

#include "bno055.h"

void bno055_count(uint16_t *counter);
bool bno055_read(bno055_t *imu, uint8_t first, uint8_t *data, uint8_t length);
bool bno055_write(bno055_t *imu, uint8_t target, uint8_t value);
/* Reads OPR_MODE back; a chip out of its mode begins a restart at the next step. */
bool bno055_check_mode(bno055_t *imu);

#endif
