/* The brake controller: one high-voltage supply and a bridge for up to five brakes, and the fingertip piezos. */
#ifndef BRAKE_H
#define BRAKE_H

#include "board_impl.h"
#include "brake_edges.h"
#include "brake_guards.h"
#include "brake_self_test.h"
#include "brake_senses.h"

struct brake {
    struct board board; /* first */
    struct edges edges;

    /* Main loop only. */
    uint32_t due;       /* next step of the self test, look of the guards, or look at what discharges */
    uint16_t nominal_pf;
    uint16_t supply_ua;                 /* what the supply gives, as the self test found */
    uint16_t measured[BRAKE_CHANNELS];  /* pF, by the self test; 0: no brake */
    uint16_t sensed[BRAKE_CHANNELS];    /* pF, as last measured, while driving too */
    uint16_t leakage[BRAKE_CHANNELS];   /* 0.1 uA, in the last hold phase */
    struct guards guards;
    struct self_test test;
};

/* Before board_start. */
void brake_init(struct brake *k);

#endif
