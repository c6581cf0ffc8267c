/* What `arm` begins: each output's capacitance, at a voltage that makes no force.
 *
 * One output after the other hangs on the bridge. A pulse of the supply's constant current, of known length, lifts
 * it by some volts; then the supply is off and the output keeps its charge (through the bleeder it loses a
 * thousandth in a millisecond), so that a conversion may take its time. A short first pulse, which lifts the minimum
 * that counts as a brake to 20 V, gives how long the second must be to reach 24 V, well below the 30 V from which on
 * the supply at 40 V is no longer a current source. C = I t / V of the second, less what is stray. */
#ifndef BRAKE_SELF_TEST_H
#define BRAKE_SELF_TEST_H

#include <stdint.h>

struct self_test {
    uint8_t output;
    uint8_t step;
    uint16_t ticks;  /* of the pulse in hand */
    uint16_t before; /* counts of the low sense before it */
    uint32_t over;   /* when it ends */
};

struct brake;

/* Begins it; the state is self_test until it has set another. */
void self_test_start(struct brake *k, uint32_t now);

/* At k->due. */
void self_test_poll(struct brake *k);

#endif
