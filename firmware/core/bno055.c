/* Bring-up, watch and re-initialisation; see bno055.h. */
#include "bno055.h"

#include "bno055_internal.h"
#include "bno055_registers.h"

#define ID_BYTES 4U
#define IDENTIFY_ATTEMPTS 10U
/* One burst from TEMP to OPR_MODE serves the watch. */
#define WATCH_BYTES (BNO055_OPR_MODE - BNO055_TEMP + 1U)

_Static_assert(WATCH_BYTES == 10U, "the watch burst ends at OPR_MODE");

bool bno055_is_fusion(const uint8_t mode) { return mode > BNO055_MODE_AMG; }

void bno055_init(bno055_t *const imu, const bno055_port_t *const port,
                 const bno055_settings_t *const settings) {
    *imu = (bno055_t){.port = port, .settings = *settings, .state = BNO055_STATE_RESET};
}

void bno055_configure(bno055_t *const imu, const bno055_settings_t *const settings,
                      const uint64_t now_us) {
    imu->settings = *settings;
    imu->fault = BNO055_FAULT_NONE;
    imu->has_last = false;
    imu->attempts = 0U;
    if (imu->state != BNO055_STATE_RESET) {
        imu->state = BNO055_STATE_IDENTIFY;
        imu->resume_us = now_us;
    }
}

static void fail(bno055_t *const imu, const bno055_fault_t fault) {
    imu->fault = fault;
    imu->state = BNO055_STATE_RESET;
    imu->has_last = false;
    imu->attempts = 0U;
    imu->failures = 0U;
    bno055_count(&imu->counts.restarts);
}

static void go(bno055_t *const imu, const bno055_state_t state, const uint64_t resume_us) {
    imu->state = state;
    imu->resume_us = resume_us;
}

/* The chip may be absent, hung or still starting, so these writes may fail uncounted. */
static void reset(bno055_t *const imu, const uint64_t now_us) {
    const bno055_port_t *const port = imu->port;
    (void)port->write(port->context, BNO055_PAGE_ID, 0U);
    (void)port->write(port->context, BNO055_SYS_TRIGGER, BNO055_TRIGGER_RESET);
    go(imu, BNO055_STATE_IDENTIFY, now_us + BNO055_RESET_US);
}

static void retry_identify(bno055_t *const imu, const bno055_fault_t fault, const uint64_t now_us) {
    imu->fault = fault;
    imu->attempts++;
    if (imu->attempts >= IDENTIFY_ATTEMPTS) {
        fail(imu, fault);
        imu->wants_recovery = true;
    }
    imu->resume_us = now_us + BNO055_RETRY_US;
}

static void identify(bno055_t *const imu, const uint64_t now_us) {
    uint8_t ids[ID_BYTES] = {0};
    const bool has_answered = bno055_write(imu, BNO055_PAGE_ID, 0U) &&
                              bno055_read(imu, BNO055_CHIP_ID, ids, ID_BYTES);
    if (has_answered && (ids[0] != BNO055_CHIP_ID_VALUE || ids[1] != BNO055_ACC_ID_VALUE ||
                         ids[2] != BNO055_MAG_ID_VALUE || ids[3] != BNO055_GYR_ID_VALUE)) {
        retry_identify(imu, BNO055_FAULT_CHIP_ID, now_us);
    } else if (!has_answered || !bno055_write(imu, BNO055_OPR_MODE, BNO055_MODE_CONFIG)) {
        retry_identify(imu, BNO055_FAULT_BUS, now_us);
    } else {
        go(imu, BNO055_STATE_CONFIGURE, now_us + BNO055_MODE_US);
    }
}

static bool write_settings(bno055_t *const imu) {
    const bno055_settings_t *const set = &imu->settings;
    const uint8_t gyro = (uint8_t)(set->range | (set->bandwidth << 3));
    const uint8_t trigger = set->external_crystal ? BNO055_TRIGGER_CRYSTAL : 0U;
    uint8_t gyro_read = 0U;
    uint8_t units_read = 0xFFU;
    if (!(bno055_write(imu, BNO055_PWR_MODE, 0U) &&
          bno055_write(imu, BNO055_UNIT_SEL, BNO055_UNITS_VALUE) &&
          bno055_read(imu, BNO055_UNIT_SEL, &units_read, 1U) &&
          bno055_write(imu, BNO055_PAGE_ID, 1U) &&
          bno055_write(imu, BNO055_PAGE1_GYR_CONFIG_0, gyro) &&
          bno055_read(imu, BNO055_PAGE1_GYR_CONFIG_0, &gyro_read, 1U) &&
          bno055_read(imu, BNO055_PAGE1_UNIQUE_ID, imu->unique_id, BNO055_UID_BYTES) &&
          bno055_write(imu, BNO055_PAGE_ID, 0U) &&
          bno055_write(imu, BNO055_SYS_TRIGGER, trigger))) {
        imu->fault = BNO055_FAULT_BUS;
        return false;
    }
    imu->fault = BNO055_FAULT_VERIFY;
    return gyro_read == gyro && units_read == BNO055_UNITS_VALUE;
}

static void configure(bno055_t *const imu, const uint64_t now_us) {
    if (!write_settings(imu)) {
        fail(imu, imu->fault);
        imu->resume_us = now_us + BNO055_RETRY_US;
        return;
    }
    /* The switch to the crystal takes as long as a reset (data sheet Sec. 5.5). */
    const uint64_t settle_us = imu->settings.external_crystal ? BNO055_RESET_US : 0U;
    go(imu, BNO055_STATE_START, now_us + settle_us);
}

static void start(bno055_t *const imu, const uint64_t now_us) {
    if (!bno055_write(imu, BNO055_OPR_MODE, imu->settings.mode)) {
        fail(imu, BNO055_FAULT_BUS);
        imu->resume_us = now_us + BNO055_RETRY_US;
        return;
    }
    go(imu, BNO055_STATE_VERIFY, now_us + BNO055_MODE_US);
}

static bool is_in_mode(const bno055_t *const imu) {
    return (imu->mode_read & BNO055_MODE_MASK) == imu->settings.mode;
}

bool bno055_check_mode(bno055_t *const imu) {
    if (!bno055_read(imu, BNO055_OPR_MODE, &imu->mode_read, 1U)) {
        return false;
    }
    if (!is_in_mode(imu)) {
        fail(imu, BNO055_FAULT_MODE);
        imu->resume_us = 0U;
    }
    return imu->state == BNO055_STATE_RUNNING;
}

/* Reads mode, error, temperature and calibration; false if the chip must be brought up again. */
static bool watch(bno055_t *const imu, const uint64_t now_us) {
    uint8_t bytes[WATCH_BYTES] = {0};
    imu->watch_us = now_us + BNO055_WATCH_US;
    if (!bno055_read(imu, BNO055_TEMP, bytes, WATCH_BYTES)) {
        imu->fault = BNO055_FAULT_BUS;
        return imu->state == BNO055_STATE_RUNNING;
    }
    imu->temperature = bytes[0];
    imu->calibration = bytes[BNO055_CALIB_STAT - BNO055_TEMP];
    imu->system_error = bytes[BNO055_SYS_ERR - BNO055_TEMP];
    imu->mode_read = bytes[BNO055_OPR_MODE - BNO055_TEMP];
    if (!is_in_mode(imu)) {
        imu->fault = BNO055_FAULT_MODE;
        return false;
    }
    imu->fault = imu->system_error == 0U ? BNO055_FAULT_NONE : BNO055_FAULT_SYSTEM;
    return imu->fault == BNO055_FAULT_NONE;
}

static void supervise(bno055_t *const imu, const uint64_t now_us, const bool may_watch) {
    const bool is_due =
        imu->state == BNO055_STATE_VERIFY || (may_watch && now_us >= imu->watch_us);
    if ((is_due && !watch(imu, now_us)) || imu->failures >= BNO055_FAILURES_RESTART) {
        fail(imu, imu->fault == BNO055_FAULT_NONE ? BNO055_FAULT_BUS : imu->fault);
        imu->resume_us = now_us;
        return;
    }
    imu->state = BNO055_STATE_RUNNING;
}

bool bno055_step(bno055_t *const imu, const uint64_t now_us, const bool may_watch) {
    if (!imu->port->is_ready(imu->port->context)) {
        return imu->state == BNO055_STATE_RUNNING;
    }
    if (imu->state != BNO055_STATE_RUNNING && now_us < imu->resume_us) {
        return false;
    }
    switch (imu->state) {
    case BNO055_STATE_RESET:
        reset(imu, now_us);
        break;
    case BNO055_STATE_IDENTIFY:
        identify(imu, now_us);
        break;
    case BNO055_STATE_CONFIGURE:
        configure(imu, now_us);
        break;
    case BNO055_STATE_START:
        start(imu, now_us);
        break;
    case BNO055_STATE_VERIFY:
    case BNO055_STATE_RUNNING:
    default:
        supervise(imu, now_us, may_watch);
        break;
    }
    return imu->state == BNO055_STATE_RUNNING;
}
