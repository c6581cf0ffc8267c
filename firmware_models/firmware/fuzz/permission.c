#include "permission.h"

#include <string.h>

enum { ARM = 0x04, DISARM = 0x05, STOP = 0x06, IDENTIFY = 0x01, SYNC = 0x02, CONFIGURE = 0x03, KEEPALIVE = 0x07 };
enum { REPLY = 0x90, FAULT = 0xA2, KEPT_REPLIES = 16 };

struct permission allowed;

static const struct oracle *oracle;
static uint8_t partial[LONGEST_FRAME];
static size_t partial_length;
static uint8_t kept[KEPT_REPLIES]; /* numbers whose frames are repetitions; 0: none */
static unsigned next_kept;

/* The command in hand, which owes a reply; an unreadable one has the type 0. */
static struct {
    bool open;
    uint8_t type, number;
    uint8_t payload[LONGEST_FRAME];
} asked;

int payload_length(const struct oracle *of, uint8_t type) {
    switch (type) {
    case IDENTIFY: case DISARM: case STOP: case KEEPALIVE: return 0;
    case SYNC: case ARM: return 4;
    case CONFIGURE: return 2 * LIMITS;
    case 0x10: return of->board == 1 ? 23 : -1;
    case 0x11: return of->board == 1 ? 2 : -1;
    case 0x20: return of->board == 2 ? 11 : -1;
    case 0x21: return of->board == 2 ? 7 : -1;
    default: return -1;
    }
}

static bool looser(unsigned i, uint16_t limit) {
    return oracle->greater_is_stricter >> i & 1 ? limit < allowed.limits[i] : limit > allowed.limits[i];
}

void permission_reset(const struct oracle *of, const struct settings *settings) {
    oracle = of;
    allowed = (struct permission){.heard_at = now};
    memcpy(allowed.limits, of->built, sizeof allowed.limits);
    for (unsigned i = 0; i < LIMITS; i++)
        if (!looser(i, settings->limits[i])) allowed.limits[i] = settings->limits[i];
    memset(kept, 0, sizeof kept);
    partial_length = next_kept = 0;
    asked.open = false;
}

void permission_end(void) {
    allowed.armed = false;
    oracle->revoked();
}

static void end_by_silence(void) {
    if (allowed.armed && now - allowed.heard_at >= DEAD_MAN_TICKS) permission_end();
}

static bool is_kept(uint8_t number) { return number && memchr(kept, number, sizeof kept) != NULL; }

static void keep(uint8_t number) {
    if (number == 0 || is_kept(number)) return;
    kept[next_kept++ % KEPT_REPLIES] = number;
}

/* A whole frame. */
static void hear(const uint8_t *body, size_t length) {
    const uint8_t type = body[0], number = body[1];
    const bool readable = (int)length - 4 == payload_length(oracle, type);
    end_by_silence();
    if (readable) allowed.heard_at = now;
    if (readable && type == IDENTIFY) {
        memset(kept, 0, sizeof kept);
        return;
    }
    const bool stops = readable && type == STOP;
    if (is_kept(number) && !stops) {
        asked.open = true; /* a repetition is answered and changes nothing */
        asked.type = 0;
        asked.number = number;
        return;
    }
    if (readable && (type == SYNC || type == KEEPALIVE)) return;
    keep(number);
    asked.open = true;
    asked.type = readable ? type : 0;
    asked.number = number;
    memcpy(asked.payload, body + 2, length - 4);
    if (stops || (readable && type == DISARM)) permission_end();
}

void permission_listen(uint8_t byte) {
    uint8_t body[LONGEST_FRAME];
    if (byte != 0) {
        if (partial_length < LONGEST_FRAME) partial[partial_length] = byte;
        partial_length++;
        return;
    }
    const size_t length = partial_length < LONGEST_FRAME ? unstuff(partial, partial_length, body) : 0;
    partial_length = 0;
    if (length) hear(body, length);
}

static void taken(uint16_t detail) {
    switch (asked.type) {
    case CONFIGURE:
        REQUIRE(!allowed.armed);
        for (unsigned i = 0; i < LIMITS; i++) {
            REQUIRE(!looser(i, u16_at(asked.payload + 2 * i)));
            allowed.limits[i] = u16_at(asked.payload + 2 * i);
        }
        break;
    case ARM:
        REQUIRE(u32_at(asked.payload) == BOOT_ID);
        if (allowed.armed) break;
        REQUIRE(allowed.faults == 0 && !lid_open && oracle->fit());
        allowed.armed = true;
        allowed.armed_at = now;
        break;
    case DISARM:
        REQUIRE((detail & ~allowed.faults) == 0);
        allowed.faults = detail;
        break;
    case STOP:
        REQUIRE(detail == allowed.faults);
        break;
    case 0x11:
        oracle->granted(asked.type, asked.payload);
        break;
    case 0x10: case 0x20: case 0x21:
        REQUIRE(allowed.armed);
        oracle->granted(asked.type, asked.payload);
        break;
    default:
        break; /* a repetition may have been ok the first time */
    }
}

void permission_answer(const uint8_t *raw, size_t count) {
    uint8_t body[LONGEST_FRAME];
    REQUIRE(unstuff(raw, count, body) != 0);
    if (body[0] == FAULT) {
        allowed.faults |= (uint16_t)(1u << body[6]);
        permission_end();
    } else if (body[0] == REPLY) {
        REQUIRE(asked.open && asked.number == body[1]);
        asked.open = false;
        if (body[2] == 0) taken(u16_at(body + 7));
    }
}

void permission_check(void) {
    end_by_silence();
    REQUIRE(!asked.open);
    if (oracle->energised(word)) REQUIRE(allowed.armed);
    oracle->check(word);
}
