/* The BNO055's register protocol on a serial line (data sheet Sec. 4.7): AA 01 reads, AA 00
 * writes; BB answers with data, EE with a code. Two bytes at a time, since the chip overruns;
 * after an error the line stays silent until the chip has forgotten the request.
 * A bno055_port_t over any serial line; called by the board, fuzzed by fuzz/fuzz_uart.c.
 */
#ifndef BNO055_UART_H
#define BNO055_UART_H

#include <stdbool.h>
#include <stdint.h>

#define BNO055_UART_DATA_MAX 32U
#define BNO055_UART_ANSWER_MAX (2U + BNO055_UART_DATA_MAX)
/* From the last byte of a request to the last of its answer; a read takes 3-4 ms. */
#define BNO055_UART_ANSWER_US 10000U
#define BNO055_UART_PAIR_US 2000U
#define BNO055_UART_SILENCE_US 45000U

typedef enum {
    BNO055_UART_INCOMPLETE,
    BNO055_UART_OK,
    BNO055_UART_ERROR,  /* EE with another code than "written" */
    BNO055_UART_GARBAGE /* what no request gets as its answer */
} bno055_uart_result_t;

typedef struct {
    void *context;
    bool (*write)(void *context, const uint8_t *bytes, uint8_t length);
    /* One byte if there is one; never waits. */
    bool (*read)(void *context, uint8_t *byte);
    uint64_t (*now_us)(void *context);
    void (*rest)(void *context); /* until something happens, at most a millisecond */
} bno055_serial_t;

typedef struct {
    const bno055_serial_t *serial;
    uint64_t silent_until_us;
    bool is_timeout;
    uint16_t overruns;
} bno055_uart_t;

/* Judges what came so far as the answer to a read of `length` bytes. */
bno055_uart_result_t bno055_uart_judge_read(const uint8_t *answer, uint8_t count, uint8_t length);
/* The same for a write. */
bno055_uart_result_t bno055_uart_judge_write(const uint8_t *answer, uint8_t count);

bool bno055_uart_read(void *context, uint8_t first, uint8_t *data, uint8_t length);
bool bno055_uart_write(void *context, uint8_t target, uint8_t value);
bool bno055_uart_timed_out(void *context);
bool bno055_uart_is_ready(void *context);

#endif
