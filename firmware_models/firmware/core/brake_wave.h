/* The bipolar square wave: what the outputs are from one edge to the next. It has no clock and moves nothing itself. */
#ifndef BRAKE_WAVE_H
#define BRAKE_WAVE_H

#include <stdbool.h>
#include <stdint.h>

enum phase {
    WAVE_OFF,      /* all outputs shorted */
    WAVE_WAITING,  /* the same, until the wave begins */
    WAVE_CHARGING, /* the supply is on the outputs */
    WAVE_CLAMPED,  /* the bridge shorts them, before they charge with the other sign */
    TEST_HELD,     /* self test: one output on the bridge, the supply gives nothing */
    TEST_WAITING,  /* the same, until a pulse begins */
    TEST_CHARGING, /* the pulse */
};

/* A drive command, with what its frequency comes to in ticks: the interrupt must not divide. */
struct drive {
    uint32_t start;
    uint32_t half;      /* ticks of a half period, rounded down */
    uint16_t clamp;     /* ticks */
    uint16_t frequency; /* 0.1 Hz */
    uint16_t amplitude; /* V; 0: discharge */
    uint16_t ttl;       /* ms */
    uint8_t mask;       /* outputs; 0: discharge */
};

struct wave {
    uint32_t next;     /* its next edge, but for its end */
    uint32_t end;      /* of the drive, or of a test's pulse */
    uint32_t since;    /* when this half period's clamp was over; while off, when all were shorted */
    uint32_t charging; /* since when it charges to its amplitude: `since`, or later if that was raised */
    uint32_t half;
    uint16_t clamp;
    uint16_t frequency;
    uint16_t remainder; /* half a period is half + remainder / frequency ticks */
    uint16_t carry;     /* what of it is owed, in ticks / frequency */
    uint16_t amplitude;
    uint16_t ceiling;   /* volts that may still be there: the amplitude, or until a reversal a higher one before it */
    uint8_t mask;
    uint8_t phase;
    uint8_t changes;    /* counts all that happened to it, wrapping */
    bool longer;        /* by one tick: this half period and the one that pays it back */
    bool negative;      /* polarity of the bridge */
    bool first;         /* not yet turned round */
    bool resting;       /* off, and all outputs known to be empty: a drive may begin at its tick */
};

/* Works out `half` and `clamp` of `frequency`, which is not 0. */
void drive_shape(struct drive *d);

/* The drive's tick has come. */
void wave_take(struct wave *w, const struct drive *d);

/* What it does by itself at tick `due`, if anything. */
void wave_advance(struct wave *w, uint32_t due);

/* Shorts all outputs, at tick `now`. */
void wave_stop(struct wave *w, uint32_t now);

/* All outputs are known to be empty. */
void wave_rest(struct wave *w);

/* When something next happens by itself; false: never. */
bool wave_next(const struct wave *w, uint32_t *due);

/* Its part of the output word as it is. */
uint32_t wave_word(const struct wave *w);

/* The same from tick `due` on, if nothing but the wave itself changes it there. */
uint32_t wave_word_from(const struct wave *w, uint32_t due);

#endif
