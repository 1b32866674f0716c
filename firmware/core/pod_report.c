/* What the pod reports: status once a second, one page of counters every 200 ms, identity
 * at start and every ten seconds. */
#include "../gen/pod_dbc.h"
#include "pod_parts.h"

#define STATUS_US 1000000U
#define COUNTERS_US 200000U
#define IDENTITY_US 10000000U
#define COUNTERS_PAGES 5U
#define IDENTITY_PARTS 6U
#define UID_PART_BYTES 6U
#define US_PER_S 1000000U

static uint64_t little_endian(const uint8_t *const bytes, const uint8_t length) {
    uint64_t value = 0U;
    for (uint8_t i = length; i > 0U; i--) {
        value = (value << 8) | bytes[i - 1U];
    }
    return value;
}

uint64_t pod_uid_part(const pod_t *const pod, const uint8_t part) {
    return little_endian(&pod->boot.uid[part * UID_PART_BYTES], UID_PART_BYTES);
}

static void send_identity_part(pod_t *const pod, const uint8_t part) {
    const uint8_t *const chip = pod->imu.unique_id;
    const struct pod_dbc_identity_t identity = {
        .part = part,
        .layout = POD_LAYOUT_VERSION,
        .fw_major = POD_VERSION_MAJOR,
        .fw_minor = POD_VERSION_MINOR,
        .fw_patch = POD_VERSION_PATCH,
        .reset_cause = (uint8_t)pod->boot.reset_cause,
        .refusal = (uint8_t)pod->refusal,
        .mcu_uid_0_5 = pod_uid_part(pod, 0U),
        .mcu_uid_6_11 = pod_uid_part(pod, 1U),
        .chip_uid_0_5 = little_endian(chip, UID_PART_BYTES),
        .chip_uid_6_11 = little_endian(&chip[UID_PART_BYTES], UID_PART_BYTES),
        .chip_uid_12_15 = (uint32_t)little_endian(&chip[2U * UID_PART_BYTES], 4U),
    };
    uint8_t payload[POD_DBC_IDENTITY_LENGTH];
    (void)pod_dbc_identity_pack(payload, &identity, sizeof payload);
    pod_queue_frame(pod, POD_MAILBOX_STATUS, POD_DBC_IDENTITY_FRAME_ID, payload,
                    (uint8_t)sizeof payload);
}

void pod_announce(pod_t *const pod) {
    for (uint8_t part = 0; part < IDENTITY_PARTS; part++) {
        send_identity_part(pod, part);
    }
}

static void send_status(pod_t *const pod, const uint64_t now_us) {
    const uint8_t calibration = pod->imu.calibration;
    const uint8_t temperature = pod->imu.temperature;
    const struct pod_dbc_status_t status = {
        .uptime_s = (uint32_t)((now_us - pod->boot_us) / US_PER_S) & 0xFFFFFFU,
        .mode = pod->imu.mode_read & 0x0FU,
        .state = (uint8_t)pod_state(pod),
        .calib_mag = calibration & 3U,
        .calib_accel = (calibration >> 2) & 3U,
        .calib_gyro = (calibration >> 4) & 3U,
        .calib_system = (calibration >> 6) & 3U,
        .temperature_degc = (int8_t)(temperature < 0x80U ? temperature : temperature - 0x100),
        .chip_error = pod->imu.system_error,
    };
    uint8_t payload[POD_DBC_STATUS_LENGTH];
    (void)pod_dbc_status_pack(payload, &status, sizeof payload);
    pod_queue_frame(pod, POD_MAILBOX_STATUS, POD_DBC_STATUS_FRAME_ID, payload,
                    (uint8_t)sizeof payload);
}

static void send_counters(pod_t *const pod) {
    const pod_counters_t *const own = &pod->counters;
    const bno055_counts_t *const chip = &pod->imu.counts;
    const struct pod_dbc_counters_t counters = {
        .page = pod->counters_page,
        .nak = chip->naks,
        .bus_timeout = chip->timeouts,
        .bus_recovery = own->bus_recoveries,
        .spike = chip->spikes,
        .frozen = chip->frozen,
        .reinit = chip->restarts,
        .can_tx_dropped = own->tx_dropped,
        .can_bus_off = own->bus_offs,
        .can_rx_bad = own->rx_bad,
        .watchdog_reset = pod->boot.watchdog_resets,
        .sample_late = own->sample_late,
        .sample_missed = own->sample_missed,
        .samples_sent = own->samples_sent,
        .config_refused = own->config_refused,
    };
    uint8_t payload[POD_DBC_COUNTERS_LENGTH];
    (void)pod_dbc_counters_pack(payload, &counters, sizeof payload);
    pod_queue_frame(pod, POD_MAILBOX_STATUS, POD_DBC_COUNTERS_FRAME_ID, payload,
                    (uint8_t)sizeof payload);
    pod->counters_page = (uint8_t)((pod->counters_page + 1U) % COUNTERS_PAGES);
}

/* A refused pod keeps to status and identity: the rightful owner uses the same identifiers. */
void pod_report(pod_t *const pod, const uint64_t now_us) {
    if (!pod->identity.has_listened) {
        return;
    }
    if (now_us >= pod->identity_us) {
        pod->identity_us = now_us + IDENTITY_US;
        pod_announce(pod);
    }
    if (now_us >= pod->status_us) {
        pod->status_us = now_us + STATUS_US;
        send_status(pod, now_us);
    }
    if (now_us >= pod->counters_us) {
        pod->counters_us = now_us + COUNTERS_US;
        if (pod->refusal == POD_REFUSAL_NONE) {
            send_counters(pod);
        }
    }
}
