/* The brake controller's inputs and their scales: docs/reference/boards.md. */
#ifndef BRAKE_SENSES_H
#define BRAKE_SENSES_H

#include "board_impl.h"

enum { /* behind one for each output: its magnitude */
    BRIDGE_INPUT = 5,  /* signed */
    LOW_INPUT = 6,     /* magnitude on the bridge, fine */
    HIGHEST_INPUT = 7, /* of bus and outputs */
    CURRENT_INPUT = 8, /* what the supply gives, 1 uA a count */
    BUS_INPUT = 9,
};

#define V_PER_COUNT 2u /* outputs, highest, bus */
#define BRIDGE_V_PER_COUNT 4
#define BRIDGE_ZERO 512
#define LOW_COUNTS_PER_V 16u

struct brake;

/* Volts on one output. */
uint16_t output_volts(struct brake *k, uint8_t output);

/* All outputs are surely below DISCHARGED_V. `worst`: one that is not. */
bool outputs_empty(struct brake *k, uint8_t *worst);

/* An output or the bus may be at TOUCHABLE_DV or more. */
bool touchable(struct brake *k);

#endif
