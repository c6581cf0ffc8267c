/* An image on a simulated ATmega328P, with the board's wiring around it, run cycle by cycle by its user: what Python
 * sees.
 *
 * Times are CPU cycles since power-on, resets included. What happens depends on the bytes and senses handed in and
 * on their cycles, and on nothing else; in particular not on how far lockstep_run goes at a time. */
#ifndef LOCKSTEP_H
#define LOCKSTEP_H

#include <stdint.h>

/* Called only from within lockstep_run and lockstep_reset, in the order of their cycles. */
struct lockstep_calls {
    /* The board's output word (docs/reference/boards.md) as the pins have it, on changes only. */
    void (*outputs)(void *user, uint32_t word, uint64_t cycle);
    /* A byte was put on the line to the host; its stop bit ends at `ends`, at least 10 bits later. */
    void (*transmit)(void *user, uint32_t byte, uint64_t ends);
    /* A conversion of the board's analogue input begins; 0 to 1023. */
    uint32_t (*convert)(void *user, uint32_t input, uint64_t cycle);
    /* The watchdog resets the CPU. */
    void (*watchdog)(void *user, uint64_t cycle);
};

enum lockstep_cause { LOCKSTEP_POWER_ON = 1, LOCKSTEP_EXTERNAL = 2, LOCKSTEP_BROWN_OUT = 4 }; /* bits of MCUSR */

/* `board`: 1 tactiles, 2 brake. `hex`: path of the image. In reset until lockstep_reset. NULL: no such file, or no
 * memory. */
void *lockstep_new(uint32_t board, const char *hex, const struct lockstep_calls *calls, void *user);
void lockstep_free(void *sim);

/* Resets the CPU now. Flash and EEPROM stay; a loss of power empties registers and converter as well. */
void lockstep_reset(void *sim, uint32_t cause);

/* Bytes on the line to the board, each with the cycle at which its stop bit ends: ascending, after what was handed
 * in before, and after the cycle reached. 0: no memory. */
int lockstep_feed(void *sim, const uint8_t *bytes, const uint64_t *ends, uint32_t count);

/* The lid's contact, from now on. */
void lockstep_lid(void *sim, int closed);

/* Runs until the cycle is `until` or, by less than one instruction, beyond. 0: the CPU has stopped for good. */
int lockstep_run(void *sim, uint64_t until);

uint64_t lockstep_cycle(void *sim);

/* The next cycle at which something may happen. Whatever is transmitted before it ends no earlier than it. */
uint64_t lockstep_next(void *sim);

/* The cycle at which timer 1 was started last; it counts from 0. */
uint64_t lockstep_clock_begun(void *sim);

/* What the firmware shows a debugger. */
uint32_t lockstep_state(void *sim);
uint32_t lockstep_faults(void *sim);

/* Bytes lost because the CPU left too many in the UART. */
uint32_t lockstep_lost(void *sim);

uint8_t *lockstep_eeprom(void *sim); /* 1024 bytes */
uint8_t *lockstep_flash(void *sim);  /* 32768 bytes */
uint8_t *lockstep_ram(void *sim);    /* 2048 bytes */
uint32_t lockstep_pc(void *sim);     /* of the next instruction, bytes */

#endif
