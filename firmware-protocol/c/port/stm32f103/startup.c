/* The start of a Cortex-M: the vector table, initialised memory, and the functions that GCC needs without a library. */
#include <stddef.h>
#include <stdint.h>

#include "stm32f103.h"

/* From the linker script. */
extern uint32_t stack_end[], data_begin[], data_end[], data_in_flash[], bss_begin[], bss_end[];

int main(void);
void *memcpy(void *restrict to, const void *restrict from, size_t count);
void *memset(void *to, int byte, size_t count);

void *memcpy(void *restrict to, const void *restrict from, size_t count)
{
    uint8_t *out = to;
    const uint8_t *in = from;
    while (count-- > 0) {
        *out++ = *in++;
    }
    return to;
}

void *memset(void *to, int byte, size_t count)
{
    uint8_t *out = to;
    while (count-- > 0) {
        *out++ = (uint8_t)byte;
    }
    return to;
}

/* A processor fault or an unexpected interrupt: the node goes silent, and the plant finds the exciter lost. */
static void trap(void)
{
    for (;;) {
    }
}

static void reset(void)
{
    const uint32_t *from = data_in_flash;
    for (uint32_t *to = data_begin; to < data_end; to++) {
        *to = *from++;
    }
    for (uint32_t *to = bss_begin; to < bss_end; to++) {
        *to = 0;
    }
    stm32f103_start();
    (void)main();
    trap();
}

/* The initial stack pointer, reset, and the exceptions 2 to 15. Peripherals are polled. */
typedef struct {
    uint32_t *stack;
    void (*handlers[15])(void);
} vector_table;

__attribute__((section(".vectors"), used)) static const vector_table vectors = {
    stack_end, {reset, trap, trap, trap, trap, trap, trap, trap, trap, trap, trap, trap, trap, trap, trap}};
