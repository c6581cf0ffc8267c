/* The brake controller: two shift registers behind the setpoint's converter, bridge and high-voltage enable on PD2
 * to PD4. */

#include <avr/io.h>
#include <stdbool.h>

#include "../core/brake.h"
#include "../core/constants.h"
#include "../core/port.h"
#include "wiring.h"

#define ENABLE_HIGH 0x04u   /* of bits 8 to 15 of the word: bit 10 */
#define POSITIVE_HIGH 0x08u /* bit 11 */
#define NEGATIVE_HIGH 0x10u /* bit 12 */
#define CONVERTER 0x3000u   /* MCP4921: write, gain 1, on; the count in bits 0 to 11 */
#define WIRED 0x03ffu       /* of the word: outputs and piezos */
#define MAX_COUNTS 4095u
#define COUNTS_PER_V 2u
#define BRIDGE_INPUT 5u

const char port_build[8] = "avr-brk1";

const struct settings wiring_built_settings = {
    .limits = {UINT16_MAX, UINT16_MAX, UINT16_MAX, UINT16_MAX, UINT16_MAX},
    .nominal_pf = NOMINAL_PF,
};

const uint16_t wiring_ahead = 300; /* 150 us: both edges of a self test pulse of 18 us, by whose length C is measured */
const bool wiring_waits = true;    /* guards hold what they sense against what the outputs are */

struct board *wiring_board(void)
{
    static struct brake brake;
    brake_init(&brake);
    return &brake.board;
}

uint8_t wiring_port_d(uint32_t word)
{
    uint8_t high = (uint8_t)(word >> 8);
    uint8_t bridge = high & (POSITIVE_HIGH | NEGATIVE_HIGH);
    uint8_t pins = high & ENABLE_HIGH ? _BV(PD4) : 0;
    if (bridge == POSITIVE_HIGH)
        pins |= _BV(PD2);
    else if (bridge == NEGATIVE_HIGH)
        pins |= _BV(PD3);
    return pins;
}

/* One stream for both: the converter takes the first 16 bits after its select falls and ignores the rest, the two
 * registers keep the last 16. */
uint32_t wiring_chain(uint32_t word)
{
    uint16_t volts = (uint16_t)(word >> 16);
    uint16_t counts = volts > MAX_COUNTS / COUNTS_PER_V ? MAX_COUNTS : volts * COUNTS_PER_V;
    return (uint32_t)(CONVERTER | counts) << 16 | ((uint16_t)word & WIRED);
}

uint8_t wiring_sense(uint8_t input)
{
    if (input < BRIDGE_INPUT)
        return (uint8_t)(input << 5); /* an output, through the 4051 on A0 */
    return (uint8_t)(input - BRIDGE_INPUT + 1u);
}

bool port_interlock_closed(struct board *b)
{
    (void)b;
    return !(PINB & _BV(PINB4));
}
