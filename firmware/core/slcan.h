/* Frames as lines of text: the SLCAN (Lawicel) protocol that slcand and python-can speak.
 * The writer makes whole lines; the reader takes one byte at a time and never more than a line.
 * Called by the board's SLCAN transport; fuzzed by fuzz/fuzz_slcan.c.
 */
#ifndef SLCAN_H
#define SLCAN_H

#include <stdbool.h>
#include <stdint.h>

#include "pod_hal.h"

/* 'T', eight digits, length, sixteen digits, carriage return. */
#define SLCAN_LINE_MAX 27U

typedef enum {
    SLCAN_NOTHING, /* in the middle of a line */
    SLCAN_DONE,    /* a command was carried out: answer SLCAN_OK */
    SLCAN_FRAME,   /* a frame came: it is in `frame` */
    SLCAN_REFUSED  /* not a line of ours: answer SLCAN_BELL */
} slcan_event_t;

#define SLCAN_OK '\r'
#define SLCAN_BELL '\a'

typedef struct {
    uint8_t line[SLCAN_LINE_MAX];
    uint8_t length;
    bool is_overlong;
    bool is_open;
    bool is_listen_only;
    uint8_t bitrate; /* digit of the S command */
} slcan_t;

/* Takes one byte; on SLCAN_FRAME fills `frame`. */
slcan_event_t slcan_take(slcan_t *slcan, uint8_t byte, pod_frame_t *frame);
/* Writes the line of a frame, returns its length; `line` has room for SLCAN_LINE_MAX. */
uint8_t slcan_write(const pod_frame_t *frame, uint8_t *line);

#endif
