/* The STM32F405 board: what main.c needs to fill the core's HAL table.
 * Each driver keeps its state in a struct that main.c owns and hands back as context; interrupt
 * handlers reach theirs through the one pointer that its start call left.
 */
#ifndef BOARD_H
#define BOARD_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "../core/bno055_uart.h"
#include "../core/pod.h"
#include "../core/slcan.h"
#include "registers.h"

/* clock.c: 168 MHz from the 12 MHz crystal, from the internal oscillator, or 16 MHz as it is. */
typedef struct {
    uint32_t core_hz;
    uint32_t apb1_hz;
    uint32_t apb2_hz;
    bool has_crystal;
    bool is_emulated; /* there is no RCC: an emulator that models none */
} clocks_t;
void clock_start(clocks_t *clocks);

/* ticks.c: microseconds since start from SysTick; never goes back. */
void ticks_start(const clocks_t *clocks);
uint64_t ticks_now_us(void *context);
void ticks_wait_us(uint32_t duration_us);
/* Sleeps until the next interrupt, a millisecond at most; not at all if ticks_wake() was called
 * since the last rest, so that nothing that came between a look and the sleep has to wait. */
void ticks_rest(void *context);
void ticks_wake(void);

/* gpio.c */
typedef enum { PIN_INPUT, PIN_OUTPUT, PIN_ALTERNATE } pin_mode_t;
typedef struct {
    pin_mode_t mode;
    bool is_open_drain;
    bool has_pull_up;
    uint8_t alternate;
} pin_config_t;
void gpio_set(gpio_registers_t *port, uint8_t pin, const pin_config_t *config);
void gpio_write(gpio_registers_t *port, uint8_t pin, bool is_high);
bool gpio_read(const gpio_registers_t *port, uint8_t pin);

/* i2c.c: register access to the BNO055 on I2C1, and nine clocks for a bus it holds down. */
typedef struct {
    uint32_t apb1_hz;
    uint64_t deadline_us;
    bool is_timeout;
} i2c_t;
void i2c_start(i2c_t *i2c, const clocks_t *clocks);
void i2c_configure(const i2c_t *i2c);
void i2c_set_pins(pin_mode_t mode);
bool i2c_read(void *context, uint8_t first, uint8_t *data, uint8_t length);
bool i2c_write(void *context, uint8_t target, uint8_t value);
bool i2c_timed_out(void *context);
bool i2c_is_ready(void *context);
bool i2c_recover(void *context);

/* can.c: bxCAN 1. Frames in go from the interrupt into a ring, frames out into mailboxes. */
#define CAN_RING_FRAMES 16U
typedef struct {
    pod_frame_t ring[CAN_RING_FRAMES];
    volatile uint8_t head; /* moved by the interrupt */
    volatile uint8_t tail; /* moved by can_receive */
    volatile uint16_t lost;
} can_t;
void can_start(can_t *can, const clocks_t *clocks, uint8_t node);
bool can_send(void *context, uint8_t mailbox, const pod_frame_t *frame);
bool can_receive(void *context, pod_frame_t *frame);
uint16_t can_lost(void *context);
bool can_is_bus_off(void *context);
void can_restart(void *context);

/* usart.c: bytes in and out through rings. */
#define USART_RECEIVE_BYTES 128U
#define USART_SEND_BYTES 512U
typedef struct {
    usart_registers_t *registers;
    uint8_t received[USART_RECEIVE_BYTES];
    uint8_t sending[USART_SEND_BYTES];
    volatile uint16_t receive_head; /* moved by the interrupt */
    uint16_t receive_tail;
    uint16_t send_head;
    volatile uint16_t send_tail; /* moved by the interrupt */
} usart_t;
void usart_start(usart_t *usart, usart_registers_t *registers, uint32_t bus_hz, uint32_t baud);
bool usart_write(void *context, const uint8_t *bytes, uint8_t length);
bool usart_read(void *context, uint8_t *byte);
void usart_pump(usart_t *usart);

/* slcan_link.c: SLCAN on a USART in place of the CAN controller. */
typedef struct {
    usart_t *usart;
    slcan_t slcan;
    uint16_t lost; /* lines that were no command and no frame */
} slcan_link_t;
bool slcan_link_send(void *context, uint8_t mailbox, const pod_frame_t *frame);
bool slcan_link_receive(void *context, pod_frame_t *frame);
uint16_t slcan_link_lost(void *context);
bool slcan_link_is_bus_off(void *context);
void slcan_link_restart(void *context);

/* identity.c: straps, unique id, reset cause. store.c: the node number in flash. */
void identity_read(pod_boot_t *boot, const clocks_t *clocks);
uint8_t store_read(void);
bool store_node(void *context, uint8_t node);

/* watchdog.c */
void watchdog_start(void);
void watchdog_kick(void *context);
void board_reset(void *context);

void interrupt_enable(uint8_t number);

#endif
