/* How long each coil was on of late: an account that on-time fills, and that decays as a tactor cools. Commands that
 * would take it beyond its limit are refused, so that no host can burn a tactor (docs/reference/protocol.md). */
#ifndef COIL_HEAT_H
#define COIL_HEAT_H

#include <stdbool.h>
#include <stdint.h>

#include "protocol.h"

/* One coil's. It lies in memory that a reset leaves as it was; the check separates what was written here from what a loss
 * of power left. A CRC over all of them would take the CPU from the line for longer than that may wait. */
struct coil_heat {
    uint32_t on_time; /* 50 us / 65536; what waits in the queue included */
    uint16_t check;
};

/* What is kept without power, too: port_notes. */
enum {
    NOTE_USED = 1, /* a coil was asked for, ever */
    NOTE_WARM = 2  /* an account may be above WARM_MS */
};

/* Power-on or reset: what the check vouches for goes on; for the rest the worst that the notes allow is taken for true. */
void heat_start(struct coil_heat heat[COIL_CHANNELS], uint8_t notes, uint16_t limit_ms);

/* A pulse of `duration` (50 us) would take the account beyond the limit. */
bool heat_exceeds(const struct coil_heat *heat, uint8_t duration, uint16_t limit_ms);

void heat_charge(struct coil_heat *heat, uint16_t durations);
void heat_refund(struct coil_heat *heat, uint16_t durations);

/* HEAT_STEP_TICKS have passed: what was on has cooled, what waits (50 us, for each coil) has not. Returns the largest
 * account. */
uint32_t heat_decay(struct coil_heat heat[COIL_CHANNELS], const uint16_t waiting[COIL_CHANNELS]);

/* In HEAT_UNIT_MS, rounded up, as telemetry has it; `without` so much of it (50 us). */
uint8_t heat_units(const struct coil_heat *heat, uint16_t without);

#define DURATIONS_PER_MS (TICKS_PER_MS / DURATION_TICKS)

/* An account of so many ms, up to 3276. */
static inline uint32_t heat_of_ms(uint16_t ms)
{
    return (uint32_t)(uint16_t)(ms * DURATIONS_PER_MS) << 16;
}

#endif
