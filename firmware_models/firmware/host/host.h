/* The core as a shared library: what Python sees. All of a board is in one object, so that a process may hold many. */
#ifndef HOST_H
#define HOST_H

#include <stdint.h>

#include "../core/board.h"
#include "../core/coil_heat.h"

/* What the library asks of its user; called only from within the functions below. */
struct host_calls {
    void (*transmit)(void *user, const uint8_t *bytes, uint32_t count);
    uint32_t (*uplink_busy)(void *user);              /* ticks until what was handed over has left; 0: idle */
    void (*outputs)(void *user, uint32_t word);       /* the output word is this from now on; called on changes only */
    uint32_t (*convert)(void *user, uint32_t input);  /* 0 to 1023 */
    uint32_t (*interlock_closed)(void *user);
};

/* What outlives a boot; all zeros on a new board. A loss of power leaves anything in `heat`. */
struct host_memory {
    struct coil_heat heat[COIL_CHANNELS];
    uint8_t notes;
};

/* `board`: 1 tactiles, 2 brake. `now`: the clock at power-on. `memory` is the
 * board's own, and stays the caller's. NULL: no memory, or no such board. */
void *host_new(uint32_t board, const struct settings *settings, uint32_t boot_id, uint32_t brown_out, uint32_t now,
               struct host_memory *memory, const struct host_calls *calls, void *user);
void host_free(void *host);

/* Bytes whose last bit came in at `now`, and whatever they make due. */
void host_receive(void *host, const uint8_t *bytes, uint32_t count, uint32_t now);

/* Everything due at or before `now`. */
void host_run(void *host, uint32_t now);

/* Ticks from `now` until host_run is needed, at most 2^31 - 1. */
uint32_t host_next(void *host, uint32_t now);

uint32_t host_state(void *host);
uint32_t host_faults(void *host);

#endif
