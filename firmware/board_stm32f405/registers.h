/* Registers of the STM32F405 that this board uses, declared from the reference manual RM0090
 * rev. 19 (section beside each block) and the Cortex-M4 manual. Included by board files only.
 */
#ifndef REGISTERS_H
#define REGISTERS_H

#include <stdint.h>

#define BIT(n) (1UL << (n))

/* RCC, Sec. 7.3 */
typedef struct {
    volatile uint32_t cr, pllcfgr, cfgr, cir;
    volatile uint32_t ahb1rstr, ahb2rstr, ahb3rstr, reserved0, apb1rstr, apb2rstr, reserved1[2];
    volatile uint32_t ahb1enr, ahb2enr, ahb3enr, reserved2, apb1enr, apb2enr, reserved3[2];
    volatile uint32_t reserved4[8];
    volatile uint32_t bdcr, csr;
} rcc_registers_t;
#define RCC ((rcc_registers_t *)0x40023800UL)
_Static_assert(sizeof(rcc_registers_t) == 0x78, "CSR lies at 0x74");
#define RCC_CR_HSION BIT(0)
#define RCC_CR_HSIRDY BIT(1)
#define RCC_CR_HSEON BIT(16)
#define RCC_CR_HSERDY BIT(17)
#define RCC_CR_CSSON BIT(19)
#define RCC_CR_PLLON BIT(24)
#define RCC_CR_PLLRDY BIT(25)
#define RCC_PLLCFGR_HSE BIT(22)
#define RCC_CFGR_SW_PLL 2UL
#define RCC_CFGR_SWS_MASK 0xCUL
#define RCC_CFGR_SWS_PLL 0x8UL
#define RCC_CFGR_APB1_DIV4 (5UL << 10)
#define RCC_CFGR_APB2_DIV2 (4UL << 13)
#define RCC_CSR_RMVF BIT(24)
#define RCC_CSR_BOR BIT(25)
#define RCC_CSR_PIN BIT(26)
#define RCC_CSR_POR BIT(27)
#define RCC_CSR_SOFTWARE BIT(28)
#define RCC_CSR_IWDG BIT(29)
#define RCC_CSR_WWDG BIT(30)
#define RCC_AHB1_GPIOA BIT(0)
#define RCC_AHB1_GPIOB BIT(1)
#define RCC_AHB1_GPIOC BIT(2)
#define RCC_APB1_USART3 BIT(18)
#define RCC_APB1_I2C1 BIT(21)
#define RCC_APB1_CAN1 BIT(25)
#define RCC_APB1_PWR BIT(28)
#define RCC_APB2_USART6 BIT(5)

/* PWR, Sec. 5.4 */
typedef struct {
    volatile uint32_t cr, csr;
} pwr_registers_t;
#define PWR ((pwr_registers_t *)0x40007000UL)
#define PWR_CR_VOS BIT(14)

/* Flash interface, Sec. 3.9 */
typedef struct {
    volatile uint32_t acr, keyr, optkeyr, sr, cr, optcr;
} flash_registers_t;
#define FLASH ((flash_registers_t *)0x40023C00UL)
#define FLASH_ACR_5_WAITS_CACHED (5UL | BIT(8) | BIT(9) | BIT(10))
#define FLASH_KEY_1 0x45670123UL
#define FLASH_KEY_2 0xCDEF89ABUL
#define FLASH_SR_BSY BIT(16)
#define FLASH_SR_ERRORS 0xF2UL
#define FLASH_CR_PG BIT(0)
#define FLASH_CR_SIZE_32 (2UL << 8)
#define FLASH_CR_LOCK BIT(31)

/* GPIO, Sec. 8.4 */
typedef struct {
    volatile uint32_t moder, otyper, ospeedr, pupdr, idr, odr, bsrr, lckr, afr[2];
} gpio_registers_t;
#define GPIOA ((gpio_registers_t *)0x40020000UL)
#define GPIOB ((gpio_registers_t *)0x40020400UL)
#define GPIOC ((gpio_registers_t *)0x40020800UL)

/* I2C, Sec. 27.6 */
typedef struct {
    volatile uint32_t cr1, cr2, oar1, oar2, dr, sr1, sr2, ccr, trise, fltr;
} i2c_registers_t;
#define I2C1 ((i2c_registers_t *)0x40005400UL)
#define I2C_CR1_PE BIT(0)
#define I2C_CR1_START BIT(8)
#define I2C_CR1_STOP BIT(9)
#define I2C_CR1_ACK BIT(10)
#define I2C_CR1_POS BIT(11)
#define I2C_CR1_SWRST BIT(15)
#define I2C_SR1_SB BIT(0)
#define I2C_SR1_ADDR BIT(1)
#define I2C_SR1_BTF BIT(2)
#define I2C_SR1_RXNE BIT(6)
#define I2C_SR1_TXE BIT(7)
#define I2C_SR1_BERR BIT(8)
#define I2C_SR1_ARLO BIT(9)
#define I2C_SR1_AF BIT(10)
#define I2C_SR2_BUSY BIT(1)
#define I2C_CCR_FAST BIT(15)

/* bxCAN, Sec. 32.9 */
typedef struct {
    volatile uint32_t tir, tdtr, tdlr, tdhr;
} can_mailbox_t;
typedef struct {
    volatile uint32_t mcr, msr, tsr, rfr[2], ier, esr, btr;
    volatile uint32_t reserved0[88];
    can_mailbox_t transmit[3];
    can_mailbox_t receive[2];
    volatile uint32_t reserved1[12];
    volatile uint32_t fmr, fm1r, reserved2, fs1r, reserved3, ffa1r, reserved4, fa1r;
    volatile uint32_t reserved5[8];
    struct {
        volatile uint32_t id, mask;
    } filter[28];
} can_registers_t;
#define CAN1 ((can_registers_t *)0x40006400UL)
_Static_assert(sizeof(can_registers_t) == 0x320, "filter banks end at 0x31C");
#define CAN_MCR_INRQ BIT(0)
#define CAN_MCR_TXFP BIT(2)
#define CAN_MCR_RFLM BIT(3)
#define CAN_MCR_RESET BIT(15)
#define CAN_MSR_INAK BIT(0)
#define CAN_TSR_ABORT_ALL (BIT(7) | BIT(15) | BIT(23))
#define CAN_TSR_DONE_ALL (BIT(0) | BIT(8) | BIT(16))
#define CAN_TSR_EMPTY_0 BIT(26)
#define CAN_RFR_PENDING 3UL
#define CAN_RFR_OVERRUN BIT(4)
#define CAN_RFR_RELEASE BIT(5)
#define CAN_IER_TRANSMITTED BIT(0)
#define CAN_IER_RECEIVED_0 BIT(1)
#define CAN_ESR_BUS_OFF BIT(2)
#define CAN_TIR_REQUEST BIT(0)
#define CAN_RIR_REMOTE BIT(1)
#define CAN_RIR_EXTENDED BIT(2)
#define CAN_RIR_STANDARD_SHIFT 21U
#define CAN_RIR_EXTENDED_SHIFT 3U
#define CAN_FMR_INIT BIT(0)

/* USART, Sec. 30.6 */
typedef struct {
    volatile uint32_t sr, dr, brr, cr1, cr2, cr3;
} usart_registers_t;
#define USART3 ((usart_registers_t *)0x40004800UL)
#define USART6 ((usart_registers_t *)0x40011400UL)
#define USART_SR_ORE BIT(3)
#define USART_SR_RXNE BIT(5)
#define USART_SR_TXE BIT(7)
#define USART_CR1_RE BIT(2)
#define USART_CR1_TE BIT(3)
#define USART_CR1_RXNEIE BIT(5)
#define USART_CR1_TXEIE BIT(7)
#define USART_CR1_UE BIT(13)

/* Independent watchdog, Sec. 21.4 */
typedef struct {
    volatile uint32_t kr, pr, rlr, sr;
} iwdg_registers_t;
#define IWDG ((iwdg_registers_t *)0x40003000UL)
#define IWDG_KICK 0xAAAAUL
#define IWDG_UNLOCK 0x5555UL
#define IWDG_START 0xCCCCUL
#define IWDG_DIV_32 3UL

/* Cortex-M4: SysTick, interrupt controller, system control (DDI0439, DDI0403) */
typedef struct {
    volatile uint32_t ctrl, load, val, calib;
} systick_registers_t;
#define SYSTICK ((systick_registers_t *)0xE000E010UL)
#define SYSTICK_ON 7UL /* processor clock, interrupt, enable */
#define NVIC_ISER ((volatile uint32_t *)0xE000E100UL)
#define SCB_ICSR (*(volatile uint32_t *)0xE000ED04UL)
#define SCB_ICSR_SYSTICK_PENDING BIT(26)
#define SCB_AIRCR (*(volatile uint32_t *)0xE000ED0CUL)
#define SCB_AIRCR_RESET 0x05FA0004UL
#define IRQ_CAN1_TX 19U
#define IRQ_CAN1_RX0 20U
#define IRQ_USART3 39U
#define IRQ_USART6 71U

/* Unique device id, Sec. 39.1 */
#define DEVICE_UID ((const volatile uint8_t *)0x1FFF7A10UL)

#endif
