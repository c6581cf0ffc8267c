/* The serial line, 500 000 baud: rings on both sides of the interrupts. port.h's transmit and uplink_free are here. */
#ifndef UART_H
#define UART_H

#include <stdbool.h>
#include <stdint.h>

void uart_start(void);

/* The next byte that came in. Where it ends a frame, `arrived` is the tick at which it did. False: none waits. */
bool uart_take(uint8_t *byte, uint32_t *arrived);

/* Whether uart_take has something. */
bool uart_waits(void);

#endif
