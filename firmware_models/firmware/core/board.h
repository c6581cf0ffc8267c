/* What both boards do: frames in, one reply each, faults that latch, a dead-man, telemetry. */
#ifndef BOARD_H
#define BOARD_H

#include <stdbool.h>
#include <stdint.h>

#include "protocol.h" /* generated from the message table */

/* What a lab may set without building anew; limits only ever stricter than the built ones (board_start sees to it). */
struct settings {
    uint16_t limits[LIMITS]; /* in the order of identity.limits */
    uint16_t nominal_pf;     /* brake: capacitance of a sound brake; tactiles: unused */
};

struct board; /* common part, the first member of struct tactiles and struct brake */

/* Power-on. `boot_id` differs from that of the boot before; `brown_out`: the last reset was one. Outputs are off, telemetry
 * waits until a host has asked identify. */
void board_start(struct board *b, const struct settings *settings, uint32_t boot_id, bool brown_out);

/* One byte from the line whose last bit came in at tick `arrived`. Acts when it ends a frame. Main loop only. */
void board_receive(struct board *b, uint8_t byte, uint32_t arrived);

/* Does what is due by itself: dead-man, telemetry, guards, self test, interlock. Main loop only. */
void board_poll(struct board *b);

/* How many ticks from now board_poll has nothing to do. */
uint32_t board_idle_ticks(struct board *b);

/* The prepared outputs are, or surely will be, taken over at tick `due`. Called by the port, from its edge interrupt. */
void board_edge(struct board *b, uint32_t due);

#endif
