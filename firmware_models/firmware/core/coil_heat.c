#include "coil_heat.h"

#include "constants.h"

#define UNIT (HEAT_UNIT_MS * DURATIONS_PER_MS)
#define BY_UNIT 164u /* 65536 over it, and a little more */

/* Never that of memory full of zeros or ones. */
static uint16_t check_of(uint32_t on_time)
{
    return (uint16_t)(0x5a5au ^ (uint16_t)on_time ^ (uint16_t)(on_time >> 16));
}

static void set(struct coil_heat *heat, uint32_t on_time)
{
    heat->on_time = on_time;
    heat->check = check_of(on_time);
}

/* Without the note of warmth less than WARM_MS are unaccounted for; before the first use nothing is. */
void heat_start(struct coil_heat heat[COIL_CHANNELS], uint8_t notes, uint16_t limit_ms)
{
    uint16_t worst_ms = notes & NOTE_WARM ? limit_ms : notes & NOTE_USED ? WARM_MS : 0;
    for (uint8_t channel = 0; channel < COIL_CHANNELS; channel++) {
        if (heat[channel].check != check_of(heat[channel].on_time))
            set(&heat[channel], heat_of_ms(worst_ms));
    }
}

bool heat_exceeds(const struct coil_heat *heat, uint8_t duration, uint16_t limit_ms)
{
    return heat->on_time + ((uint32_t)duration << 16) > heat_of_ms(limit_ms);
}

void heat_charge(struct coil_heat *heat, uint16_t durations)
{
    set(heat, heat->on_time + ((uint32_t)durations << 16));
}

void heat_refund(struct coil_heat *heat, uint16_t durations)
{
    set(heat, heat->on_time - ((uint32_t)durations << 16));
}

/* By a 2^HEAT_SHIFT-th, rounded up, so that an account ends at nothing. */
uint32_t heat_decay(struct coil_heat heat[COIL_CHANNELS], const uint16_t waiting[COIL_CHANNELS])
{
    uint32_t max = 0;
    for (uint8_t channel = 0; channel < COIL_CHANNELS; channel++) {
        uint32_t on_time = heat[channel].on_time;
        if (on_time == 0)
            continue;
        uint32_t played = on_time - ((uint32_t)waiting[channel] << 16);
        on_time -= (played + ((1u << HEAT_SHIFT) - 1u)) >> HEAT_SHIFT;
        set(&heat[channel], on_time);
        max = on_time > max ? on_time : max;
    }
    return max;
}

/* Without a division, which an 8-bit CPU takes its time for: never more than rounded down, then one more if need be. */
uint8_t heat_units(const struct coil_heat *heat, uint16_t without)
{
    uint16_t durations = (uint16_t)(((heat->on_time + UINT16_MAX) >> 16) - without);
    uint16_t units = (uint16_t)((uint32_t)durations * BY_UNIT >> 16);
    return (uint8_t)(units * UNIT < durations ? units + 1u : units);
}
