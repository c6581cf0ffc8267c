/* What the EEPROM keeps. */
#ifndef STORE_H
#define STORE_H

#include <stdint.h>

#include "../core/board.h"

/* The settings there; those that leave every limit as built if there are none, or they are damaged. */
void store_settings(struct settings *settings);

/* Counts this boot and returns an id that no boot of this board before had. */
uint32_t store_boot_id(void);

/* Power was lost: what memory holds of the coils' heat is not believed. */
void store_forget_heat(void);

#endif
