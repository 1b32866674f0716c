/* The independent watchdog (RM0090 Sec. 21.3), half a second on its own oscillator, and reset. */
#include "board.h"

/* 32 kHz / 32 = 1 kHz; the oscillator may run at 17 to 47 kHz: 0.34 to 0.94 s. */
#define PERIOD_TICKS 499U

void watchdog_start(void) {
    IWDG->kr = IWDG_START;
    IWDG->kr = IWDG_UNLOCK;
    IWDG->pr = IWDG_DIV_32;
    IWDG->rlr = PERIOD_TICKS;
    IWDG->kr = IWDG_KICK;
}

void watchdog_kick(void *const context) {
    (void)context;
    IWDG->kr = IWDG_KICK;
}

void board_reset(void *const context) {
    (void)context;
    SCB_AIRCR = SCB_AIRCR_RESET;
}
