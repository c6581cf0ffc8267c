/* What differs between the two boards' hardware; one of wiring_tactiles.c and wiring_brake.c goes into each image. */
#ifndef WIRING_H
#define WIRING_H

#include <stdbool.h>
#include <stdint.h>

#include "../core/board.h"

/* The board's core, ready for board_start. */
struct board *wiring_board(void);

/* Settings that leave every limit as built, for a board whose EEPROM holds none. */
extern const struct settings wiring_built_settings;

/* How many ticks before an edge it is reported to the core as played, and whether the main loop then waits for it
 * (outputs.c). */
extern const uint16_t wiring_ahead;
extern const bool wiring_waits;

/* PD2 to PD4 at this output word. */
uint8_t wiring_port_d(uint32_t word);

/* What is shifted out for this output word, its highest byte first. */
uint32_t wiring_chain(uint32_t word);

/* Where a sense comes in: ADC channel in bits 0 to 3; PD5 to PD7, which lead to channel 0, in bits 5 to 7. */
uint8_t wiring_sense(uint8_t input);

#endif
