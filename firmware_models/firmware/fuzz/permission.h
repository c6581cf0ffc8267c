/* What commands and answers allow a board: armed or not, which limits hold, which faults stand. Permission that is gone (stop,
 * disarm, a fault, silence, an open lid) never comes back but by a new arm. */
#ifndef PERMISSION_H
#define PERMISSION_H

#include "fuzz.h"

struct permission {
    bool armed;
    uint32_t armed_at;
    uint32_t heard_at; /* the last frame that feeds the dead-man */
    uint16_t faults;   /* reported, and not cleared since */
    uint16_t limits[LIMITS];
};

extern struct permission allowed;

/* A board was switched on with these settings. */
void permission_reset(const struct oracle *of, const struct settings *settings);

/* A byte reaches the board; what it ends takes effect before the board sees it. */
void permission_listen(uint8_t byte);

/* A frame of the board, without its delimiter. */
void permission_answer(const uint8_t *raw, size_t count);

/* After all that happened at a tick: what is energised may be, and every command was answered. */
void permission_check(void);

/* From now on nothing is permitted. */
void permission_end(void);

/* Length of a payload that the board takes; -1: it knows no such type. */
int payload_length(const struct oracle *of, uint8_t type);

#endif
