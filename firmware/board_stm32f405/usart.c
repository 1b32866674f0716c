/* USART (RM0090 Sec. 30.3), 8N1, both ways through rings. */
#include "board.h"

#define PORTS 2U

_Static_assert(USART_SEND_BYTES > 2U * SLCAN_LINE_MAX, "at least two lines fit");

static usart_t *active[PORTS];

void usart_start(usart_t *const usart, usart_registers_t *const registers, const uint32_t bus_hz,
                 const uint32_t baud) {
    active[registers == USART3 ? 0U : 1U] = usart;
    usart->registers = registers;
    registers->brr = (bus_hz + baud / 2U) / baud;
    registers->cr1 = USART_CR1_UE | USART_CR1_TE | USART_CR1_RE | USART_CR1_RXNEIE;
    interrupt_enable(registers == USART3 ? IRQ_USART3 : IRQ_USART6);
}

static void send_next(usart_t *const usart) {
    usart->registers->dr = usart->sending[usart->send_tail];
    usart->send_tail = (uint16_t)((usart->send_tail + 1U) % USART_SEND_BYTES);
}

/* From the main loop: on hardware the interrupt has sent what was there; an emulator without
 * transmit interrupts is served here. The interrupt is off meanwhile, so the tail has one owner. */
void usart_pump(usart_t *const usart) {
    usart->registers->cr1 &= ~USART_CR1_TXEIE;
    for (uint16_t i = 0; i < USART_SEND_BYTES && usart->send_tail != usart->send_head; i++) {
        if ((usart->registers->sr & USART_SR_TXE) == 0U) {
            usart->registers->cr1 |= USART_CR1_TXEIE;
            return;
        }
        send_next(usart);
    }
}

bool usart_write(void *const context, const uint8_t *const bytes, const uint8_t length) {
    usart_t *const usart = context;
    const uint16_t used = (uint16_t)((USART_SEND_BYTES + usart->send_head - usart->send_tail) %
                                     USART_SEND_BYTES);
    if (USART_SEND_BYTES - 1U - used < length) {
        return false;
    }
    uint16_t head = usart->send_head;
    for (uint8_t i = 0; i < length; i++) {
        usart->sending[head] = bytes[i];
        head = (uint16_t)((head + 1U) % USART_SEND_BYTES);
    }
    usart->send_head = head;
    usart_pump(usart);
    return true;
}

bool usart_read(void *const context, uint8_t *const byte) {
    usart_t *const usart = context;
    if (usart->receive_tail == usart->receive_head) {
        return false;
    }
    *byte = usart->received[usart->receive_tail];
    usart->receive_tail = (uint16_t)((usart->receive_tail + 1U) % USART_RECEIVE_BYTES);
    return true;
}

static void interrupt(usart_t *const usart) {
    const uint32_t status = usart->registers->sr;
    if ((status & (USART_SR_RXNE | USART_SR_ORE)) != 0U) {
        /* Reading DR after SR clears an overrun too, which may come without a byte. */
        const uint8_t byte = (uint8_t)usart->registers->dr;
        const bool has_byte = (status & USART_SR_RXNE) != 0U;
        const uint16_t next = (uint16_t)((usart->receive_head + 1U) % USART_RECEIVE_BYTES);
        if (has_byte && next != usart->receive_tail) {
            usart->received[usart->receive_head] = byte;
            usart->receive_head = next;
        }
        ticks_wake();
    }
    if ((status & USART_SR_TXE) != 0U && (usart->registers->cr1 & USART_CR1_TXEIE) != 0U) {
        if (usart->send_tail == usart->send_head) {
            usart->registers->cr1 &= ~USART_CR1_TXEIE;
        } else {
            send_next(usart);
        }
    }
}

void USART3_Handler(void);
void USART3_Handler(void) { interrupt(active[0]); }

void USART6_Handler(void);
void USART6_Handler(void) { interrupt(active[1]); }
