/* The coil board: four shift registers, the feed switch on PD4. */

#include <avr/io.h>
#include <stdbool.h>

#include "../core/port.h"
#include "../core/tactiles.h"
#include "wiring.h"

#define FEED_HIGH 0x80u /* of bits 8 to 15 of the word: bit 15 */

const char port_build[8] = "avr-tac1";

const struct settings wiring_built_settings = {.limits = {UINT16_MAX, UINT16_MAX, UINT16_MAX, 0, UINT16_MAX}};

const uint16_t wiring_ahead = 400; /* 200 us: four edges */
const bool wiring_waits = false;   /* nothing is judged by the microsecond */

struct board *wiring_board(void)
{
    static struct tactiles tactiles;
    tactiles_init(&tactiles);
    return &tactiles.board;
}

uint8_t wiring_port_d(uint32_t word)
{
    return (uint8_t)(word >> 8) & FEED_HIGH ? _BV(PD4) : 0;
}

uint32_t wiring_chain(uint32_t word)
{
    return word;
}

uint8_t wiring_sense(uint8_t input)
{
    return input; /* supply on A0, current on A1 */
}

bool port_interlock_closed(struct board *b)
{
    (void)b;
    return true; /* no lid */
}
