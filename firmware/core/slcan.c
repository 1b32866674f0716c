#include "slcan.h"

#define ID_DIGITS 3U
#define EXTENDED_ID_DIGITS 8U
#define ID_MAX 0x7FFU
#define EXTENDED_ID_MAX 0x1FFFFFFFU
#define BITRATE_LAST '8'
#define NOT_HEX 0xFFU

static uint8_t digit(const uint8_t value) {
    return (uint8_t)(value < 10U ? '0' + value : 'A' + value - 10);
}

static uint8_t value_of(const uint8_t character) {
    if (character >= '0' && character <= '9') {
        return (uint8_t)(character - '0');
    }
    if (character >= 'A' && character <= 'F') {
        return (uint8_t)(character - 'A' + 10);
    }
    if (character >= 'a' && character <= 'f') {
        return (uint8_t)(character - 'a' + 10);
    }
    return NOT_HEX;
}

static bool read_hex(const uint8_t *const text, const uint8_t digits, uint32_t *const value) {
    *value = 0U;
    for (uint8_t i = 0; i < digits; i++) {
        const uint8_t nibble = value_of(text[i]);
        if (nibble == NOT_HEX) {
            return false;
        }
        *value = (*value << 4) | nibble;
    }
    return true;
}

/* The whole line must be there, no more and no less: a truncated one is not filled up. */
static bool read_frame(const uint8_t *const line, const uint8_t length, pod_frame_t *const frame) {
    const bool is_extended = line[0] == 'T' || line[0] == 'R';
    const bool is_remote = line[0] == 'r' || line[0] == 'R';
    const uint8_t digits = is_extended ? EXTENDED_ID_DIGITS : ID_DIGITS;
    uint32_t id = 0U;
    if (length < digits + 2U || !read_hex(&line[1], digits, &id) ||
        id > (is_extended ? EXTENDED_ID_MAX : ID_MAX)) {
        return false;
    }
    const uint8_t count = value_of(line[digits + 1U]);
    const uint8_t data_digits = is_remote ? 0U : (uint8_t)(2U * count);
    if (count > POD_FRAME_BYTES || length != digits + 2U + data_digits) {
        return false;
    }
    *frame = (pod_frame_t){
        .id = id, .is_extended = is_extended, .is_remote = is_remote, .length = count};
    for (uint8_t i = 0; 2U * i < data_digits; i++) {
        uint32_t byte = 0U;
        if (!read_hex(&line[digits + 2U + 2U * i], 2U, &byte)) {
            return false;
        }
        frame->data[i] = (uint8_t)byte;
    }
    return true;
}

static slcan_event_t set_bitrate(slcan_t *const slcan, const uint8_t *const line,
                                 const uint8_t length) {
    if (length != 2U || line[1] < '0' || line[1] > BITRATE_LAST) {
        return SLCAN_REFUSED;
    }
    slcan->bitrate = (uint8_t)(line[1] - '0');
    return SLCAN_DONE;
}

static slcan_event_t open(slcan_t *const slcan, const bool is_open, const bool is_listen_only) {
    slcan->is_open = is_open;
    slcan->is_listen_only = is_listen_only;
    return SLCAN_DONE;
}

static slcan_event_t obey(slcan_t *const slcan, const uint8_t length, pod_frame_t *const frame) {
    const uint8_t *const line = slcan->line;
    if (length == 0U) {
        return SLCAN_DONE; /* python-can sends an empty line */
    }
    switch (line[0]) {
    case 'O':
        return length == 1U ? open(slcan, true, false) : SLCAN_REFUSED;
    case 'L':
        return length == 1U ? open(slcan, true, true) : SLCAN_REFUSED;
    case 'C':
        return length == 1U ? open(slcan, false, false) : SLCAN_REFUSED;
    case 'S':
        return set_bitrate(slcan, line, length);
    case 't':
    case 'T':
    case 'r':
    case 'R':
        return slcan->is_open && read_frame(line, length, frame) ? SLCAN_FRAME : SLCAN_REFUSED;
    default:
        return SLCAN_REFUSED;
    }
}

slcan_event_t slcan_take(slcan_t *const slcan, const uint8_t byte, pod_frame_t *const frame) {
    if (byte == '\n') {
        return SLCAN_NOTHING;
    }
    if (byte != '\r') {
        if (slcan->length < SLCAN_LINE_MAX) {
            slcan->line[slcan->length] = byte;
            slcan->length++;
        } else {
            slcan->is_overlong = true;
        }
        return SLCAN_NOTHING;
    }
    const uint8_t length = slcan->length;
    const bool is_overlong = slcan->is_overlong;
    slcan->length = 0U;
    slcan->is_overlong = false;
    return is_overlong ? SLCAN_REFUSED : obey(slcan, length, frame);
}

uint8_t slcan_write(const pod_frame_t *const frame, uint8_t *const line) {
    uint8_t at = 0U;
    const uint8_t letter = frame->is_remote ? 'r' : 't';
    const uint8_t count = frame->length < POD_FRAME_BYTES ? frame->length : POD_FRAME_BYTES;
    line[at++] = frame->is_extended ? (uint8_t)(letter - 'a' + 'A') : letter;
    const uint8_t digits = frame->is_extended ? EXTENDED_ID_DIGITS : ID_DIGITS;
    for (uint8_t i = digits; i > 0U; i--) {
        line[at++] = digit((uint8_t)((frame->id >> (4U * (i - 1U))) & 0x0FU));
    }
    line[at++] = digit(count);
    const uint8_t data_bytes = frame->is_remote ? 0U : count;
    for (uint8_t i = 0; i < data_bytes; i++) {
        line[at++] = digit(frame->data[i] >> 4);
        line[at++] = digit(frame->data[i] & 0x0FU);
    }
    line[at++] = '\r';
    return at;
}
