#include "clock.h"

#include <avr/interrupt.h>
#include <avr/io.h>
#include <util/atomic.h>

#define START (0xffffu - 305u) /* upper half of the first tick: 10 s before the wrap */
#define MIN_AHEAD 2          /* ticks by which a compare must lie ahead to be met for certain */
#define SLACK 40               /* ticks by which the main loop may wake late */

static volatile uint16_t overflows = START;

void clock_start(void)
{
    TIMSK1 = _BV(TOIE1) | _BV(OCIE1A) | _BV(OCIE1B);
    TCCR1B = _BV(CS11); /* 16 MHz / 8 */
}

uint32_t clock_now(void)
{
    union {
        uint32_t ticks;
        struct {
            uint16_t low, high;
        };
    } now;
    ATOMIC_BLOCK(ATOMIC_RESTORESTATE)
    {
        now.low = TCNT1;
        now.high = overflows;
        if ((TIFR1 & _BV(TOV1)) && now.low < 0x8000u)
            now.high++; /* it has overflowed, and the interrupt still waits */
    }
    return now.ticks;
}

/* A compare that comes a little before `at` is left as it is: in simavr 1.6 a write to any compare makes those that
 * have passed come again, which would wake the CPU, which would write again. */
bool clock_wake_at(uint32_t at)
{
    static uint16_t wake;
    uint16_t low = (uint16_t)at;
    if ((int16_t)(wake - TCNT1) < MIN_AHEAD || (int16_t)(wake - low) > SLACK)
        OCR1B = wake = low;
    return (int16_t)(wake - TCNT1) >= MIN_AHEAD;
}

ISR(TIMER1_OVF_vect)
{
    overflows++;
}

EMPTY_INTERRUPT(TIMER1_COMPB_vect) /* wakes the main loop */
