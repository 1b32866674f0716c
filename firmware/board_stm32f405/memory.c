/* The two functions that the compiler calls on its own in a freestanding program. */
#include <stddef.h>
#include <stdint.h>

void *memcpy(void *restrict to, const void *restrict from, size_t length);
void *memset(void *to, int value, size_t length);

void *memcpy(void *restrict const to, const void *restrict const from, const size_t length) {
    uint8_t *const target = to;
    const uint8_t *const source = from;
    for (size_t i = 0; i < length; i++) {
        target[i] = source[i];
    }
    return to;
}

void *memset(void *const to, const int value, const size_t length) {
    uint8_t *const target = to;
    for (size_t i = 0; i < length; i++) {
        target[i] = (uint8_t)value;
    }
    return to;
}
