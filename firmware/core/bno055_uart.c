#include "bno055_uart.h"

#define START 0xAAU
#define WRITE 0x00U
#define READ 0x01U
#define DATA_FOLLOWS 0xBBU
#define STATUS 0xEEU
#define WRITTEN 0x01U
#define OVERRUN 0x07U
#define HEADER_BYTES 2U
#define REQUEST_BYTES 4U
#define PAIR_BYTES 2U

bno055_uart_result_t bno055_uart_judge_read(const uint8_t *const answer, const uint8_t count,
                                            const uint8_t length) {
    if (count == 0U) {
        return BNO055_UART_INCOMPLETE;
    }
    if (answer[0] != DATA_FOLLOWS && answer[0] != STATUS) {
        return BNO055_UART_GARBAGE;
    }
    if (count < HEADER_BYTES) {
        return BNO055_UART_INCOMPLETE;
    }
    if (answer[0] == STATUS) {
        /* "Written" answers some other request. */
        return answer[1] == WRITTEN ? BNO055_UART_GARBAGE : BNO055_UART_ERROR;
    }
    if (answer[1] != length || length == 0U || length > BNO055_UART_DATA_MAX) {
        return BNO055_UART_GARBAGE;
    }
    return count < HEADER_BYTES + length ? BNO055_UART_INCOMPLETE : BNO055_UART_OK;
}

bno055_uart_result_t bno055_uart_judge_write(const uint8_t *const answer, const uint8_t count) {
    if (count == 0U) {
        return BNO055_UART_INCOMPLETE;
    }
    if (answer[0] != STATUS) {
        return BNO055_UART_GARBAGE;
    }
    if (count < HEADER_BYTES) {
        return BNO055_UART_INCOMPLETE;
    }
    return answer[1] == WRITTEN ? BNO055_UART_OK : BNO055_UART_ERROR;
}

static void rest_until(const bno055_serial_t *const serial, const uint64_t until_us) {
    while (serial->now_us(serial->context) < until_us) {
        serial->rest(serial->context);
    }
}

/* What is still in the receiver answers an older request; at most a full answer is thrown away
 * twice over, so that a chattering line cannot hold the pod. */
static void discard(const bno055_serial_t *const serial) {
    uint8_t byte = 0U;
    for (uint32_t i = 0; i < 2U * BNO055_UART_ANSWER_MAX; i++) {
        if (!serial->read(serial->context, &byte)) {
            return;
        }
    }
}

static bool send(const bno055_serial_t *const serial, const uint8_t *const request,
                 const uint8_t length) {
    discard(serial);
    for (uint8_t sent = 0; sent < length; sent = (uint8_t)(sent + PAIR_BYTES)) {
        const uint8_t left = (uint8_t)(length - sent);
        const uint8_t now = left < PAIR_BYTES ? left : PAIR_BYTES;
        if (!serial->write(serial->context, &request[sent], now)) {
            return false;
        }
        if (left > now) {
            rest_until(serial, serial->now_us(serial->context) + BNO055_UART_PAIR_US);
        }
    }
    return true;
}

/* Collects the answer; `length` 0 means a write. */
static bno055_uart_result_t collect(bno055_uart_t *const uart, uint8_t *const answer,
                                    const uint8_t length) {
    const bno055_serial_t *const serial = uart->serial;
    const uint64_t until_us = serial->now_us(serial->context) + BNO055_UART_ANSWER_US;
    uint8_t count = 0U;
    bno055_uart_result_t result = BNO055_UART_INCOMPLETE;
    while (result == BNO055_UART_INCOMPLETE && count < BNO055_UART_ANSWER_MAX) {
        if (serial->read(serial->context, &answer[count])) {
            count++;
            result = length == 0U ? bno055_uart_judge_write(answer, count)
                                  : bno055_uart_judge_read(answer, count, length);
        } else if (serial->now_us(serial->context) >= until_us) {
            uart->is_timeout = true;
            return BNO055_UART_INCOMPLETE;
        } else {
            serial->rest(serial->context);
        }
    }
    return result;
}

static bool ask(bno055_uart_t *const uart, const uint8_t *const request, const uint8_t bytes,
                uint8_t *const answer, const uint8_t length) {
    const bno055_serial_t *const serial = uart->serial;
    uart->is_timeout = false;
    if (!bno055_uart_is_ready(uart)) {
        return false;
    }
    bno055_uart_result_t result = BNO055_UART_GARBAGE;
    if (send(serial, request, bytes)) {
        result = collect(uart, answer, length);
    }
    if (result == BNO055_UART_ERROR && answer[1] == OVERRUN && uart->overruns < UINT16_MAX) {
        uart->overruns++;
    }
    if (result != BNO055_UART_OK) {
        uart->silent_until_us = serial->now_us(serial->context) + BNO055_UART_SILENCE_US;
    }
    return result == BNO055_UART_OK;
}

bool bno055_uart_read(void *const context, const uint8_t first, uint8_t *const data,
                      const uint8_t length) {
    bno055_uart_t *const uart = context;
    const uint8_t request[REQUEST_BYTES] = {START, READ, first, length};
    uint8_t answer[BNO055_UART_ANSWER_MAX] = {0};
    if (length == 0U || length > BNO055_UART_DATA_MAX ||
        !ask(uart, request, REQUEST_BYTES, answer, length)) {
        return false;
    }
    for (uint8_t i = 0; i < length; i++) {
        data[i] = answer[HEADER_BYTES + i];
    }
    return true;
}

bool bno055_uart_write(void *const context, const uint8_t target, const uint8_t value) {
    bno055_uart_t *const uart = context;
    const uint8_t request[REQUEST_BYTES + 1U] = {START, WRITE, target, 1U, value};
    uint8_t answer[BNO055_UART_ANSWER_MAX] = {0};
    return ask(uart, request, (uint8_t)sizeof request, answer, 0U);
}

bool bno055_uart_is_ready(void *const context) {
    const bno055_uart_t *const uart = context;
    return uart->serial->now_us(uart->serial->context) >= uart->silent_until_us;
}

bool bno055_uart_timed_out(void *const context) {
    const bno055_uart_t *const uart = context;
    return uart->is_timeout;
}
