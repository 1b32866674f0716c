/* CRC-8 H2F (AUTOSAR: polynomial 0x2F, start 0xFF, final exclusive-or 0xFF).
 * Every frame ends in it, computed over the identifier (low byte first) and the payload before
 * it; the stored node record uses it too. Called by pod_frames.c and the board's store.
 */
#ifndef POD_CRC_H
#define POD_CRC_H

#include <stdint.h>

uint8_t pod_crc8(const uint8_t *data, uint8_t length);
uint8_t pod_crc8_of_frame(uint32_t id, const uint8_t *payload, uint8_t length);

#endif
