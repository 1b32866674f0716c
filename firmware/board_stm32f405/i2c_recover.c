/* The pins of I2C1, and freeing them from a chip that holds them. */
#include "board.h"

#define SCL_PIN 6U /* PB6, PB7: SCL and SDA of the Feather */
#define SDA_PIN 7U
#define AF_I2C 4U
#define RECOVERY_CLOCKS 9U
#define HALF_CLOCK_US 5U

void i2c_set_pins(const pin_mode_t mode) {
    const pin_config_t line = {
        .mode = mode, .is_open_drain = true, .has_pull_up = true, .alternate = AF_I2C};
    gpio_set(GPIOB, SCL_PIN, &line);
    gpio_set(GPIOB, SDA_PIN, &line);
}

static void drive(const uint8_t pin, const bool is_high) {
    gpio_write(GPIOB, pin, is_high);
    ticks_wait_us(HALF_CLOCK_US);
}

/* A chip that was cut off in a byte holds SDA until it has clocked the byte out. */
bool i2c_recover(void *const context) {
    const i2c_t *const i2c = context;
    I2C1->cr1 = 0U;
    gpio_write(GPIOB, SCL_PIN, true);
    gpio_write(GPIOB, SDA_PIN, true);
    i2c_set_pins(PIN_OUTPUT);
    for (uint8_t i = 0; i < RECOVERY_CLOCKS && !gpio_read(GPIOB, SDA_PIN); i++) {
        drive(SCL_PIN, false);
        drive(SCL_PIN, true);
    }
    drive(SCL_PIN, false);
    drive(SDA_PIN, false);
    drive(SCL_PIN, true);
    drive(SDA_PIN, true);
    const bool is_free = gpio_read(GPIOB, SDA_PIN) && gpio_read(GPIOB, SCL_PIN);
    i2c_configure(i2c);
    return is_free;
}
