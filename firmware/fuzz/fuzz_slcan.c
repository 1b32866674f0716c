/* The SLCAN reader: any bytes; a frame that comes out is a legal one and writes back the same. */
#include <stdlib.h>
#include <string.h>

#include "slcan.h"

int LLVMFuzzerTestOneInput(const uint8_t *bytes, size_t size);

static void check(const pod_frame_t *const frame) {
    uint8_t line[SLCAN_LINE_MAX];
    slcan_t reader = {.is_open = true};
    pod_frame_t again = {0};
    if (frame->length > POD_FRAME_BYTES || frame->id > (frame->is_extended ? 0x1FFFFFFFU : 0x7FFU)) {
        abort();
    }
    const uint8_t length = slcan_write(frame, line);
    slcan_event_t event = SLCAN_NOTHING;
    for (uint8_t i = 0; i < length; i++) {
        event = slcan_take(&reader, line[i], &again);
    }
    if (event != SLCAN_FRAME || again.id != frame->id || again.length != frame->length ||
        memcmp(again.data, frame->data, POD_FRAME_BYTES) != 0) {
        abort();
    }
}

int LLVMFuzzerTestOneInput(const uint8_t *const bytes, const size_t size) {
    slcan_t slcan = {.is_open = true};
    for (size_t i = 0; i < size; i++) {
        pod_frame_t frame = {0};
        if (slcan_take(&slcan, bytes[i], &frame) == SLCAN_FRAME) {
            check(&frame);
        }
        if (slcan.length > SLCAN_LINE_MAX) {
            abort();
        }
    }
    return 0;
}
