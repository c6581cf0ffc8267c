/* The analogue inputs: one conversion at a time, 26 us at 500 kHz; interrupts stay on. */

#include <avr/io.h>
#include <util/delay_basic.h>

#include "../core/port.h"
#include "outputs.h"
#include "senses.h"
#include "wiring.h"

#define SETTLE_LOOPS 11u /* of 3 cycles: 2 us for the 4051 */
#define CHANNEL 0x0fu
#define THROUGH_4051 0xe0u

void senses_start(void)
{
    DIDR0 = 0x3f; /* no digital inputs there */
    ADCSRA = _BV(ADEN) | _BV(ADPS2) | _BV(ADPS0);
}

uint16_t port_convert(struct board *b, uint8_t input)
{
    (void)b;
    uint8_t sense = wiring_sense(input);
    outputs_select(sense & THROUGH_4051);
    ADMUX = _BV(REFS0) | (sense & CHANNEL); /* against the 5 V supply */
    _delay_loop_1(SETTLE_LOOPS);
    ADCSRA |= _BV(ADSC);
    while (ADCSRA & _BV(ADSC)) {
    }
    return ADC;
}
