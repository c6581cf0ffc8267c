/* The board's clock: timer 1 at 2 MHz, extended to 32 bits by its overflows. */
#ifndef CLOCK_H
#define CLOCK_H

#include <stdbool.h>
#include <stdint.h>

/* Starts counting, a few seconds before the count wraps, so that what cannot stand a wrap fails on every board, at
 * once. */
void clock_start(void);

/* Ticks; anywhere, interrupts on or off. */
uint32_t clock_now(void);

/* Wakes the CPU at tick `at`, less than 16 ms ahead, or a little earlier. False: it is too near, do not sleep.
 * Interrupts off. */
bool clock_wake_at(uint32_t at);

#endif
