/* Pins (RM0090 Sec. 8.3) and the interrupt controller. */
#include "board.h"

#define MODE_OUTPUT 1UL
#define MODE_ALTERNATE 2UL
#define SPEED_HIGH 2UL
#define ALTERNATES_PER_REGISTER 8U
#define IRQS_PER_REGISTER 32U

static void put(volatile uint32_t *const target, const uint32_t shift, const uint32_t mask,
                const uint32_t value) {
    *target = (*target & ~(mask << shift)) | (value << shift);
}

void gpio_set(gpio_registers_t *const port, const uint8_t pin, const pin_config_t *const config) {
    uint32_t mode = 0U;
    if (config->mode == PIN_OUTPUT) {
        mode = MODE_OUTPUT;
    } else if (config->mode == PIN_ALTERNATE) {
        mode = MODE_ALTERNATE;
        const uint32_t shift = 4U * (pin % ALTERNATES_PER_REGISTER);
        put(&port->afr[pin / ALTERNATES_PER_REGISTER], shift, 0xFUL, config->alternate);
    }
    put(&port->otyper, pin, 1UL, config->is_open_drain ? 1UL : 0UL);
    put(&port->ospeedr, 2U * pin, 3UL, SPEED_HIGH);
    put(&port->pupdr, 2U * pin, 3UL, config->has_pull_up ? 1UL : 0UL);
    put(&port->moder, 2U * pin, 3UL, mode);
}

void gpio_write(gpio_registers_t *const port, const uint8_t pin, const bool is_high) {
    port->bsrr = is_high ? 1UL << pin : 1UL << (pin + 16U);
}

bool gpio_read(const gpio_registers_t *const port, const uint8_t pin) {
    return ((port->idr >> pin) & 1UL) != 0U;
}

void interrupt_enable(const uint8_t number) {
    NVIC_ISER[number / IRQS_PER_REGISTER] = 1UL << (number % IRQS_PER_REGISTER);
}
