/* bxCAN 1 (RM0090 Sec. 32): filters for what concerns this pod, three mailboxes by identifier,
 * received frames stamped in the interrupt. Bus-off is left on request only.
 */
#include "board.h"

#define RX_PIN 8U /* PB8, PB9: CAN1 of the Feather (D9, D10) */
#define TX_PIN 9U
#define AF_CAN 9U
#define INIT_TURNS 100000U
#ifndef POD_CAN_BITRATE
#define POD_CAN_BITRATE 500000U
#endif
/* Identifiers of the master to all pods, and of everything that carries our node number up to
 * 0x3FF: requests to us, and frames of a second pod with our number. */
#define SYNC_ID 0x080U
#define SYNC_MASK 0x7FEU
#define NODE_MASK 0x40FU
#define STANDARD_ID_MASK 0x7FFU

static can_t *active;

static bool request_init(const bool is_wanted) {
    CAN1->mcr = (is_wanted ? CAN_MCR_INRQ : 0U) | CAN_MCR_RFLM;
    for (uint32_t i = 0; is_wanted && i < INIT_TURNS; i++) {
        if ((CAN1->msr & CAN_MSR_INAK) != 0U) {
            return true;
        }
    }
    return !is_wanted;
}

/* As many quanta a bit as divide the clock evenly, sampled at 85 to 88 %. */
static uint32_t bit_timing(const uint32_t clock_hz) {
    for (uint32_t quanta = 16U; quanta >= 8U; quanta--) {
        const uint32_t prescaler = clock_hz / (POD_CAN_BITRATE * quanta);
        if (prescaler > 0U && prescaler * quanta * POD_CAN_BITRATE == clock_hz) {
            const uint32_t second = quanta / 7U;
            const uint32_t first = quanta - 1U - second;
            return (prescaler - 1U) | ((first - 1U) << 16) | ((second - 1U) << 20);
        }
    }
    return 0U;
}

static void set_filter(const uint32_t bank, const uint32_t id, const uint32_t mask) {
    CAN1->fs1r |= 1UL << bank;
    CAN1->filter[bank].id = id << CAN_RIR_STANDARD_SHIFT;
    /* Standard identifiers only; remote frames come in and are counted as bad. */
    CAN1->filter[bank].mask = (mask << CAN_RIR_STANDARD_SHIFT) | CAN_RIR_EXTENDED;
    CAN1->fa1r |= 1UL << bank;
}

static void configure(const clocks_t *const clocks, const uint8_t node) {
    CAN1->btr = bit_timing(clocks->apb1_hz);
    CAN1->fmr |= CAN_FMR_INIT;
    set_filter(0U, SYNC_ID, SYNC_MASK);
    set_filter(1U, node, NODE_MASK);
    CAN1->fmr &= ~CAN_FMR_INIT;
    CAN1->ier = CAN_IER_RECEIVED_0 | CAN_IER_TRANSMITTED;
}

void can_start(can_t *const can, const clocks_t *const clocks, const uint8_t node) {
    const pin_config_t line = {.mode = PIN_ALTERNATE, .has_pull_up = true, .alternate = AF_CAN};
    active = can;
    RCC->apb1enr |= RCC_APB1_CAN1;
    gpio_set(GPIOB, RX_PIN, &line);
    gpio_set(GPIOB, TX_PIN, &line);
    (void)request_init(true);
    configure(clocks, node);
    /* Leaving waits for 11 recessive bits: that is the bus's business, not ours. */
    (void)request_init(false);
    interrupt_enable(IRQ_CAN1_RX0);
    interrupt_enable(IRQ_CAN1_TX);
}

bool can_send(void *const context, const uint8_t mailbox, const pod_frame_t *const frame) {
    (void)context;
    if (mailbox >= POD_MAILBOXES || (CAN1->tsr & (CAN_TSR_EMPTY_0 << mailbox)) == 0U) {
        return false;
    }
    can_mailbox_t *const box = &CAN1->transmit[mailbox];
    const uint8_t *const data = frame->data;
    box->tdtr = frame->length;
    box->tdlr = (uint32_t)data[0] | ((uint32_t)data[1] << 8) | ((uint32_t)data[2] << 16) |
                ((uint32_t)data[3] << 24);
    box->tdhr = (uint32_t)data[4] | ((uint32_t)data[5] << 8) | ((uint32_t)data[6] << 16) |
                ((uint32_t)data[7] << 24);
    box->tir = (frame->id << CAN_RIR_STANDARD_SHIFT) | CAN_TIR_REQUEST;
    return true;
}

bool can_receive(void *const context, pod_frame_t *const frame) {
    can_t *const can = context;
    const uint8_t tail = can->tail;
    if (tail == can->head) {
        return false;
    }
    *frame = can->ring[tail];
    can->tail = (uint8_t)((tail + 1U) % CAN_RING_FRAMES);
    return true;
}

uint16_t can_lost(void *const context) {
    const can_t *const can = context;
    return can->lost;
}

bool can_is_bus_off(void *const context) {
    (void)context;
    return (CAN1->esr & CAN_ESR_BUS_OFF) != 0U;
}

void can_restart(void *const context) {
    (void)context;
    CAN1->tsr = CAN_TSR_ABORT_ALL;
    (void)request_init(true);
    (void)request_init(false);
}

static void read_box(pod_frame_t *const frame, const uint64_t received_us) {
    const can_mailbox_t *const box = &CAN1->receive[0];
    const uint32_t id = box->tir;
    const uint32_t low = box->tdlr;
    const uint32_t high = box->tdhr;
    const uint32_t length = box->tdtr & 0xFU;
    frame->is_extended = (id & CAN_RIR_EXTENDED) != 0U;
    frame->is_remote = (id & CAN_RIR_REMOTE) != 0U;
    frame->id = frame->is_extended ? id >> CAN_RIR_EXTENDED_SHIFT
                                   : (id >> CAN_RIR_STANDARD_SHIFT) & STANDARD_ID_MASK;
    frame->length = (uint8_t)(length < POD_FRAME_BYTES ? length : POD_FRAME_BYTES);
    for (uint32_t i = 0; i < 4U; i++) {
        frame->data[i] = (uint8_t)(low >> (8U * i));
        frame->data[i + 4U] = (uint8_t)(high >> (8U * i));
    }
    frame->received_us = received_us;
}

void CAN1_RX0_Handler(void);
void CAN1_RX0_Handler(void) {
    const uint64_t received_us = ticks_now_us(NULL);
    const uint8_t next = (uint8_t)((active->head + 1U) % CAN_RING_FRAMES);
    if ((CAN1->rfr[0] & CAN_RFR_OVERRUN) != 0U) {
        CAN1->rfr[0] = CAN_RFR_OVERRUN;
        active->lost++;
    }
    if ((CAN1->rfr[0] & CAN_RFR_PENDING) == 0U) {
        return;
    }
    if (next == active->tail) {
        active->lost++;
    } else {
        read_box(&active->ring[active->head], received_us);
        active->head = next;
    }
    CAN1->rfr[0] = CAN_RFR_RELEASE;
    ticks_wake();
}

/* Wakes the main loop, which refills the mailbox. */
void CAN1_TX_Handler(void);
void CAN1_TX_Handler(void) {
    CAN1->tsr = CAN_TSR_DONE_ALL;
    ticks_wake();
}
