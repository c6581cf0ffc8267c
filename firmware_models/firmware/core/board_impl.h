/* Behind board.h: what both boards have in common, and what a kind of board adds. Main loop only, but for `edge`. */
#ifndef BOARD_IMPL_H
#define BOARD_IMPL_H

#include "board.h"
#include "constants.h"
#include "framing.h"

#define NO_CHANNEL 255u
#define FOREVER 0x7fffffffu /* ticks: nothing to wait for */

/* A command that only one kind of board knows; protocol.h has the list. */
struct own_command {
    uint8_t type;
    uint8_t size; /* of its payload */
};

struct board_kind {
    uint8_t number;    /* identity.board */
    uint8_t channels;
    uint8_t telemetry; /* its message type */
    uint8_t telemetry_size;
    uint8_t greater_is_stricter; /* bit i: of limits[i] the greater value is the stricter one */
    uint16_t limits[LIMITS];     /* as built, in the order of identity.limits */
    struct own_command own[OWN_COMMANDS];

    /* Power-on: outputs off, queue empty. The common part is set up already, limits included. */
    void (*start)(struct board *b, const struct settings *settings);

    /* Asked to arm while disarmed, nothing latched, boot id right. Ok: has set the state (armed, or self_test). */
    uint8_t (*arm)(struct board *b, uint32_t now, uint16_t *detail);

    /* Nothing energised, queue empty, self test given up. Returns the state to rest in: disarmed, or discharging, which
     * the kind ends itself by board_set_state(b, board_rest(b)). A latched fault shows as the state fault at once. */
    uint8_t (*make_safe)(struct board *b, uint32_t now);

    /* On disarm, after make_safe: this latched fault may be forgotten. */
    bool (*cause_gone)(struct board *b, uint8_t fault);

    /* One of its own commands, length right. Returns a status; `detail` is 0 beforehand. Checks board_ready itself. */
    uint8_t (*command)(struct board *b, uint8_t type, const uint8_t *payload, uint16_t *detail);

    /* See board_edge: interrupt. */
    void (*edge)(struct board *b, uint32_t due);

    /* Guards and what else is due by itself. */
    void (*poll)(struct board *b, uint32_t now);

    /* Ticks from now until poll has something to do, at most FOREVER. */
    uint32_t (*idle_ticks)(struct board *b, uint32_t now);

    /* Its own fields of the telemetry; time, state, faults, late and bad_frames are set. */
    void (*fill_telemetry)(struct board *b, uint8_t *payload);
};

/* What was answered to a numbered command. */
struct remembered {
    uint8_t seq; /* 0: nothing */
    uint8_t status;
    uint16_t detail;
    uint32_t time;
};

struct board {
    const struct board_kind *kind;
    uint32_t boot_id;
    uint32_t dealt;         /* when the command in hand was dealt with: reply.time */
    uint32_t heard;         /* when the last valid frame came; has a meaning only while armed */
    uint32_t telemetry_due; /* has a meaning only once identified */
    uint16_t limits[LIMITS];
    uint16_t faults;        /* latched, a bit each */
    uint16_t late;          /* commands that came too late, wrapping */
    uint8_t state;          /* set by board_set_state only */
    bool armed;             /* from arm until made safe, self test and discharging before armed again included */
    bool identified;        /* a host has asked who this is */
    uint8_t next_reply;     /* where the next one is remembered */
    struct remembered replies[REMEMBERED_REPLIES];
    struct deframer deframer;
};

/* Interlock check of every timed command: armed, driving, or discharging before armed again. If not, *detail is
 * the faults mask. */
bool board_ready(const struct board *b, uint16_t *detail);

/* A command for tick `time`: STATUS_OK, STATUS_LATE (counted, detail set) or STATUS_FAR. Quick enough while locked. */
uint8_t board_check_time(struct board *b, uint32_t time, uint16_t *detail);

/* Makes safe, latches `fault` and reports it to the host, once. State is fault afterwards. Not from board_edge. */
void board_latch(struct board *b, uint8_t fault, uint8_t channel, uint16_t value);

/* Makes safe as for stop: kind's make_safe, no longer armed, state as it then is. */
void board_make_safe(struct board *b);

void board_set_state(struct board *b, uint8_t state);

/* STATE_FAULT while anything is latched, else STATE_DISARMED. */
uint8_t board_rest(const struct board *b);

/* `a` is before `b`, across the wrap if that is nearer. */
static inline bool before(uint32_t a, uint32_t b)
{
    return (int32_t)(a - b) < 0;
}

/* Ticks from `now` until `due`, 0 once it has come. */
static inline uint32_t ticks_until(uint32_t due, uint32_t now)
{
    return before(now, due) ? due - now : 0;
}

#endif
