/* The one file that knows the core and the board: fills the HAL table and runs the loop.
 * POD_SERIAL builds the second variant, BNO055 on a UART and SLCAN out; the flight variant has
 * the chip on I2C and the bus on the CAN controller.
 */
#include "board.h"

#define REST_US 1000U
#define IMU_BAUD 115200U
#ifndef POD_SLCAN_BAUD
#define POD_SLCAN_BAUD 1000000U
#endif
#define AF_USART3 7U
#define AF_USART6 8U

static pod_t pod;
static clocks_t clocks;

#ifdef POD_SERIAL
static usart_t imu_usart;
static usart_t link_usart;
static bno055_serial_t serial;
static bno055_uart_t imu;
static slcan_link_t link;

/* The line rests after every error by itself; there are no clocks to give. */
static bool recover_imu(void *const context) {
    (void)context;
    return true;
}

static void start_pins(void) {
    const pin_config_t imu_line = {
        .mode = PIN_ALTERNATE, .has_pull_up = true, .alternate = AF_USART3};
    const pin_config_t link_line = {
        .mode = PIN_ALTERNATE, .has_pull_up = true, .alternate = AF_USART6};
    gpio_set(GPIOB, 10U, &imu_line); /* PB10, PB11: TX and RX of the Feather */
    gpio_set(GPIOB, 11U, &imu_line);
    gpio_set(GPIOC, 6U, &link_line); /* PC6, PC7: D6 sends, D5 receives */
    gpio_set(GPIOC, 7U, &link_line);
    RCC->apb1enr |= RCC_APB1_USART3;
    RCC->apb2enr |= RCC_APB2_USART6;
}

static void start_links(pod_hal_t *const hal, const uint8_t node) {
    (void)node;
    start_pins();
    usart_start(&imu_usart, USART3, clocks.apb1_hz, IMU_BAUD);
    usart_start(&link_usart, USART6, clocks.apb2_hz, POD_SLCAN_BAUD);
    serial = (bno055_serial_t){.context = &imu_usart,
                               .write = usart_write,
                               .read = usart_read,
                               .now_us = ticks_now_us,
                               .rest = ticks_rest};
    imu.serial = &serial;
    link.usart = &link_usart;
    /* Unlike an adapter it starts open: a pod that was reset in flight must not wait for "O". */
    link.slcan.is_open = true;
    hal->context = &link;
    hal->imu = (bno055_port_t){.context = &imu,
                               .read = bno055_uart_read,
                               .write = bno055_uart_write,
                               .timed_out = bno055_uart_timed_out,
                               .is_ready = bno055_uart_is_ready,
                               .now_us = ticks_now_us};
    hal->imu_recover = recover_imu;
    hal->can_send = slcan_link_send;
    hal->can_receive = slcan_link_receive;
    hal->can_lost = slcan_link_lost;
    hal->can_is_bus_off = slcan_link_is_bus_off;
    hal->can_restart = slcan_link_restart;
}

static void pump_links(void) { usart_pump(&link_usart); }
#else
static i2c_t imu;
static can_t link;

static bool recover_imu(void *const context) {
    (void)context;
    return i2c_recover(&imu);
}

static void start_links(pod_hal_t *const hal, const uint8_t node) {
    i2c_start(&imu, &clocks);
    can_start(&link, &clocks, node);
    hal->context = &link;
    hal->imu = (bno055_port_t){.context = &imu,
                               .read = i2c_read,
                               .write = i2c_write,
                               .timed_out = i2c_timed_out,
                               .is_ready = i2c_is_ready,
                               .now_us = ticks_now_us};
    hal->imu_recover = recover_imu;
    hal->can_send = can_send;
    hal->can_receive = can_receive;
    hal->can_lost = can_lost;
    hal->can_is_bus_off = can_is_bus_off;
    hal->can_restart = can_restart;
}

static void pump_links(void) {}
#endif

static pod_hal_t hal = {.now_us = ticks_now_us,
                        .store_node = store_node,
                        .kick = watchdog_kick,
                        .reset = board_reset};

int main(void) {
    pod_boot_t boot = {0};
    clock_start(&clocks);
    ticks_start(&clocks);
    identity_read(&boot, &clocks);
    /* A pod without a number uses the last one (pod_identity.c). */
    start_links(&hal, boot.node < POD_NODES ? boot.node : POD_NODES - 1U);
    watchdog_start();
    pod_init(&pod, &hal, &boot);
    for (;;) {
        const uint32_t rest_us = pod_step(&pod);
        pump_links();
        /* Less than a tick away: stay awake, so that samples start on time. */
        if (rest_us > REST_US) {
            ticks_rest(NULL);
        }
    }
}
