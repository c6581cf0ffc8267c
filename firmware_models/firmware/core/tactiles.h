/* The coil board: pulses at their ticks, no more coils on than the supply carries, guards on current and supply. */
#ifndef TACTILES_H
#define TACTILES_H

#include "board_impl.h"
#include "coil_heat.h"

/* One coil's pulse that waits, in a list ordered by `start`. */
struct pulse {
    uint32_t start;
    uint8_t duration; /* 50 us */
    uint8_t coil;     /* channel, and what tactiles.c adds to it */
    uint8_t next;
};

/* A coil that is on. */
struct running {
    uint32_t end;
    uint16_t coil; /* its bit */
};

/* What board_edge shares with the main loop. */
struct timeline {
    uint16_t coils; /* the outputs now: lower and upper half of the word */
    uint16_t toward_skin;

    bool prepared; /* the next edge is with the port: */
    uint32_t due;
    uint16_t next_coils;
    uint16_t next_toward_skin;
    uint16_t ending;   /* coils whose pulse ends there */
    uint8_t beginning; /* pulses from the head on that begin there */

    uint8_t on_count;
    struct running on[COILS_AT_ONCE];
    uint8_t max_on; /* coils on at a time since the last look at the senses */

    uint8_t head;    /* first pulse that waits */
    uint8_t waiting; /* how many do */
    struct pulse pulses[PULSE_QUEUE];
    uint16_t played[COIL_CHANNELS]; /* pulses begun, wrapping */
    uint16_t to_play[COIL_CHANNELS]; /* on-time of those that wait, 50 us */
};

struct tactiles {
    struct board board; /* first */
    struct timeline timeline;

    /* Main loop only. */
    uint8_t place;      /* where the last pulse was put */
    uint8_t allowed_on; /* coils that the current limit carries */
    bool excess;        /* since `excess_since`: more current than coils can draw, or than the limit */
    bool unasked;       /* since a look that saw none at all: some that no command explains */
    bool spared;        /* the last look left the supply alone */
    uint8_t doubts;     /* looks in a row at which only a coil that has just gone off explains what flows */
    uint32_t cool_due;  /* next step of the accounts' decay; has a meaning only while `cooling` */
    bool cooling;       /* some account may not be empty */
    uint8_t notes;      /* as kept without power */
    uint32_t look_due;  /* next look at the senses */
    uint32_t looked;    /* the last one */
    uint16_t ahead;     /* 50 us that every account is charged with, until `paid`, for what may flow unasked */
    uint32_t paid;
    uint32_t excess_since;
    uint32_t unasked_ticks; /* how long it flowed, from the first look that saw it on */
};

/* Before board_start. */
void tactiles_init(struct tactiles *t);

#endif
