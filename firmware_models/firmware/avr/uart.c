#include "uart.h"

#include <avr/interrupt.h>
#include <avr/io.h>
#include <util/atomic.h>

#include "../core/port.h"
#include "../core/protocol.h"
#include "clock.h"

#define DIVISOR 1u /* 16 MHz / (16 * (1 + 1)) = 500 000, exactly */
#define DELIMITER 0u
#define TICKS_PER_BYTE 40u
#define SENT_SIZE 192u
#define IDLE_SINCE TICK_HZ
#define STAMPS 32u /* more frames than are ever whole in the ring */

/* Both rings: `head` is where the next byte goes in, moved by one side; `tail` where it comes out, moved by the
 * other. */
static volatile uint8_t received[256];
static volatile uint8_t received_head, received_tail;
static volatile uint16_t stamps[STAMPS]; /* low half of the tick at which a frame ended */
static volatile uint8_t stamps_head, stamps_tail;
static volatile uint8_t sent[SENT_SIZE];
static volatile uint8_t sent_head, sent_tail;
static uint32_t sent_until; /* when the line will have sent all of it */

void uart_start(void)
{
    UCSR0A = 0; /* a boot loader may have left it at double speed */
    UCSR0C = _BV(UCSZ01) | _BV(UCSZ00);
    UBRR0H = 0;
    UBRR0L = DIVISOR;
    UCSR0B = _BV(RXCIE0) | _BV(RXEN0) | _BV(TXEN0);
}

/* Whether the byte in this place, a delimiter, ends a frame, and so has a stamp: not so right behind another one.
 * Place -1 still holds the byte before, for the ring is never quite full. */
static inline bool ends_frame(uint8_t place)
{
    return received[(uint8_t)(place - 1u)] != DELIMITER;
}

/* A byte for which there is no room is lost, and the frame with it. */
ISR(USART_RX_vect)
{
    do {
        uint8_t byte = UDR0;
        uint8_t head = received_head;
        uint8_t next = (uint8_t)(head + 1u);
        if (next == received_tail)
            continue;
        if (byte == DELIMITER && ends_frame(head)) {
            uint8_t at = stamps_head;
            uint8_t beyond = (at + 1u) % STAMPS;
            if (beyond == stamps_tail)
                continue;
            stamps[at] = TCNT1;
            stamps_head = beyond;
        }
        received[head] = byte;
        received_head = next;
    } while (UCSR0A & _BV(RXC0));
}

bool uart_waits(void)
{
    return received_head != received_tail;
}

bool uart_take(uint8_t *byte, uint32_t *arrived)
{
    uint8_t tail = received_tail;
    if (tail == received_head)
        return false;
    *byte = received[tail];
    if (*byte == DELIMITER && ends_frame(tail)) {
        uint32_t now = clock_now();
        *arrived = now - (uint16_t)((uint16_t)now - stamps[stamps_tail]);
        stamps_tail = (stamps_tail + 1u) % STAMPS;
    }
    received_tail = (uint8_t)(tail + 1u);
    return true;
}

ISR(USART_UDRE_vect)
{
    uint8_t tail = sent_tail;
    UDR0 = sent[tail];
    tail = tail + 1u == SENT_SIZE ? 0 : tail + 1u;
    sent_tail = tail;
    if (tail == sent_head)
        UCSR0B &= (uint8_t)~_BV(UDRIE0);
}

void port_transmit(struct board *b, const uint8_t *bytes, uint8_t count)
{
    uint32_t now = port_now(b), free = port_uplink_free(b);
    sent_until = ((int32_t)(free - now) > 0 ? free : now) + count * TICKS_PER_BYTE;
    while (count--) {
        uint8_t head = sent_head;
        uint8_t next = head + 1u == SENT_SIZE ? 0 : head + 1u;
        while (next == sent_tail) {
        }
        sent[head] = *bytes++;
        ATOMIC_BLOCK(ATOMIC_RESTORESTATE)
        {
            sent_head = next; /* together: the interrupt must not find the ring empty and itself allowed */
            UCSR0B |= _BV(UDRIE0);
        }
    }
}

/* Predicted, not asked: bytes leave at the line's rate, one behind the other. When idle, a tick that is not later
 * than any that the core may still hold for now. */
uint32_t port_uplink_free(struct board *b)
{
    uint32_t now = port_now(b);
    uint32_t left = sent_until - now;
    return left <= (SENT_SIZE + 2u) * TICKS_PER_BYTE ? sent_until : now - IDLE_SINCE;
}
