/* Who this board is: straps or the stored number, the device's unique id, why it started. */
#include "board.h"

/* A0 to A3 of the Feather: grounded means 1; A4 grounded says that the straps count. */
#define STRAP_FIRST_PIN 4U /* PA4..PA7 */
#define STRAPS 4U
#define STRAP_VALID_PIN 4U /* PC4 */
#define STRAP_SETTLE_US 10U
#define MAGIC 0x504F4431UL

/* Survives a reset, not a loss of power; the linker script keeps it out of .bss. */
static struct {
    uint32_t magic;
    uint32_t watchdog_resets;
} kept __attribute__((section(".noinit")));

static uint8_t read_straps(void) {
    const pin_config_t strap = {.mode = PIN_INPUT, .has_pull_up = true};
    gpio_set(GPIOC, STRAP_VALID_PIN, &strap);
    for (uint8_t i = 0; i < STRAPS; i++) {
        gpio_set(GPIOA, (uint8_t)(STRAP_FIRST_PIN + i), &strap);
    }
    ticks_wait_us(STRAP_SETTLE_US);
    if (gpio_read(GPIOC, STRAP_VALID_PIN)) {
        return POD_NODE_NONE;
    }
    uint8_t node = 0U;
    for (uint8_t i = 0; i < STRAPS; i++) {
        if (!gpio_read(GPIOA, (uint8_t)(STRAP_FIRST_PIN + i))) {
            node |= (uint8_t)(1U << i);
        }
    }
    return node;
}

/* Several flags may stand: a power-on also sets BOR and PIN (RM0090 Sec. 7.3.21). */
static pod_reset_cause_t read_reset_cause(void) {
    const uint32_t flags = RCC->csr;
    RCC->csr |= RCC_CSR_RMVF;
    if ((flags & (RCC_CSR_IWDG | RCC_CSR_WWDG)) != 0U) {
        return POD_RESET_WATCHDOG;
    }
    if ((flags & RCC_CSR_SOFTWARE) != 0U) {
        return POD_RESET_SOFTWARE;
    }
    if ((flags & RCC_CSR_POR) != 0U) {
        return POD_RESET_POWER_ON;
    }
    if ((flags & RCC_CSR_BOR) != 0U) {
        return POD_RESET_BROWN_OUT;
    }
    return (flags & RCC_CSR_PIN) != 0U ? POD_RESET_PIN : POD_RESET_UNKNOWN;
}

static uint16_t count_watchdog_resets(const pod_reset_cause_t cause) {
    if (kept.magic != MAGIC) {
        kept.magic = MAGIC;
        kept.watchdog_resets = 0U;
    }
    if (cause == POD_RESET_WATCHDOG && kept.watchdog_resets < UINT16_MAX) {
        kept.watchdog_resets++;
    }
    return (uint16_t)kept.watchdog_resets;
}

void identity_read(pod_boot_t *const boot, const clocks_t *const clocks) {
    const uint8_t strapped = read_straps();
    boot->node = strapped == POD_NODE_NONE ? store_read() : strapped;
    boot->reset_cause = read_reset_cause();
    boot->watchdog_resets = count_watchdog_resets(boot->reset_cause);
    for (uint8_t i = 0; i < POD_UID_BYTES; i++) {
        /* An emulator has no such memory and would fault. */
        boot->uid[i] = clocks->is_emulated ? 0U : DEVICE_UID[i];
    }
}
