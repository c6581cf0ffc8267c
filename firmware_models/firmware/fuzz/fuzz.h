/* A board under a stream of bytes and time that a fuzzer makes up, watched by an oracle with a deframer of its own.
 *
 * The stream is a program: raw bytes, frames that are valid, frames with one byte changed, time that passes, hardware that breaks.
 * The oracle sees the same bytes as the board and the board's answers. From these it knows at each moment whether the board
 * may be armed (permission.h), and which outputs may be energised, how far and until when (fuzz_tactiles.c, fuzz_brake.c);
 * whatever else the outputs do aborts the run. */
#ifndef FUZZ_H
#define FUZZ_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "../core/protocol.h"
#include "../host/host.h"
#include "wire.h"

#define BOOT_ID 0xB007B007u
#define DEAD_MAN_TICKS 200000u
#define MS_TICKS 2000u

struct input {
    const uint8_t *bytes;
    size_t left;
};

/* The next byte of the program; 0 when it is over. */
uint8_t take(struct input *in);
uint32_t take_u32(struct input *in);

/* What a board's oracle provides. */
struct oracle {
    uint32_t board;
    uint16_t built[LIMITS];      /* limits as built */
    uint8_t greater_is_stricter; /* bit i: of limit i */
    bool has_lid;
    const uint8_t *types;        /* commands worth sending, and how many */
    size_t type_count;

    /* A new board with sound hardware; may make its settings stricter than built, by the program. */
    void (*reset)(struct input *in, struct settings *settings);
    /* Makes of the program's bytes a command that the board may well take. */
    void (*shape)(uint8_t type, uint8_t *payload, struct input *in);
    /* Hardware breaks, or is mended again. */
    void (*disturb)(struct input *in);
    void (*mend)(void);
    /* The board may be armed, as far as its hardware goes. */
    bool (*fit)(void);

    /* A command of the board's own was answered ok. */
    void (*granted)(uint8_t type, const uint8_t *payload);
    /* Nothing that was granted counts any more. */
    void (*revoked)(void);

    /* The output word changes to this. */
    void (*outputs)(uint32_t word);
    /* The word stands, and what it energises may. Called after all that happened at a tick. */
    void (*check)(uint32_t word);
    uint32_t (*convert)(uint32_t input);
    /* Everything that carries current, volts or a vibration in this word. */
    bool (*energised)(uint32_t word);
};

/* The board's clock, and its outputs. */
extern uint32_t now, word;
extern bool lid_open;

/* Plays one program; aborts where the board does what nobody commanded, or does not recover. */
void play(const struct oracle *oracle, const uint8_t *bytes, size_t size);

/* Stops the run, stating why. */
void fail(const char *why);
#define REQUIRE(condition) ((condition) ? (void)0 : fail(#condition))

/* `a` is before `b`, across the wrap if that is nearer. */
static inline bool earlier(uint32_t a, uint32_t b) { return (int32_t)(a - b) < 0; }

#endif
