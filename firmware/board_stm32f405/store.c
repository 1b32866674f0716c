/* The node number in the last flash sector, written behind the one before: a word is programmed
 * in 16 us, while erasing would stall the pod for a second. 32,768 numbers fit; flashing the
 * sector again empties it (docs/bring-up.md).
 */
#include "../core/pod_crc.h"
#include "board.h"

#define STORE ((volatile uint32_t *)0x080E0000UL)
#define STORE_WORDS 32768U
#define EMPTY 0xFFFFFFFFUL
#define MARK 0x50U
#define BUSY_TURNS 200000U

static uint32_t word_of(const uint8_t node) {
    const uint8_t bytes[2] = {MARK, node};
    return MARK | ((uint32_t)node << 8) | ((uint32_t)pod_crc8(bytes, 2U) << 16);
}

/* Words are used from the front, so halving finds the first empty one. */
static uint32_t first_empty(void) {
    uint32_t low = 0U;
    uint32_t high = STORE_WORDS;
    while (low < high) {
        const uint32_t middle = (low + high) / 2U;
        if (STORE[middle] == EMPTY) {
            high = middle;
        } else {
            low = middle + 1U;
        }
    }
    return low;
}

uint8_t store_read(void) {
    const uint32_t used = first_empty();
    if (used == 0U) {
        return POD_NODE_NONE;
    }
    const uint32_t word = STORE[used - 1U];
    const uint8_t node = (uint8_t)(word >> 8);
    return word == word_of(node) && node < POD_NODES ? node : POD_NODE_NONE;
}

static bool is_ready(void) {
    for (uint32_t i = 0; i < BUSY_TURNS; i++) {
        if ((FLASH->sr & FLASH_SR_BSY) == 0U) {
            return true;
        }
    }
    return false;
}

bool store_node(void *const context, const uint8_t node) {
    (void)context;
    const uint32_t at = first_empty();
    if (store_read() == node) {
        return true;
    }
    if (at == STORE_WORDS || !is_ready()) {
        return false;
    }
    FLASH->keyr = FLASH_KEY_1;
    FLASH->keyr = FLASH_KEY_2;
    FLASH->sr = FLASH_SR_ERRORS;
    FLASH->cr = FLASH_CR_PG | FLASH_CR_SIZE_32;
    STORE[at] = word_of(node);
    const bool is_done = is_ready() && (FLASH->sr & FLASH_SR_ERRORS) == 0U;
    FLASH->cr = FLASH_CR_LOCK;
    return is_done && store_read() == node;
}
