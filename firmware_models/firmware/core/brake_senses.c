#include "brake_senses.h"

#include "brake.h"
#include "port.h"

uint16_t output_volts(struct brake *k, uint8_t output)
{
    return (uint16_t)(port_convert(&k->board, output) * V_PER_COUNT);
}

/* A count is rounded: what reads 60 V may be 59 or 61. */
static bool surely_empty(uint16_t count)
{
    return count * V_PER_COUNT < DISCHARGED_V;
}

bool outputs_empty(struct brake *k, uint8_t *worst)
{
    if (surely_empty(port_convert(&k->board, HIGHEST_INPUT)))
        return true;
    /* It may be the bus, which only its bleeder empties, behind a bridge that is shorted. */
    for (uint8_t output = 0; output < BRAKE_CHANNELS; output++) {
        if (!surely_empty(port_convert(&k->board, output))) {
            *worst = output;
            return false;
        }
    }
    return true;
}

bool touchable(struct brake *k)
{
    uint16_t at_most = (uint16_t)(port_convert(&k->board, HIGHEST_INPUT) * V_PER_COUNT + V_PER_COUNT / 2);
    return at_most * 10u > TOUCHABLE_DV;
}
