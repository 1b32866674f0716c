/* Vector table and start: initialised data, zeroed data, main. A fault or an interrupt that
 * nobody asked for stops here, and the watchdog starts the pod over and counts it.
 */
#include <stddef.h>
#include <stdint.h>

#define SYSTEM_VECTORS 16U
#define IRQ_VECTORS 82U

extern uint32_t data_load[];
extern uint32_t data_start[];
extern uint32_t data_end[];
extern uint32_t bss_start[];
extern uint32_t bss_end[];
extern uint32_t stack_top[];

int main(void);
void Reset_Handler(void);
void Default_Handler(void);
void SysTick_Handler(void);
void CAN1_TX_Handler(void);
void CAN1_RX0_Handler(void);
void USART3_Handler(void);
void USART6_Handler(void);

void Default_Handler(void) {
    for (;;) {
    }
}

void Reset_Handler(void) {
    const uint32_t *from = data_load;
    /* The two ends are one section's, as the linker script says: no other way to know its size. */
    // cppcheck-suppress comparePointers
    for (uint32_t *to = data_start; to < data_end; to++) {
        *to = *from;
        from++;
    }
    // cppcheck-suppress comparePointers ; as above
    for (uint32_t *to = bss_start; to < bss_end; to++) {
        *to = 0U;
    }
    (void)main();
    Default_Handler();
}

typedef void (*vector_t)(void);

/* Read by the processor, not by the program. */
typedef struct {
    // cppcheck-suppress unusedStructMember
    uint32_t *stack;
    // cppcheck-suppress unusedStructMember
    vector_t system[SYSTEM_VECTORS - 1U];
    // cppcheck-suppress unusedStructMember
    vector_t irq[IRQ_VECTORS];
} vectors_t;

__attribute__((section(".vectors"), used)) static const vectors_t vectors = {
    .stack = stack_top,
    .system = {Reset_Handler, Default_Handler, Default_Handler, Default_Handler, Default_Handler,
               Default_Handler, NULL, NULL, NULL, NULL, Default_Handler, Default_Handler, NULL,
               Default_Handler, SysTick_Handler},
    .irq =
        {
            [19] = CAN1_TX_Handler,
            [20] = CAN1_RX0_Handler,
            [39] = USART3_Handler,
            [71] = USART6_Handler,
        },
};
