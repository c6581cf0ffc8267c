/* The outputs: words that take effect at their ticks. port.h's apply, prepare and lock are here. */
#ifndef OUTPUTS_H
#define OUTPUTS_H

#include <stdint.h>

struct board;

/* All off, then drivers enabled. `b` is whose board_edge is called. */
void outputs_start(struct board *b);

/* Leads one of the 4051's inputs to ADC channel 0: PD5 to PD7 as in `select`. */
void outputs_select(uint8_t select);

#endif
