/* Time from SysTick: an interrupt every millisecond, and the counter between them. */
#include "board.h"

#define TICKS_PER_S 1000U
#define US_PER_TICK 1000U
#define READ_TURNS 4U

static volatile uint64_t ticks;
static volatile bool is_woken;
static uint32_t counts_per_tick = 1U;
static uint32_t counts_per_us = 1U;

void SysTick_Handler(void);
void SysTick_Handler(void) { ticks++; }

void ticks_start(const clocks_t *const clocks) {
    counts_per_tick = clocks->core_hz / TICKS_PER_S;
    counts_per_us = counts_per_tick / US_PER_TICK;
    SYSTICK->load = counts_per_tick - 1U;
    SYSTICK->val = 0U;
    SYSTICK->ctrl = SYSTICK_ON;
}

/* The counter runs down. Inside another handler a roll-over may still be pending. */
uint64_t ticks_now_us(void *const context) {
    (void)context;
    uint64_t before = ticks;
    uint32_t left = SYSTICK->val;
    for (uint32_t i = 0; i < READ_TURNS && before != ticks; i++) {
        before = ticks;
        left = SYSTICK->val;
    }
    if ((SCB_ICSR & SCB_ICSR_SYSTICK_PENDING) != 0U) {
        left = SYSTICK->val;
        before++; /* what was read, not `ticks`: the handler may just have run */
    }
    const uint32_t passed = counts_per_tick - 1U - left;
    return before * US_PER_TICK + passed / counts_per_us;
}

void ticks_wait_us(const uint32_t duration_us) {
    const uint64_t until_us = ticks_now_us(NULL) + duration_us;
    while (ticks_now_us(NULL) < until_us) {
    }
}

void ticks_wake(void) { is_woken = true; }

void ticks_rest(void *const context) {
    (void)context;
    /* With interrupts masked a pending one still ends WFI, and is taken at "cpsie". */
    __asm volatile("cpsid i" ::: "memory");
    if (!is_woken) {
        __asm volatile("wfi" ::: "memory");
    }
    is_woken = false;
    __asm volatile("cpsie i" ::: "memory");
}
