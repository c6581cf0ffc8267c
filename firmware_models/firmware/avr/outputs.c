/* A word is shifted into the chain before its tick comes. At its tick only pins move: the bridge, feed and enable pins,
 * and the latch: low, it takes over the setpoint that the converter was given; rising, what the shift registers hold.
 *
 * Timer 1's compare A fires LEAD ticks early; the interrupt waits out the rest, so that an edge is never early, and
 * late by no more than what held the interrupt up beyond LEAD. The same compare comes again each 33 ms, and comes for
 * words that were replaced since: whether it is time is always decided by the tick itself.
 *
 * The core needs some 50 us to give what comes after an edge. For edges that lie closer than that an edge may be
 * reported to it (by board_edge) wiring_ahead ticks before: what it then prepares waits in line, and what was reported
 * can no longer be replaced. Where wiring_waits, the main loop stands still until that edge is played: it never sees
 * outputs that are not yet. */

#include "outputs.h"

#include <avr/interrupt.h>
#include <avr/io.h>
#include <stdbool.h>
#include <util/atomic.h>

#include "../core/board.h"
#include "../core/port.h"
#include "clock.h"
#include "wiring.h"

#define LEAD 32    /* ticks: the interrupt's entry, behind another one */
#define SURE 12    /* ticks: more than these ahead, a compare is met for certain */
#define MARGIN 60  /* ticks: less than these ahead, waiting is better than to leave and come again */
#define NEAR (LEAD + MARGIN)
#define LAST 24    /* ticks before an edge that belong to it alone: the two longest other interrupts end in them */
#define LOCKED 200 /* ticks: the longest locked section of the core, with the line busy both ways */
#define WORDS 4u   /* in line */

#define OFF _BV(PB0)               /* /OE */
#define LATCH _BV(PB1)             /* of the registers and of the converter; idles high */
#define CONVERTER _BV(PB2)         /* its select */
#define SHIFT (_BV(PB3) | _BV(PB5))
#define SELECT (_BV(PD5) | _BV(PD6) | _BV(PD7))
#define DRIVEN (_BV(PD2) | _BV(PD3) | _BV(PD4))

struct edge {
    uint32_t due;
    uint32_t chain; /* what is shifted out, highest byte first */
    uint8_t port_d; /* PD2 to PD4 */
};

static struct board *board;
static struct edge line[WORDS]; /* a ring, in the order in which they are played */
static volatile uint8_t first, count;
static volatile bool staged;    /* line[first] is in the chain */
static volatile bool unreported;    /* board_edge was not called yet for the one prepared last: it may still be replaced */
static uint32_t unreported_due;
static volatile bool reporting;   /* board_edge is running */
static uint8_t port_d;          /* at the next take */
static uint32_t in_chain;

/* Reading SPSR and writing SPDR takes the flag back. */
static inline void shift(uint8_t byte)
{
    SPDR = byte;
    while (!(SPSR & _BV(SPIF))) {
    }
}

static struct edge edge_of(uint32_t word, uint32_t due)
{
    return (struct edge){due, wiring_chain(word), wiring_port_d(word)};
}

/* Everything in place for an edge but the moment. One that leaves the chain as it is, as the bridge's do, takes no
 * time. */
static void stage(const struct edge *edge)
{
    const uint8_t *chain = (const uint8_t *)&edge->chain;
    port_d = edge->port_d;
    if (edge->chain == in_chain)
        return;
    in_chain = edge->chain;
    PORTB &= (uint8_t)~CONVERTER;
    shift(chain[3]);
    shift(chain[2]);
    PORTB |= CONVERTER;
    shift(chain[1]);
    shift(chain[0]);
}

static void take(void)
{
    PORTB &= (uint8_t)~LATCH;
    PORTD = (PORTD & SELECT) | port_d;
    PORTB |= LATCH;
}

static int32_t ahead(uint32_t due)
{
    return (int32_t)(due - clock_now());
}

/* The compiler keeps what is shared on its own side of these. */
static void mask(void)
{
    TIMSK1 &= (uint8_t)~_BV(OCIE1A);
    __asm__ volatile("" ::: "memory");
}

static void unmask(void)
{
    __asm__ volatile("" ::: "memory");
    TIMSK1 |= _BV(OCIE1A);
}

/* Whether the word prepared last is to be reported to the core, were it time. */
static inline bool to_report(void)
{
    return unreported && !reporting && count < WORDS;
}

/* The first edge in line was reported to the core. */
static inline bool reported(void)
{
    return count > unreported;
}

/* Puts the compare where play is needed next. False: that is less than `margin` ticks ahead. Interrupts off. */
static bool arm(uint8_t margin)
{
    if (!count && !to_report())
        return true;
    uint32_t at = line[first].due - LEAD;
    if (to_report() && (!count || (int32_t)(unreported_due - wiring_ahead - at) < 0))
        at = unreported_due - wiring_ahead;
    OCR1A = (uint16_t)at;
    return ahead(at) > margin;
}

/* Reports to the core that what it prepared last is, or will be, played. Edges that come meanwhile are played. */
static void report(void)
{
    reporting = true;
    cli();
    if (arm(SURE)) {
        unreported = false;
        unmask();
        sei();
        board_edge(board, unreported_due);
        mask();
    }
    sei();
    reporting = false;
}

/* Waits for the first edge, and plays it. Interrupts off. */
static void play_first(void)
{
    uint16_t due = (uint16_t)line[first].due;
    while ((int16_t)(due - TCNT1) > 0) {
    }
    take();
    staged = false;
    first = (first + 1u) % WORDS;
    count--;
}

/* Does what is due or nearly so. The compare is masked; interrupts are off on return. */
static void play(void)
{
    for (;;) {
        if (count && !staged) {
            stage(&line[first]);
            staged = true;
        }
        if (count && (ahead(line[first].due) < NEAR || (wiring_waits && reported()))) {
            while (ahead(line[first].due) > LAST) {
            }
            cli();
            play_first();
            sei();
        } else if (to_report() && ahead(unreported_due) <= (int32_t)wiring_ahead) {
            report();
        } else {
            cli();
            if (arm(MARGIN))
                return;
            sei();
        }
    }
}

ISR(TIMER1_COMPA_vect)
{
    if (staged && ahead(line[first].due) <= LEAD)
        play_first();
    mask();
    sei();
    play();
    unmask();
}

/* A compare that came while it was masked may be forgotten: play looks for itself. */
void port_unlock(struct board *b, uint8_t key)
{
    (void)b;
    if (!key)
        return; /* an outer section, or board_edge, goes on */
    uint8_t sreg = SREG;
    play();
    unmask();
    SREG = sreg;
}

/* Masks the compare alone, so that bytes still come in. Does not begin while an edge is near: it would be late. */
uint8_t port_lock(struct board *b)
{
    while (!reporting && (TIMSK1 & _BV(OCIE1A))) {
        mask();
        if (!count || ahead(line[first].due) > LOCKED)
            return 1;
        port_unlock(b, 1);
    }
    return 0; /* within board_edge, or locked already */
}

/* Takes the word that may still be replaced out of the line. In a locked section or in board_edge, interrupts off. */
static void withdraw(void)
{
    if (!unreported)
        return;
    unreported = false;
    if (--count == 0)
        staged = false;
}

void port_apply(struct board *b, uint32_t word)
{
    struct edge edge = edge_of(word, 0);
    uint8_t key = port_lock(b);
    count = 0;
    staged = unreported = false;
    stage(&edge);
    ATOMIC_BLOCK(ATOMIC_RESTORESTATE)
    {
        take();
    }
    port_unlock(b, key);
}

void port_prepare(struct board *b, uint32_t word, uint32_t due)
{
    struct edge edge = edge_of(word, due);
    uint8_t key = port_lock(b);
    ATOMIC_BLOCK(ATOMIC_RESTORESTATE)
    {
        withdraw();
        line[(first + count) % WORDS] = edge;
        count++;
        unreported = true;
        unreported_due = due;
    }
    port_unlock(b, key);
}

void port_prepare_nothing(struct board *b)
{
    uint8_t key = port_lock(b);
    ATOMIC_BLOCK(ATOMIC_RESTORESTATE)
    {
        withdraw();
    }
    port_unlock(b, key);
}

void outputs_select(uint8_t select)
{
    ATOMIC_BLOCK(ATOMIC_RESTORESTATE)
    {
        PORTD = (PORTD & (uint8_t)~SELECT) | select;
    }
}

void outputs_start(struct board *b)
{
    board = b;
    PORTB = OFF | LATCH | CONVERTER | _BV(PB4); /* PB4: the lid's contact, pulled up */
    DDRB = OFF | LATCH | CONVERTER | SHIFT;
    DDRD = SELECT | DRIVEN;
    SPCR = _BV(SPE) | _BV(MSTR);
    SPSR = _BV(SPI2X); /* 8 MHz */
    struct edge off = edge_of(0, 0);
    in_chain = ~off.chain; /* unknown */
    stage(&off);
    take();
    PORTB &= (uint8_t)~OFF;
}
