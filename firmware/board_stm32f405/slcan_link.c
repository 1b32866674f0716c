/* SLCAN on a USART: the second transport, with the same calls as the CAN controller. */
#include "board.h"

/* Bytes looked at per call, so that a chattering line cannot hold the pod. */
#define BYTES_PER_CALL 64U

bool slcan_link_send(void *const context, const uint8_t mailbox, const pod_frame_t *const frame) {
    const slcan_link_t *const link = context;
    uint8_t line[SLCAN_LINE_MAX];
    (void)mailbox;
    if (!link->slcan.is_open || link->slcan.is_listen_only) {
        return false;
    }
    return usart_write(link->usart, line, slcan_write(frame, line));
}

static void answer(const slcan_link_t *const link, const uint8_t character) {
    (void)usart_write(link->usart, &character, 1U);
}

bool slcan_link_receive(void *const context, pod_frame_t *const frame) {
    slcan_link_t *const link = context;
    uint8_t byte = 0U;
    for (uint32_t i = 0; i < BYTES_PER_CALL && usart_read(link->usart, &byte); i++) {
        switch (slcan_take(&link->slcan, byte, frame)) {
        case SLCAN_FRAME:
            frame->received_us = ticks_now_us(NULL);
            return true;
        case SLCAN_DONE:
            answer(link, SLCAN_OK);
            break;
        case SLCAN_REFUSED:
            link->lost++;
            answer(link, SLCAN_BELL);
            break;
        case SLCAN_NOTHING:
        default:
            break;
        }
    }
    return false;
}

uint16_t slcan_link_lost(void *const context) {
    const slcan_link_t *const link = context;
    return link->lost;
}

bool slcan_link_is_bus_off(void *const context) {
    (void)context;
    return false;
}

void slcan_link_restart(void *const context) { (void)context; }
