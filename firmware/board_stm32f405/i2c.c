/* I2C1 as master to one BNO055 (RM0090 Sec. 27.3.3), polled with one deadline for a transfer.
 * The chip stretches the clock by about 180 us a byte, so 18 bytes may take 4 ms.
 */
#include "board.h"

#define ADDRESS 0x28U /* BNO055 with COM3 low */
#define TRANSFER_US 10000U
#define BUS_HZ 400000U
#define ERRORS (I2C_SR1_AF | I2C_SR1_ARLO | I2C_SR1_BERR)

void i2c_configure(const i2c_t *const i2c) {
    i2c_set_pins(PIN_ALTERNATE);
    const uint32_t mhz = i2c->apb1_hz / 1000000U;
    I2C1->cr1 = I2C_CR1_SWRST;
    I2C1->cr1 = 0U;
    I2C1->cr2 = mhz;
    /* Fast mode, low twice as long as high; longest rise 300 ns (Sec. 27.6.8, 27.6.9). */
    I2C1->ccr = I2C_CCR_FAST | (i2c->apb1_hz / (3U * BUS_HZ));
    I2C1->trise = mhz * 300U / 1000U + 1U;
    I2C1->cr1 = I2C_CR1_PE;
}

void i2c_start(i2c_t *const i2c, const clocks_t *const clocks) {
    i2c->apb1_hz = clocks->apb1_hz;
    RCC->apb1enr |= RCC_APB1_I2C1;
    i2c_configure(i2c);
}

/* Waits for a status flag until the transfer's deadline; an error flag ends it at once. */
static bool await(i2c_t *const i2c, const uint32_t flag) {
    for (;;) {
        const uint32_t status = I2C1->sr1;
        if ((status & ERRORS) != 0U) {
            return false;
        }
        if ((status & flag) != 0U) {
            return true;
        }
        if (ticks_now_us(NULL) >= i2c->deadline_us) {
            i2c->is_timeout = true;
            return false;
        }
    }
}

/* Until START and STOP are out, CR1 must not be written (Sec. 27.6.1). */
static bool is_control_busy(void) { return (I2C1->cr1 & (I2C_CR1_START | I2C_CR1_STOP)) != 0U; }

static bool await_control(i2c_t *const i2c) {
    while (is_control_busy()) {
        if (ticks_now_us(NULL) >= i2c->deadline_us) {
            i2c->is_timeout = true;
            return false;
        }
    }
    return true;
}

static bool send_start(i2c_t *const i2c) {
    I2C1->cr1 |= I2C_CR1_START;
    return await(i2c, I2C_SR1_SB);
}

/* ADDR is cleared by reading SR1, then SR2. */
static void clear_address(void) {
    (void)I2C1->sr1;
    (void)I2C1->sr2;
}

static bool begin(i2c_t *const i2c, const uint8_t target) {
    i2c->is_timeout = false;
    i2c->deadline_us = ticks_now_us(NULL) + TRANSFER_US;
    if (!await_control(i2c)) {
        return false;
    }
    I2C1->sr1 = 0U;
    I2C1->cr1 &= ~I2C_CR1_POS;
    if (!send_start(i2c)) {
        return false;
    }
    I2C1->dr = ADDRESS << 1;
    if (!await(i2c, I2C_SR1_ADDR)) {
        return false;
    }
    clear_address();
    I2C1->dr = target;
    return await(i2c, I2C_SR1_BTF);
}

/* A START or STOP that does not get out cannot be taken back: only a reset ends it. */
static bool fail(const i2c_t *const i2c) {
    if (is_control_busy()) {
        i2c_configure(i2c);
    } else {
        I2C1->cr1 |= I2C_CR1_STOP;
    }
    I2C1->sr1 = 0U;
    return false;
}

/* One byte: no acknowledge, and STOP asked for before the byte is taken. */
static bool take_one(i2c_t *const i2c, uint8_t *const data) {
    I2C1->cr1 &= ~I2C_CR1_ACK;
    clear_address();
    I2C1->cr1 |= I2C_CR1_STOP;
    if (!await(i2c, I2C_SR1_RXNE)) {
        return false;
    }
    data[0] = (uint8_t)I2C1->dr;
    return true;
}

/* The last two wait for BTF, with one byte in DR and one in the shift register, so that no
 * interrupt between can let a byte too many in. */
static bool take_last_two(i2c_t *const i2c, uint8_t *const data) {
    if (!await(i2c, I2C_SR1_BTF)) {
        return false;
    }
    I2C1->cr1 |= I2C_CR1_STOP;
    data[0] = (uint8_t)I2C1->dr;
    data[1] = (uint8_t)I2C1->dr;
    return true;
}

static bool take_two(i2c_t *const i2c, uint8_t *const data) {
    I2C1->cr1 = (I2C1->cr1 | I2C_CR1_POS) & ~I2C_CR1_ACK;
    clear_address();
    return take_last_two(i2c, data);
}

static bool take_many(i2c_t *const i2c, uint8_t *const data, const uint8_t length) {
    uint8_t at = 0U;
    I2C1->cr1 |= I2C_CR1_ACK;
    clear_address();
    for (; at + 3U < length; at++) {
        if (!await(i2c, I2C_SR1_RXNE)) {
            return false;
        }
        data[at] = (uint8_t)I2C1->dr;
    }
    /* Three left: when two are in, the third gets no acknowledge. */
    if (!await(i2c, I2C_SR1_BTF)) {
        return false;
    }
    I2C1->cr1 &= ~I2C_CR1_ACK;
    data[at] = (uint8_t)I2C1->dr;
    return take_last_two(i2c, &data[at + 1U]);
}

static bool take(i2c_t *const i2c, uint8_t *const data, const uint8_t length) {
    if (!send_start(i2c)) {
        return false;
    }
    I2C1->cr1 |= I2C_CR1_ACK;
    I2C1->dr = (ADDRESS << 1) | 1U;
    if (!await(i2c, I2C_SR1_ADDR)) {
        return false;
    }
    if (length == 1U) {
        return take_one(i2c, data);
    }
    return length == 2U ? take_two(i2c, data) : take_many(i2c, data, length);
}

bool i2c_read(void *const context, const uint8_t first, uint8_t *const data,
              const uint8_t length) {
    i2c_t *const i2c = context;
    if (begin(i2c, first) && take(i2c, data, length)) {
        return true;
    }
    return fail(i2c);
}

bool i2c_write(void *const context, const uint8_t target, const uint8_t value) {
    i2c_t *const i2c = context;
    if (!begin(i2c, target)) {
        return fail(i2c);
    }
    I2C1->dr = value;
    if (!await(i2c, I2C_SR1_BTF)) {
        return fail(i2c);
    }
    I2C1->cr1 |= I2C_CR1_STOP;
    return true;
}

bool i2c_timed_out(void *const context) {
    const i2c_t *const i2c = context;
    return i2c->is_timeout;
}

bool i2c_is_ready(void *const context) {
    (void)context;
    return true;
}
