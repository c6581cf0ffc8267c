/* A board under a stream of bytes and time that a fuzzer makes up, watched by an oracle with a deframer of its own.
 *
 * The stream is a program: raw bytes, frames that are valid, frames with one byte changed, time that passes. The oracle
 * sees the same bytes as the board and knows what valid frames commanded; whatever else the outputs do aborts the run. */
#ifndef FUZZ_H
#define FUZZ_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "../core/protocol.h"
#include "../host/host.h"

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
    struct settings settings;
    const uint8_t *types; /* commands worth sending, and how many */
    size_t type_count;
    void (*reset)(void);
    /* A frame that is whole, of a known type and the right length came in. */
    void (*heard)(uint8_t type, const uint8_t *payload, uint32_t now);
    /* The output word changed. */
    void (*outputs)(uint32_t word, uint32_t now);
    uint32_t (*convert)(uint32_t input, uint32_t now);
    /* Everything that carries current, volts or a vibration in this word. */
    bool (*energised)(uint32_t word);
};

/* Plays one program; aborts where the board does what nobody commanded, or does not recover. */
void play(const struct oracle *oracle, const uint8_t *bytes, size_t size);

/* Stops the run, saying why. */
void fail(const char *why);
#define REQUIRE(condition) ((condition) ? (void)0 : fail(#condition))

uint16_t u16_at(const uint8_t *p);
uint32_t u32_at(const uint8_t *p);

#endif
