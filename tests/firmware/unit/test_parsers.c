/* The line and answer parsers, the check byte and the clock, each against known values. */
#include <string.h>

#include "bno055_uart.h"
#include "cmocka_all.h"
#include "pod_clock.h"
#include "pod_crc.h"
#include "slcan.h"

static void crc_has_the_standard_check_value(void **state) {
    (void)state;
    /* AUTOSAR Specification of CRC Routines, CRC8H2F: check value of "123456789". */
    assert_int_equal(pod_crc8((const uint8_t *)"123456789", 9U), 0xDF);
    assert_int_equal(pod_crc8_of_frame(0x3231U, (const uint8_t *)"3456789", 7U), 0xDF);
}

static slcan_event_t feed(slcan_t *slcan, const char *text, pod_frame_t *frame) {
    slcan_event_t event = SLCAN_NOTHING;
    for (; *text != '\0'; text++) {
        event = slcan_take(slcan, (uint8_t)*text, frame);
    }
    return event;
}

static void slcan_opens_as_slcand_and_python_can_do_it(void **state) {
    (void)state;
    slcan_t slcan = {0};
    pod_frame_t frame;
    assert_int_equal(feed(&slcan, "C\rS6\r", &frame), SLCAN_DONE);
    assert_int_equal(slcan.bitrate, 6);
    assert_int_equal(feed(&slcan, "\r", &frame), SLCAN_DONE);
    assert_int_equal(feed(&slcan, "O\rO\r", &frame), SLCAN_DONE);
    assert_true(slcan.is_open);
    assert_int_equal(feed(&slcan, "L\r", &frame), SLCAN_DONE);
    assert_true(slcan.is_listen_only);
    assert_int_equal(feed(&slcan, "C\r", &frame), SLCAN_DONE);
    assert_false(slcan.is_open);
    assert_int_equal(feed(&slcan, "t0801AA\r", &frame), SLCAN_REFUSED);
}

static void slcan_takes_whole_frames_only(void **state) {
    (void)state;
    slcan_t slcan = {.is_open = true};
    pod_frame_t frame;
    assert_int_equal(feed(&slcan, "t0804A1b2C3d4\r", &frame), SLCAN_FRAME);
    assert_int_equal(frame.id, 0x80);
    assert_int_equal(frame.length, 4);
    assert_memory_equal(frame.data, ((const uint8_t[]){0xA1, 0xB2, 0xC3, 0xD4}), 4U);
    assert_int_equal(feed(&slcan, "T1ABCDEF00\r", &frame), SLCAN_FRAME);
    assert_true(frame.is_extended);
    assert_int_equal(frame.id, 0x1ABCDEF0);
    assert_int_equal(feed(&slcan, "r1238\r", &frame), SLCAN_FRAME);
    assert_true(frame.is_remote);
    assert_int_equal(feed(&slcan, "R000001238\r", &frame), SLCAN_FRAME);
    static const char *const bad[] = {
        "t0804A1B2C3\r", "t0804A1B2C3D4E5\r", "t8001AA\r", "t0809\r", "t08\r", "tXYZ0\r",
        "t0801G0\r", "T200000000\r", "S9\r", "S\r", "OO\r", "CC\r", "LL\r", "Q\r", "x\r",
        "t08011\r", "t0801AAt0801AAt0801AAt0801AAt0801AA\r"};
    for (size_t i = 0; i < sizeof bad / sizeof bad[0]; i++) {
        assert_int_equal(feed(&slcan, bad[i], &frame), SLCAN_REFUSED);
    }
    assert_int_equal(feed(&slcan, "\nt0800\r", &frame), SLCAN_FRAME);
}

static void slcan_writes_what_it_reads(void **state) {
    (void)state;
    static const pod_frame_t frames[] = {
        {.id = 0x103, .length = 8, .data = {0, 1, 0x7F, 0x80, 0xFE, 0xFF, 0xA5, 0x5A}},
        {.id = 0x1FFFFFFF, .is_extended = true, .length = 8, .data = {1, 2, 3, 4, 5, 6, 7, 8}},
        {.id = 0x7FF, .is_remote = true, .length = 5},
        {.id = 0x12345, .is_extended = true, .is_remote = true, .length = 0},
    };
    for (size_t i = 0; i < sizeof frames / sizeof frames[0]; i++) {
        slcan_t slcan = {.is_open = true};
        uint8_t line[SLCAN_LINE_MAX];
        pod_frame_t back = {0};
        const uint8_t length = slcan_write(&frames[i], line);
        assert_true(length <= SLCAN_LINE_MAX);
        slcan_event_t event = SLCAN_NOTHING;
        for (uint8_t at = 0; at < length; at++) {
            event = slcan_take(&slcan, line[at], &back);
        }
        assert_int_equal(event, SLCAN_FRAME);
        assert_int_equal(back.id, frames[i].id);
        assert_int_equal(back.length, frames[i].length);
        assert_int_equal(back.is_extended, frames[i].is_extended);
        assert_int_equal(back.is_remote, frames[i].is_remote);
        if (!frames[i].is_remote) {
            assert_memory_equal(back.data, frames[i].data, frames[i].length);
        }
    }
}

static void uart_answers_are_judged(void **state) {
    (void)state;
    const uint8_t good[] = {0xBB, 2, 0x12, 0x34};
    assert_int_equal(bno055_uart_judge_read(good, 0, 2), BNO055_UART_INCOMPLETE);
    assert_int_equal(bno055_uart_judge_read(good, 1, 2), BNO055_UART_INCOMPLETE);
    assert_int_equal(bno055_uart_judge_read(good, 3, 2), BNO055_UART_INCOMPLETE);
    assert_int_equal(bno055_uart_judge_read(good, 4, 2), BNO055_UART_OK);
    assert_int_equal(bno055_uart_judge_read(good, 4, 3), BNO055_UART_GARBAGE);
    assert_int_equal(bno055_uart_judge_read((const uint8_t[]){0xBB, 0}, 2, 0), BNO055_UART_GARBAGE);
    assert_int_equal(bno055_uart_judge_read((const uint8_t[]){0xDB}, 1, 2), BNO055_UART_GARBAGE);
    assert_int_equal(bno055_uart_judge_read((const uint8_t[]){0xEE, 7}, 2, 2), BNO055_UART_ERROR);
    assert_int_equal(bno055_uart_judge_read((const uint8_t[]){0xEE, 1}, 2, 2), BNO055_UART_GARBAGE);
    assert_int_equal(bno055_uart_judge_write(good, 4), BNO055_UART_GARBAGE);
    assert_int_equal(bno055_uart_judge_write(good, 0), BNO055_UART_INCOMPLETE);
    assert_int_equal(bno055_uart_judge_write((const uint8_t[]){0xEE}, 1), BNO055_UART_INCOMPLETE);
    assert_int_equal(bno055_uart_judge_write((const uint8_t[]){0xEE, 1}, 2), BNO055_UART_OK);
    assert_int_equal(bno055_uart_judge_write((const uint8_t[]){0xEE, 3}, 2), BNO055_UART_ERROR);
}

static struct {
    uint64_t now_us;
    const uint8_t *answer;
    uint8_t length, at, stale;
    uint8_t request[8];
    uint8_t requested;
    uint64_t written_us[4];
    uint8_t writes;
    bool is_blocked;
} line;

static bool line_write(void *context, const uint8_t *bytes, uint8_t length) {
    (void)context;
    if (line.is_blocked) {
        return false;
    }
    line.written_us[line.writes++] = line.now_us;
    memcpy(&line.request[line.requested], bytes, length);
    line.requested = (uint8_t)(line.requested + length);
    return true;
}

static bool line_read(void *context, uint8_t *byte) {
    (void)context;
    if (line.stale > 0U) {
        line.stale--;
        *byte = 0xBBU;
        return true;
    }
    if (line.requested < 4U || line.at >= line.length) {
        return false;
    }
    *byte = line.answer[line.at++];
    return true;
}

static uint64_t line_now(void *context) {
    (void)context;
    return line.now_us;
}

static void line_rest(void *context) {
    (void)context;
    line.now_us += 500U;
}

static const bno055_serial_t SERIAL = {
    .write = line_write, .read = line_read, .now_us = line_now, .rest = line_rest};

static void prepare(const uint8_t *answer, uint8_t length) {
    const uint64_t now_us = line.now_us;
    memset(&line, 0, sizeof line);
    line.now_us = now_us;
    line.answer = answer;
    line.length = length;
}

static void uart_transfers_pace_and_recover(void **state) {
    (void)state;
    bno055_uart_t uart = {.serial = &SERIAL};
    uint8_t data[2] = {0};
    prepare((const uint8_t[]){0xBB, 2, 0x12, 0x34}, 4U);
    line.stale = 5U;
    assert_true(bno055_uart_read(&uart, 0x14U, data, 2U));
    assert_memory_equal(line.request, ((const uint8_t[]){0xAA, 1, 0x14, 2}), 4U);
    assert_true(line.written_us[1] - line.written_us[0] >= BNO055_UART_PAIR_US);
    assert_int_equal(data[1], 0x34);
    prepare((const uint8_t[]){0xEE, 1}, 2U);
    assert_true(bno055_uart_write(&uart, 0x3DU, 0x0CU));
    assert_int_equal(line.requested, 5);
    prepare((const uint8_t[]){0xEE, 7}, 2U);
    assert_false(bno055_uart_read(&uart, 0x14U, data, 2U));
    assert_false(bno055_uart_timed_out(&uart));
    assert_int_equal(uart.overruns, 1);
    prepare((const uint8_t[]){0xBB, 2, 0, 0}, 4U);
    assert_false(bno055_uart_read(&uart, 0x14U, data, 2U)); /* still silent */
    assert_int_equal(line.requested, 0);
    line.now_us += BNO055_UART_SILENCE_US;
    assert_true(bno055_uart_read(&uart, 0x14U, data, 2U));
    prepare(NULL, 0U);
    const uint64_t begin_us = line.now_us;
    assert_false(bno055_uart_read(&uart, 0x14U, data, 2U));
    assert_true(bno055_uart_timed_out(&uart));
    assert_true(line.now_us - begin_us < 20000U);
    line.now_us += BNO055_UART_SILENCE_US;
    prepare(NULL, 0U);
    line.is_blocked = true;
    assert_false(bno055_uart_read(&uart, 0x14U, data, 2U));
    assert_false(bno055_uart_read(&uart, 0x14U, data, 0U));
    assert_false(bno055_uart_read(&uart, 0x14U, data, 33U));
}

static void uart_flood_ends(void **state) {
    (void)state;
    static uint8_t flood[200];
    bno055_uart_t uart = {.serial = &SERIAL};
    uint8_t data[32];
    memset(flood, 0xBB, sizeof flood);
    prepare(flood, 200U);
    line.stale = 255U;
    assert_false(bno055_uart_read(&uart, 0x14U, data, 32U));
}

static void clock_follows_offset_drift_and_steps(void **state) {
    (void)state;
    pod_clock_t clock = {0};
    const uint64_t start_us = 5000000U;
    const uint64_t epoch_us = 0x123456789ABU; /* needs more than 32 bits */
    assert_false(pod_clock_is_synced(&clock, start_us));
    /* A pod 80 ppm fast, a sync every 100 ms. */
    for (uint64_t i = 0; i < 100U; i++) {
        const uint64_t master_us = epoch_us + i * 100000U;
        const uint64_t local_us = start_us + i * 100008U;
        pod_clock_sync(&clock, (uint8_t)i, local_us);
        assert_true(pod_clock_follow_up(&clock, (uint8_t)i, master_us, local_us + 1000U));
    }
    assert_in_range(clock.drift_ppb, (uint64_t)-90000, (uint64_t)-70000);
    assert_true(clock.error_us >= -2 && clock.error_us <= 2);
    const uint64_t later_us = start_us + 100U * 100008U;
    const int64_t error_us =
        (int64_t)(pod_clock_master_us(&clock, later_us) - (epoch_us + 100U * 100000U));
    assert_true(error_us >= -2 && error_us <= 2);
    assert_true(pod_clock_is_synced(&clock, later_us));
    assert_false(pod_clock_is_synced(&clock, later_us + 6000000U));
    /* A follow-up for another sync, a second one for the same, and a late one. */
    pod_clock_sync(&clock, 7U, later_us);
    assert_false(pod_clock_follow_up(&clock, 8U, 0U, later_us));
    assert_false(pod_clock_follow_up(&clock, 7U, 0U, later_us + 2000000U));
    assert_true(pod_clock_follow_up(&clock, 7U, 0xFFFFFFFFFFFFU, later_us + 100U)); /* step */
    assert_false(pod_clock_is_synced(&clock, later_us));
    assert_int_equal(clock.error_us, POD_CLOCK_UNSYNCED);
    assert_false(pod_clock_follow_up(&clock, 7U, 0U, later_us + 100U));
    /* Ten days without a sync: no overflow, and the time starts over. */
    (void)pod_clock_master_us(&clock, later_us + 864000000000U);
    pod_clock_sync(&clock, 9U, later_us + 864000000000U);
    assert_true(pod_clock_follow_up(&clock, 9U, 1U, later_us + 864000000100U));
    assert_int_equal(clock.pairs, 1);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(crc_has_the_standard_check_value),
        cmocka_unit_test(slcan_opens_as_slcand_and_python_can_do_it),
        cmocka_unit_test(slcan_takes_whole_frames_only),
        cmocka_unit_test(slcan_writes_what_it_reads),
        cmocka_unit_test(uart_answers_are_judged),
        cmocka_unit_test(uart_transfers_pace_and_recover),
        cmocka_unit_test(uart_flood_ends),
        cmocka_unit_test(clock_follows_offset_drift_and_steps),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
