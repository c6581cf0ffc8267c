/* What the core asks of the hardware it runs on. Every port (ATmega328P, host library) provides these.
 *
 * Times are ticks of the board's clock: u32 at 2 MHz, wrapping, compared as signed differences. */
#ifndef PORT_H
#define PORT_H

#include <stdbool.h>
#include <stdint.h>

struct board;
struct coil_heat;

/* The clock now. */
uint32_t port_now(struct board *b);

/* Hands `count` bytes to the uplink, behind what waits there; waits for room rather than lose any. */
void port_transmit(struct board *b, const uint8_t *bytes, uint8_t count);

/* The tick at which the uplink will have sent all it was given; a tick not later than now if it is idle. */
uint32_t port_uplink_free(struct board *b);

/* Makes the outputs `word` now. Forgets what was prepared. */
void port_apply(struct board *b, uint32_t word);

/* Makes the outputs `word` at tick `due`, or at once if that has passed, and calls board_edge(b, due): then, or, where
 * a CPU needs to know early what follows, up to 200 us before. From that call on the word can no longer be replaced;
 * until it, another call replaces it. May be called from within board_edge. */
void port_prepare(struct board *b, uint32_t word, uint32_t due);

/* Forgets what was prepared. */
void port_prepare_nothing(struct board *b);

/* Keeps board_edge from running until port_unlock(b, what port_lock returned). Short sections only. */
uint8_t port_lock(struct board *b);
void port_unlock(struct board *b, uint8_t key);

/* One analogue input now, 0 to 1023; takes up to 30 us. */
uint16_t port_convert(struct board *b, uint8_t input);

/* The lid is closed. A board without a lid returns true. */
bool port_interlock_closed(struct board *b);

/* Coil board: memory that a reset leaves as it was, and in which a loss of power leaves anything; one for each
 * coil. */
struct coil_heat *port_heat(struct board *b);

/* Coil board: notes (coil_heat.h) that are kept without power; a new board has none. Main loop only. */
uint8_t port_notes(struct board *b);
void port_note(struct board *b, uint8_t note, bool holds);

/* Shows state and fault mask to a debugger. */
void port_show(struct board *b, uint8_t state, uint16_t faults);

/* Eight characters, zero padded: which build of the firmware this is. */
extern const char port_build[8];

#endif
