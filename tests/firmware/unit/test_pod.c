/* The pod as a whole under the sanitizers: bring-up, faults, configuration, refusals, queues. */
#include "chip.h"
#include "cmocka_all.h"
#include "pod_dbc.h"

#define NODE 3U
#define GYRO (0x100U + NODE)
#define SAMPLE (0x130U + NODE)
#define REQUEST (0x200U + NODE)
#define REPLY (0x210U + NODE)
#define STATUS (0x280U + NODE)
#define COUNTERS (0x290U + NODE)
#define IDENTITY (0x300U + NODE)

static void request(pod_host_t *pod, uint8_t token, uint8_t key, uint32_t value) {
    const uint8_t body[6] = {token,           key,
                             (uint8_t)value,  (uint8_t)(value >> 8),
                             (uint8_t)(value >> 16), (uint8_t)(value >> 24)};
    rig_hear(pod, REQUEST, body, 7U);
}

static int result_of(uint8_t token) {
    const sent_t *const last = rig_last(REPLY);
    return last != NULL && last->data[0] == token ? last->data[6] : -1;
}

static void sync(pod_host_t *pod, uint8_t seq, uint8_t layout, bool is_trigger, uint64_t at_us) {
    const uint8_t body[3] = {seq, layout, is_trigger ? 1U : 0U};
    rig_hear(pod, 0x080U, body, 4U);
    uint8_t follow[7] = {seq};
    for (unsigned i = 0; i < 6U; i++) {
        follow[1U + i] = (uint8_t)(at_us >> (8U * i));
    }
    rig_hear(pod, 0x081U, follow, 8U);
}

static void brings_up_and_samples(void **state) {
    (void)state;
    pod_host_t *const pod = rig_pod(NODE);
    rig_run(pod, 3000000U);
    assert_int_equal(pod_host_state(pod), POD_STATE_RUNNING);
    assert_true(rig_sent_with(GYRO) > 200U);
    assert_int_equal(rig_sent_with(GYRO), rig_sent_with(SAMPLE));
    assert_int_equal(rig.pages[1][0x0A], 0x38);
    assert_int_equal(rig.pages[0][0x3D], BNO055_MODE_AMG);
    assert_true(rig_sent_with(IDENTITY) >= 12U);
    assert_true(pod_host_kicks(pod) > 200U);
    pod_host_free(pod);
}

static void gyro_frame_is_the_registers(void **state) {
    (void)state;
    pod_host_t *const pod = rig_pod(NODE);
    rig_run(pod, 2000000U);
    const sent_t *const last = rig_last(GYRO);
    struct pod_dbc_gyro_t gyro;
    assert_int_equal(pod_dbc_gyro_unpack(&gyro, last->data, 8U), 0);
    assert_int_equal(gyro.y, 2 * gyro.x);
    assert_int_equal(gyro.z, 3 * gyro.x);
    pod_host_free(pod);
}

static void survives_refusals(void **state) {
    (void)state;
    pod_host_t *const pod = rig_pod(NODE);
    rig_run(pod, 2000000U);
    assert_int_equal(rig.recoveries, 0);
    rig.refusals = 4;
    rig_run(pod, 1000000U);
    assert_int_equal(rig.recoveries, 1);
    assert_int_equal(pod_host_state(pod), POD_STATE_RUNNING);
    rig.refusals = 40; /* ten samples, then attempts of twelve accesses in 1.7 s each */
    rig_run(pod, 6000000U);
    assert_int_equal(pod_host_state(pod), POD_STATE_RUNNING);
    pod_host_free(pod);
}

static void waits_for_a_missing_chip(void **state) {
    (void)state;
    pod_host_t *const pod = rig_pod(NODE);
    rig.answer = POD_HOST_TIMED_OUT;
    rig_run(pod, 5000000U);
    assert_int_equal(pod_host_state(pod), POD_STATE_CHIP_MISSING);
    assert_int_equal(rig_sent_with(GYRO), 0);
    rig.answer = POD_HOST_DONE;
    rig.pages[0][0] = 0x55U;
    rig_run(pod, 500000U);
    assert_int_equal(pod_host_state(pod), POD_STATE_CHIP_MISSING);
    rig_run(pod, 5000000U); /* the reset of the next attempt brings the right id back */
    assert_int_equal(pod_host_state(pod), POD_STATE_RUNNING);
    pod_host_free(pod);
}

static void notices_a_brown_out_before_sending_zeros(void **state) {
    (void)state;
    pod_host_t *const pod = rig_pod(NODE);
    rig_run(pod, 2000000U);
    const unsigned before = rig.sent_count;
    rig_power_on();
    rig_run(pod, 500000U);
    for (unsigned i = before; i < rig.sent_count; i++) {
        if (rig.sent[i].id == GYRO) {
            assert_memory_not_equal(rig.sent[i].data, ((const uint8_t[6]){0}), 6U);
        }
    }
    rig_run(pod, 2000000U);
    assert_int_equal(pod_host_state(pod), POD_STATE_RUNNING);
    pod_host_free(pod);
}

static void screens_a_misread_top_bit(void **state) {
    (void)state;
    pod_host_t *const pod = rig_pod(NODE);
    rig_run(pod, 2000000U);
    const unsigned before = rig.sent_count;
    rig.flips = 1U;
    rig_run(pod, 100000U);
    for (unsigned i = before; i < rig.sent_count; i++) {
        if (rig.sent[i].id == GYRO) {
            assert_int_equal(rig.sent[i].data[5] & 0x80, 0);
        }
    }
    pod_host_free(pod);
}

static void a_step_seen_twice_is_believed(void **state) {
    (void)state;
    pod_host_t *const pod = rig_pod(NODE);
    rig_run(pod, 2000000U);
    rig.rate[0] = (int16_t)(rig.rate[0] + 20000);
    rig_run(pod, 50000U);
    struct pod_dbc_gyro_t gyro;
    (void)pod_dbc_gyro_unpack(&gyro, rig_last(GYRO)->data, 8U);
    assert_true(gyro.x > 19000);
    pod_host_free(pod);
}

static void frozen_data_are_flagged_and_counted(void **state) {
    (void)state;
    pod_host_t *const pod = rig_pod(NODE);
    rig_run(pod, 2000000U);
    rig.is_frozen = true;
    rig_run(pod, 3000000U);
    assert_int_equal(rig_last(SAMPLE)->data[1] & 0x80, 0x80);
    const sent_t *page = NULL;
    for (unsigned i = 0; i < rig.sent_count; i++) {
        page = rig.sent[i].id == COUNTERS && rig.sent[i].data[0] == 1U ? &rig.sent[i] : page;
    }
    assert_true(page->data[3] >= 4U);
    pod_host_free(pod);
}

static void a_full_queue_drops_the_oldest(void **state) {
    (void)state;
    pod_host_t *const pod = rig_pod(NODE);
    rig_run(pod, 2000000U);
    rig.is_can_busy = true;
    rig_run(pod, 1000000U);
    rig.is_can_busy = false;
    rig.sent_count = 0U;
    (void)pod_host_step(pod);
    assert_int_equal(rig_sent_with(GYRO), 16);
    /* What is left is in order and the newest. */
    unsigned expected = rig.sent[0].data[6];
    for (unsigned i = 0; i < 32U; i += 2U) {
        assert_int_equal(rig.sent[i].id, GYRO);
        assert_int_equal(rig.sent[i].data[6], expected & 0xFFU);
        assert_int_equal(rig.sent[i + 1U].id, SAMPLE);
        assert_int_equal(rig.sent[i + 1U].data[0], expected & 0xFFU);
        expected++;
    }
    pod_host_free(pod);
}

static void rejoins_after_bus_off_ever_more_slowly(void **state) {
    (void)state;
    pod_host_t *const pod = rig_pod(NODE);
    rig_run(pod, 2000000U);
    const uint64_t waits_us[] = {100000U, 200000U, 400000U, 800000U, 1600000U, 3200000U, 3200000U};
    for (unsigned i = 0; i < 7U; i++) {
        pod_host_set_bus_off(pod, true);
        const uint64_t begin_us = rig.now_us;
        while (pod_host_is_bus_off(pod)) {
            rig_run(pod, 1000U);
        }
        const uint64_t took_us = rig.now_us - begin_us;
        assert_true(took_us >= waits_us[i] && took_us < waits_us[i] + 30000U);
        rig_run(pod, 250000U); /* it is given time to rejoin before it is judged again */
    }
    rig_run(pod, 11000000U);
    pod_host_set_bus_off(pod, true);
    rig_run(pod, 130000U);
    assert_false(pod_host_is_bus_off(pod));
    pod_host_free(pod);
}

static void takes_every_setting_and_refuses_nonsense(void **state) {
    (void)state;
    static const struct {
        uint8_t key;
        uint32_t value;
        int result;
    } cases[] = {
        {1, 50, 0},   {1, 0, 2},    {1, 201, 2}, {1, 100, 0}, {2, 500, 0},  {2, 501, 2},
        {3, 116, 0},  {3, 0, 2},    {4, 3, 0},   {4, 4, 2},   {5, 3, 0},    {5, 12, 0},
        {2, 250, 5},  {3, 47, 5},   {5, 8, 0},   {5, 7, 0},   {5, 6, 2},    {6, 1, 0},
        {6, 0, 0},    {6, 2, 2},    {7, 9, 0},   {7, 16, 2},  {9, 0, 0},    {10, 1, 0},
        {10, 0, 0},   {10, 2, 2},   {11, 0, 1},  {255, 7, 1}, {8, 1, 2},    {5, 7, 0},
    };
    pod_host_t *const pod = rig_pod(NODE);
    rig_run(pod, 2000000U);
    for (uint8_t i = 0; i < sizeof cases / sizeof cases[0]; i++) {
        request(pod, (uint8_t)(i + 1U), cases[i].key, cases[i].value);
        rig_run(pod, 1500000U);
        assert_int_equal(result_of((uint8_t)(i + 1U)), cases[i].result);
        rig.sent_count = 0U;
    }
    assert_int_equal(rig.stored_node, 9);
    /* 500 deg/s and 116 Hz, asked for before, came back with the raw mode. */
    assert_int_equal(rig.pages[1][0x0A], 2U | (2U << 3));
    pod_host_free(pod);
}

static void answers_busy_reset_and_a_full_store(void **state) {
    (void)state;
    pod_host_t *const pod = rig_pod(NODE);
    rig_run(pod, 2000000U);
    request(pod, 1U, 2U, 1000U);
    request(pod, 1U, 2U, 1000U); /* asked again: one answer, when it is there */
    request(pod, 2U, 2U, 2000U);
    assert_int_equal(result_of(2U), 4);
    rig_run(pod, 200000U);
    assert_int_equal(result_of(1U), 0);
    rig.is_store_full = true;
    request(pod, 3U, 7U, 5U);
    assert_int_equal(result_of(3U), 3);
    rig.answer = POD_HOST_REFUSED; /* the chip goes silent during a change */
    request(pod, 4U, 2U, 125U);
    rig_run(pod, 3500000U);
    assert_int_equal(result_of(4U), 5);
    request(pod, 5U, 8U, 0x52535421U);
    assert_int_equal(result_of(5U), 0);
    assert_int_equal(rig.resets, 0);
    rig_run(pod, 50000U);
    assert_int_equal(rig.resets, 1);
    pod_host_free(pod);
}

static void a_pod_without_number_waits_for_one(void **state) {
    (void)state;
    pod_host_t *const pod = rig_pod(POD_NODE_NONE);
    rig_run(pod, 2000000U);
    assert_int_equal(pod_host_refusal(pod), POD_REFUSAL_NO_NODE);
    assert_int_equal(rig_sent_with(0x10FU), 0);
    assert_true(rig_sent_with(0x30FU) > 0U);
    const uint8_t body[6] = {1U, 7U, 4U, 0U, 0U, 0U};
    rig_hear(pod, 0x20FU, body, 7U);
    assert_int_equal(rig.stored_node, 4);
    const uint8_t rate[6] = {2U, 1U, 50U, 0U, 0U, 0U};
    rig_hear(pod, 0x20FU, rate, 7U);
    assert_int_equal(rig_last(0x21FU)->data[6], 5);
    pod_host_restart(pod, 4U, POD_RESET_SOFTWARE, 0U);
    rig_run(pod, 2000000U);
    assert_int_equal(pod_host_refusal(pod), POD_REFUSAL_NONE);
    pod_host_free(pod);
}

static void a_newcomer_gives_way(void **state) {
    (void)state;
    const uint8_t gyro[7] = {0};
    pod_host_t *const pod = rig_pod(NODE);
    rig_run(pod, 100000U);
    rig_hear(pod, GYRO, gyro, 8U);
    assert_int_equal(pod_host_refusal(pod), POD_REFUSAL_DUPLICATE);
    rig_run(pod, 3000000U);
    assert_int_equal(rig_sent_with(GYRO), 0);
    assert_int_equal(rig_last(IDENTITY - 0U)->length, 8);
    request(pod, 7U, 9U, 0U); /* is for the other one */
    assert_int_equal(result_of(7U), -1);
    pod_host_free(pod);
}

static void of_two_that_run_the_lower_id_stays(void **state) {
    (void)state;
    pod_host_t *const pod = rig_pod(NODE); /* unique id 1, 2, 3 .. */
    rig_run(pod, 2000000U);
    const uint8_t gyro[7] = {0};
    const unsigned announced = rig_sent_with(IDENTITY);
    rig_hear(pod, GYRO, gyro, 8U);
    rig_hear(pod, GYRO, gyro, 8U);
    assert_int_equal(rig_sent_with(IDENTITY), announced + 6U); /* once, not for every frame */
    const uint8_t lower[7] = {1U};
    rig_hear(pod, IDENTITY, lower, 8U); /* of a pod that has not said whether it runs */
    assert_int_equal(pod_host_refusal(pod), POD_REFUSAL_NONE);
    const uint8_t runs[7] = {0U, 1U, 1U, 0U, 0U, 1U, POD_REFUSAL_NONE};
    rig_hear(pod, IDENTITY, runs, 8U);
    const uint8_t higher[7] = {1U, 1U, 2U, 3U, 4U, 5U, 7U};
    rig_hear(pod, IDENTITY, higher, 8U);
    assert_int_equal(pod_host_refusal(pod), POD_REFUSAL_NONE);
    const uint8_t same[7] = {1U, 1U, 2U, 3U, 4U, 5U, 6U};
    const uint8_t second_higher[7] = {2U, 7U, 8U, 9U, 10U, 11U, 13U};
    rig_hear(pod, IDENTITY, same, 8U);
    rig_hear(pod, IDENTITY, second_higher, 8U);
    assert_int_equal(pod_host_refusal(pod), POD_REFUSAL_NONE);
    const uint8_t second_lower[7] = {2U, 7U, 8U, 9U, 10U, 11U, 11U};
    rig_hear(pod, IDENTITY, same, 8U);
    rig_hear(pod, IDENTITY, second_lower, 8U);
    assert_int_equal(pod_host_refusal(pod), POD_REFUSAL_DUPLICATE);
    pod_host_free(pod);
}

static void a_refused_pod_takes_no_number(void **state) {
    (void)state;
    const uint8_t refused[7] = {0U, 1U, 1U, 0U, 0U, 1U, POD_REFUSAL_DUPLICATE};
    const uint8_t lower[7] = {1U};
    const uint8_t status[7] = {0U, 0U, 0U, POD_STATE_REFUSED << 4};
    pod_host_t *const pod = rig_pod(NODE);
    rig_run(pod, 100000U); /* still listening */
    rig_hear(pod, IDENTITY, refused, 8U);
    rig_hear(pod, IDENTITY, lower, 8U);
    rig_hear(pod, STATUS, status, 8U);
    rig_hear(pod, REPLY, status, 8U);
    rig_run(pod, 2000000U);
    const unsigned announced = rig_sent_with(IDENTITY);
    rig_hear(pod, IDENTITY, refused, 8U);
    rig_hear(pod, IDENTITY, lower, 8U);
    assert_int_equal(pod_host_state(pod), POD_STATE_RUNNING);
    assert_int_equal(rig_sent_with(IDENTITY), announced); /* nobody to answer */
    pod_host_free(pod);
}

static void another_layout_is_refused_until_it_is_right(void **state) {
    (void)state;
    pod_host_t *const pod = rig_pod(NODE);
    rig_run(pod, 2000000U);
    sync(pod, 1U, 2U, false, 0U);
    sync(pod, 2U, 2U, false, 0U);
    assert_int_equal(pod_host_refusal(pod), POD_REFUSAL_NONE);
    sync(pod, 3U, 2U, false, 0U);
    assert_int_equal(pod_host_refusal(pod), POD_REFUSAL_LAYOUT);
    rig.sent_count = 0U;
    rig_run(pod, 1000000U);
    assert_int_equal(rig_sent_with(GYRO), 0);
    for (uint8_t i = 4U; i < 7U; i++) {
        sync(pod, i, 1U, false, 1000000U);
    }
    rig_run(pod, 1000000U);
    assert_true(rig_sent_with(GYRO) > 90U);
    pod_host_free(pod);
}

static void triggers_sample_and_their_silence_does_not_stop_it(void **state) {
    (void)state;
    pod_host_t *const pod = rig_pod(NODE);
    rig_run(pod, 2000000U);
    request(pod, 1U, 6U, 1U);
    rig.sent_count = 0U;
    for (uint8_t i = 0U; i < 50U; i++) {
        sync(pod, i, 1U, true, rig.now_us);
        rig_run(pod, 10000U);
    }
    assert_in_range(rig_sent_with(GYRO), 49U, 55U);
    assert_int_equal(rig_last(SAMPLE)->data[1] & 0x40, 0x40);
    rig.sent_count = 0U;
    rig_run(pod, 1000000U);
    assert_in_range(rig_sent_with(GYRO), 94U, 97U);
    assert_int_equal(rig_last(SAMPLE)->data[1] & 0x40, 0);
    pod_host_free(pod);
}

static void frames_without_room_are_counted(void **state) {
    (void)state;
    pod_host_t *const pod = rig_pod(NODE);
    rig_run(pod, 2000000U);
    const uint8_t junk[8] = {0};
    for (unsigned i = 0; i < POD_HOST_RECEIVE_FRAMES + 7U; i++) {
        (void)pod_host_receive(pod, 0x7F0U, false, false, junk, 8U, rig.now_us);
    }
    rig_run(pod, 1200000U);
    const sent_t *page = NULL;
    for (unsigned i = 0; i < rig.sent_count; i++) {
        page = rig.sent[i].id == COUNTERS && rig.sent[i].data[0] == 2U ? &rig.sent[i] : page;
    }
    assert_int_equal(page->data[5], 7);
    pod_host_free(pod);
}

static void a_flood_does_not_stop_sampling(void **state) {
    (void)state;
    pod_host_t *const pod = rig_pod(NODE);
    rig_run(pod, 2000000U);
    rig.sent_count = 0U;
    const uint8_t junk[8] = {0};
    const uint64_t end_us = rig.now_us + 1000000U;
    while (rig.now_us < end_us) {
        for (unsigned i = 0; i < 8U; i++) {
            (void)pod_host_receive(pod, 0x080U, false, false, junk, 8U, rig.now_us);
        }
        (void)pod_host_step(pod);
        rig.now_us += 1000U;
    }
    assert_in_range(rig_sent_with(GYRO), 99U, 101U);
    pod_host_free(pod);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(brings_up_and_samples),
        cmocka_unit_test(gyro_frame_is_the_registers),
        cmocka_unit_test(survives_refusals),
        cmocka_unit_test(waits_for_a_missing_chip),
        cmocka_unit_test(notices_a_brown_out_before_sending_zeros),
        cmocka_unit_test(screens_a_misread_top_bit),
        cmocka_unit_test(a_step_seen_twice_is_believed),
        cmocka_unit_test(frozen_data_are_flagged_and_counted),
        cmocka_unit_test(a_full_queue_drops_the_oldest),
        cmocka_unit_test(rejoins_after_bus_off_ever_more_slowly),
        cmocka_unit_test(takes_every_setting_and_refuses_nonsense),
        cmocka_unit_test(answers_busy_reset_and_a_full_store),
        cmocka_unit_test(a_pod_without_number_waits_for_one),
        cmocka_unit_test(a_newcomer_gives_way),
        cmocka_unit_test(of_two_that_run_the_lower_id_stays),
        cmocka_unit_test(a_refused_pod_takes_no_number),
        cmocka_unit_test(another_layout_is_refused_until_it_is_right),
        cmocka_unit_test(triggers_sample_and_their_silence_does_not_stop_it),
        cmocka_unit_test(frames_without_room_are_counted),
        cmocka_unit_test(a_flood_does_not_stop_sampling),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
