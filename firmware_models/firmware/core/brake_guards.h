/* Guards of a wave that runs: volts, current and slopes against what they may be.
 *
 * Looks fall at chosen instants of a half period: a quarter of the expected ramp after it began, its middle, shortly
 * before the clamp, and each millisecond in between. Of half periods shorter than 1 ms one is looked at in about
 * 1.5 ms, in turn a positive and a negative one. A look that an edge fell into counts for nothing.
 *
 * What each sense can find:
 * - highest, 2 V a count: over_voltage, where a reading less its half count of rounding is above the limit. At 20 V the
 *   guard trips between 21 and 23 V, at 1500 V between 1575 and 1577 V.
 * - bridge, 4 V a count: its sign, where at least 20 V have the wrong sign, for near the frequency limit a
 *   healthy load may still have 11 V to turn round in the middle of a half period. Below 22 V of amplitude bridge_stuck
 *   is blind.
 * - bridge again: the slope, where both its ends' rounding together (4 V) cannot make a healthy slope a bad one. At low
 *   amplitudes this leaves little: a short is still found, for its current stays full all the half period; a
 *   capacitance that is merely wrong is not, nor is an open output where a quarter of the ramp (at 30 V 40 us) is over
 *   before the CPU looks. An ATmega, which prepares each edge ahead, has no time for the look that finds it above some
 *   650 Hz.
 * - current, 1 uA a count: leak, in the hold phase. At frequencies so high that there is none, leak is blind.
 * All that hangs on the bridge is sensed together: with several outputs on, only their sum is known, and no channel
 * named. */
#ifndef BRAKE_GUARDS_H
#define BRAKE_GUARDS_H

#include <stdbool.h>
#include <stdint.h>

struct guards {
    uint32_t half_begun;   /* of the half period last looked at */
    uint32_t excess_since;
    uint32_t ramp_begun;   /* first look at this ramp */
    int16_t ramp_v;        /* and the volts then */
    int16_t held_v;        /* volts at the last look, in the hold phase */
    uint16_t reached;      /* V at the end of the last half period */
    uint8_t changes;       /* the wave's, at the last look */
    bool negative;         /* half period last looked at */
    bool excess;           /* too much current since excess_since */
    bool open;             /* a half period looked open: */
    bool open_negative;    /* of which polarity */
    bool ramp;             /* full current in all looks since ramp_begun */
    bool held;             /* held_v counts */
};

struct brake;

/* A wave begins. */
void guards_start(struct brake *k);

/* At k->due while the wave runs. Sets the next. */
void guards_poll(struct brake *k);

#endif
