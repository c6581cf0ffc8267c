/* EEPROM: bytes 0 to 11 the settings (five limits and the nominal capacitance, u16 each), 12 and 13 their
 * CRC-16/X-25, 14 to 17 the number of boots; 18 and 19 a note each, 0xff where it was never made. Little endian. */

#include "store.h"

#include <avr/eeprom.h>
#include <stdbool.h>
#include <string.h>
#include <util/crc16.h>

#include "../core/coil_heat.h"
#include "../core/port.h"
#include "wiring.h"

#define SETTINGS_AT ((const void *)0)
#define CRC_AT ((const uint16_t *)12)
#define BOOTS_AT ((uint32_t *)14)
#define USED_AT ((uint8_t *)18)
#define WARM_AT ((uint8_t *)19)
#define NO 0xffu /* erased */
#define YES 0u

static struct coil_heat heat[COIL_CHANNELS] __attribute__((section(".noinit")));

static uint16_t sum_of(const struct settings *settings)
{
    const uint8_t *bytes = (const uint8_t *)settings;
    uint16_t crc = 0xffff;
    for (uint8_t i = 0; i < sizeof *settings; i++)
        crc = _crc_ccitt_update(crc, bytes[i]);
    return (uint16_t)~crc;
}

void store_settings(struct settings *settings)
{
    eeprom_read_block(settings, SETTINGS_AT, sizeof *settings);
    if (sum_of(settings) != eeprom_read_word(CRC_AT))
        *settings = wiring_built_settings;
}

/* Every step can be undone, so that different counts give different ids; they only look unlike each other. */
static uint32_t mixed(uint32_t count)
{
    for (uint8_t i = 0; i < 2; i++) {
        count *= 0x9e3779b1ul;
        count ^= count >> 15;
    }
    return count;
}

uint32_t store_boot_id(void)
{
    uint32_t boots = eeprom_read_dword(BOOTS_AT) + 1;
    eeprom_update_dword(BOOTS_AT, boots);
    return mixed(boots);
}

struct coil_heat *port_heat(struct board *b)
{
    (void)b;
    return heat;
}

void store_forget_heat(void)
{
    memset(heat, 0, sizeof heat); /* no check that holds */
}

uint8_t port_notes(struct board *b)
{
    (void)b;
    uint8_t notes = 0;
    if (eeprom_read_byte(USED_AT) != NO)
        notes |= NOTE_USED;
    if (eeprom_read_byte(WARM_AT) != NO)
        notes |= NOTE_WARM;
    return notes;
}

/* Only begins to write, unless the note before is less than 3.4 ms old. */
void port_note(struct board *b, uint8_t note, bool holds)
{
    (void)b;
    eeprom_write_byte(note == NOTE_USED ? USED_AT : WARM_AT, holds ? YES : NO);
}
