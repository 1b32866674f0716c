/* Clocks (RM0090 Sec. 7.2): every wait has an end, and what is there is used. */
#include "board.h"

/* HSE start-up takes 2 ms at most (DS8626 Table 33): at 16 MHz and some 8 cycles a turn this is
 * about 10 ms. PLL lock 300 us, switching a few cycles. */
#define HSE_TURNS 20000U
#define PLL_TURNS 5000U
#define SWITCH_TURNS 1000U

#define CRYSTAL_MHZ 12U /* Feather STM32F405 */
#define HSI_MHZ 16U
#define PLL_TIMES 336U /* 1 MHz * 336 / 2 = 168 MHz; / 7 = 48 MHz for USB */
#define PLL_USB_DIVIDER 7U
#define FULL_HZ 168000000U
#define FULL_APB1_HZ (FULL_HZ / 4U)
#define FULL_APB2_HZ (FULL_HZ / 2U)
#define HSI_HZ 16000000U

static bool wait_for(const volatile uint32_t *const target, const uint32_t mask,
                     const uint32_t wanted, const uint32_t turns) {
    for (uint32_t i = 0; i < turns; i++) {
        if ((*target & mask) == wanted) {
            return true;
        }
    }
    return false;
}

static bool start_crystal(void) {
    RCC->cr |= RCC_CR_HSEON;
    if (wait_for(&RCC->cr, RCC_CR_HSERDY, RCC_CR_HSERDY, HSE_TURNS)) {
        return true;
    }
    RCC->cr &= ~RCC_CR_HSEON;
    return false;
}

static bool start_pll(const bool has_crystal) {
    const uint32_t divider = has_crystal ? CRYSTAL_MHZ : HSI_MHZ;
    RCC->pllcfgr = divider | (PLL_TIMES << 6) | (has_crystal ? RCC_PLLCFGR_HSE : 0U) |
                   (PLL_USB_DIVIDER << 24);
    RCC->cr |= RCC_CR_PLLON;
    if (!wait_for(&RCC->cr, RCC_CR_PLLRDY, RCC_CR_PLLRDY, PLL_TURNS)) {
        RCC->cr &= ~RCC_CR_PLLON;
        return false;
    }
    FLASH->acr = FLASH_ACR_5_WAITS_CACHED;
    RCC->cfgr = RCC_CFGR_APB1_DIV4 | RCC_CFGR_APB2_DIV2 | RCC_CFGR_SW_PLL;
    return wait_for(&RCC->cfgr, RCC_CFGR_SWS_MASK, RCC_CFGR_SWS_PLL, SWITCH_TURNS);
}

void clock_start(clocks_t *const clocks) {
    /* After reset HSI is on and ready (0x83 in CR), so only a missing RCC reads zero. */
    const bool is_emulated = (RCC->cr & (RCC_CR_HSION | RCC_CR_HSIRDY)) == 0U;
    RCC->apb1enr |= RCC_APB1_PWR;
    PWR->cr |= PWR_CR_VOS;
    clocks->is_emulated = is_emulated;
    clocks->has_crystal = start_crystal();
    if (start_pll(clocks->has_crystal) || is_emulated) {
        clocks->core_hz = FULL_HZ;
        clocks->apb1_hz = FULL_APB1_HZ;
        clocks->apb2_hz = FULL_APB2_HZ;
    } else {
        RCC->cfgr = 0U;
        clocks->core_hz = HSI_HZ;
        clocks->apb1_hz = HSI_HZ;
        clocks->apb2_hz = HSI_HZ;
    }
    RCC->ahb1enr |= RCC_AHB1_GPIOA | RCC_AHB1_GPIOB | RCC_AHB1_GPIOC;
}
