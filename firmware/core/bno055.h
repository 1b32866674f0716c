/* One BNO055 behind any register port: bring-up with verification, burst reads, screening of
 * impossible jumps, a watch over mode and error registers, and re-initialisation.
 * Nothing waits: bno055_step() does the step that is due. Called by pod_imu.c only.
 */
#ifndef BNO055_H
#define BNO055_H

#include <stdbool.h>
#include <stdint.h>

#define BNO055_AXES 3U
#define BNO055_UID_BYTES 16U
/* Settling times, data sheet Tables 0-2 and 3-6 with the margin of the Linux driver. */
#define BNO055_RESET_US 700000U
#define BNO055_MODE_US 20000U
/* A chip that does not answer is asked again after this long. */
#define BNO055_RETRY_US 100000U
#define BNO055_WATCH_US 1000000U
/* Failed accesses in a row before the bus is freed, and before the chip is brought up again. */
#define BNO055_FAILURES_RECOVER 3U
#define BNO055_FAILURES_RESTART 10U
/* A step between samples that is a misread top bit rather than a wing: half of full scale. */
#define BNO055_STEP_LIMIT 16384
/* A chip with its normal noise does not repeat one triple this often. */
#define BNO055_REPEATS_FROZEN 50U

#define BNO055_MODE_CONFIG 0x00U
#define BNO055_MODE_GYRONLY 0x03U
#define BNO055_MODE_AMG 0x07U
#define BNO055_MODE_IMU 0x08U
#define BNO055_MODE_NDOF 0x0CU

typedef struct {
    void *context;
    bool (*read)(void *context, uint8_t first, uint8_t *data, uint8_t length);
    bool (*write)(void *context, uint8_t target, uint8_t value);
    bool (*timed_out)(void *context); /* why the last access failed: no end, or a refusal */
    /* False while the line has to rest after an error: asking would only prolong that. */
    bool (*is_ready)(void *context);
    uint64_t (*now_us)(void *context);
} bno055_port_t;

typedef struct {
    uint8_t mode;
    uint8_t range;     /* GYR_CONFIG_0 bits 0-2: 0 = 2000 deg/s .. 4 = 125 deg/s */
    uint8_t bandwidth; /* GYR_CONFIG_0 bits 3-5: 7 = 32 Hz */
    bool external_crystal;
} bno055_settings_t;

typedef struct {
    int16_t rate[BNO055_AXES];
    int16_t force[BNO055_AXES];
    int16_t field[BNO055_AXES];
    uint64_t measured_us; /* middle of the burst, local time */
    bool repeated;
} bno055_sample_t;

typedef enum {
    BNO055_STATE_RESET,
    BNO055_STATE_IDENTIFY,
    BNO055_STATE_CONFIGURE,
    BNO055_STATE_START,
    BNO055_STATE_VERIFY,
    BNO055_STATE_RUNNING
} bno055_state_t;

/* What the last bring-up or watch failed on; the configuration reply reports it. */
typedef enum {
    BNO055_FAULT_NONE,
    BNO055_FAULT_BUS,     /* no answer */
    BNO055_FAULT_CHIP_ID, /* something else answers */
    BNO055_FAULT_VERIFY,  /* a setting did not read back */
    BNO055_FAULT_MODE,    /* not in its measuring mode: brown-out */
    BNO055_FAULT_SYSTEM   /* SYS_ERR is set */
} bno055_fault_t;

typedef struct {
    uint16_t naks;
    uint16_t timeouts;
    uint16_t spikes;
    uint16_t frozen;
    uint16_t restarts; /* bring-ups that a fault made necessary */
} bno055_counts_t;

typedef struct {
    const bno055_port_t *port;
    bno055_settings_t settings;
    bno055_state_t state;
    bno055_fault_t fault;
    bno055_counts_t counts;
    uint64_t resume_us;
    uint64_t watch_us;
    int16_t last_rate[BNO055_AXES];
    bool has_last;
    bool wants_recovery; /* the owner frees the bus and clears this */
    uint8_t failures;
    uint8_t attempts;
    uint8_t repeats;
    uint8_t mode_read;
    uint8_t system_error;
    uint8_t temperature;
    uint8_t calibration;
    uint8_t unique_id[BNO055_UID_BYTES];
} bno055_t;

void bno055_init(bno055_t *imu, const bno055_port_t *port, const bno055_settings_t *settings);
/* Does the step of bring-up that is due, or the watch if it is due and `may_watch`; returns
 * whether the chip measures. */
bool bno055_step(bno055_t *imu, uint64_t now_us, bool may_watch);
/* Burst-reads, stamps and screens one sample; false if none is valid. */
bool bno055_sample(bno055_t *imu, bool all_sensors, bno055_sample_t *sample);
/* Takes new settings to a chip that is alive, without resetting it. */
void bno055_configure(bno055_t *imu, const bno055_settings_t *settings, uint64_t now_us);
bool bno055_is_fusion(uint8_t mode);

#endif
