/* The brake controller's outputs in time: drives and bursts that wait, and the edges they and the wave make, each at
 * its tick. What is here is shared with board_edge, and touched in locked sections only. */
#ifndef BRAKE_EDGES_H
#define BRAKE_EDGES_H

#include "board_impl.h"
#include "brake_wave.h"

struct burst {
    uint32_t edge;     /* its start while it waits, then its end */
    uint16_t duration; /* ms */
    uint8_t channels;  /* 0: this place is free */
    bool on;
};

struct edges {
    struct wave wave;
    struct drive drives[DRIVE_QUEUE];
    uint8_t order[DRIVE_QUEUE]; /* places of those that wait, by their start */
    uint8_t waiting;
    uint8_t taken;              /* a bit for each place in use */
    struct burst bursts[BURST_QUEUE];
    uint8_t piezos;       /* on now */
    bool any_burst;       /* waits or runs: */
    uint32_t burst_edge;  /* the next edge of any, */
    uint8_t next_piezos;  /* and which are on from there */
    bool prepared;        /* the next edge of all is with the port: */
    uint32_t due;
};

struct brake;

/* Everything off, nothing waits, from tick `now`. */
void edges_clear(struct brake *k, uint32_t now);

/* Puts the command in the queue. A status; `detail` as board_check_time sets it. */
uint8_t edges_add_drive(struct brake *k, const struct drive *d, uint16_t *detail);
uint8_t edges_add_burst(struct brake *k, uint32_t start, uint8_t channels, uint16_t duration, uint16_t *detail);

/* The wave as it is now. */
void edges_look(struct brake *k, struct wave *w);

/* All outputs are empty; false, and nothing, if a wave has come meanwhile. */
bool edges_rest(struct brake *k);

/* Commands that wait for their tick. */
uint8_t edges_queued(struct brake *k);

/* Self test: one output on the bridge, with the supply at rest; a pulse of the supply; all shorted again. */
void edges_test_connect(struct brake *k, uint8_t mask);
void edges_test_pulse(struct brake *k, uint32_t start, uint32_t ticks);
void edges_test_short(struct brake *k, uint32_t now);

/* board_edge. */
void edges_made(struct board *b, uint32_t due);

#endif
