/* The BNO055's answers on a serial line: any bytes at any time. Accesses end in bounded time, and
 * a read that succeeds gives the bytes that followed a right header.
 */
#include <stdlib.h>
#include <string.h>

#include "bno055_uart.h"

#define ACCESSES 8U

int LLVMFuzzerTestOneInput(const uint8_t *bytes, size_t size);

static struct {
    const uint8_t *bytes;
    size_t size, at, taken_from;
    uint64_t now_us;
} line;

static bool line_write(void *const context, const uint8_t *const bytes, const uint8_t length) {
    (void)context;
    (void)bytes;
    return length > 0U;
}

/* A byte 0xA5 of the input is a pause. */
static bool line_read(void *const context, uint8_t *const byte) {
    (void)context;
    if (line.at >= line.size || line.bytes[line.at] == 0xA5U) {
        line.at += line.at < line.size ? 1U : 0U;
        return false;
    }
    *byte = line.bytes[line.at++];
    return true;
}

static uint64_t line_now(void *const context) {
    (void)context;
    return line.now_us;
}

static void line_rest(void *const context) {
    (void)context;
    line.now_us += 1000U;
}

int LLVMFuzzerTestOneInput(const uint8_t *const bytes, const size_t size) {
    const bno055_serial_t serial = {
        .write = line_write, .read = line_read, .now_us = line_now, .rest = line_rest};
    bno055_uart_t uart = {.serial = &serial};
    line.bytes = bytes;
    line.size = size;
    line.at = 0U;
    line.now_us = 0U;
    for (unsigned i = 0; i < ACCESSES; i++) {
        uint8_t data[BNO055_UART_DATA_MAX];
        const uint64_t begin_us = line.now_us;
        const uint8_t length = (uint8_t)(i * 6U);
        if (i % 3U == 2U) {
            (void)bno055_uart_write(&uart, 0x3DU, (uint8_t)i);
        } else if (bno055_uart_read(&uart, 0x14U, data, length) &&
                   (length == 0U || length > BNO055_UART_DATA_MAX || line.at < length)) {
            abort();
        }
        if (line.now_us - begin_us > 2U * BNO055_UART_ANSWER_US) {
            abort();
        }
        line.now_us += BNO055_UART_SILENCE_US;
    }
    return 0;
}
