#include "fuzz.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { LONGEST_FRAME = 70 };

static const struct oracle *oracle;
static void *host;
static uint32_t now, word, heard_at, busy_until;
static bool configured; /* a stricter least supply may rightly keep a board from arming */
static uint8_t partial[LONGEST_FRAME];
static size_t partial_length;
static uint8_t answer[LONGEST_FRAME]; /* the last frame from the board, without its delimiter */
static size_t answer_length, answer_growing;

void fail(const char *why) {
    fprintf(stderr, "the board broke a promise: %s (tick %u, outputs %08x)\n", why, (unsigned)now, (unsigned)word);
    abort();
}

uint8_t take(struct input *in) {
    if (in->left == 0) return 0;
    in->left--;
    return *in->bytes++;
}

uint32_t take_u32(struct input *in) {
    uint32_t value = 0;
    for (int i = 0; i < 4; i++) value = value << 8 | take(in);
    return value;
}

uint16_t u16_at(const uint8_t *p) { return (uint16_t)(p[0] | p[1] << 8); }

uint32_t u32_at(const uint8_t *p) { return (uint32_t)u16_at(p) | (uint32_t)u16_at(p + 2) << 16; }

/* Bit by bit, unlike the board's. */
static uint16_t crc(const uint8_t *bytes, size_t count) {
    unsigned sum = 0xFFFF;
    while (count--) {
        sum ^= *bytes++;
        for (int bit = 0; bit < 8; bit++) sum = sum & 1 ? sum >> 1 ^ 0x8408 : sum >> 1;
    }
    return (uint16_t)(sum ^ 0xFFFF);
}

/* COBS, delimiter included; returns the length. */
static size_t stuff(const uint8_t *body, size_t count, uint8_t *out) {
    size_t code = 0, at = 1;
    for (size_t i = 0; i < count; i++) {
        if (body[i] == 0) {
            out[code] = (uint8_t)(at - code);
            code = at++;
        } else {
            out[at++] = body[i];
        }
    }
    out[code] = (uint8_t)(at - code);
    out[at++] = 0;
    return at;
}

/* Type, number, payload and checksum of a frame without its delimiter; 0 where it is none. */
static size_t unstuff(const uint8_t *raw, size_t count, uint8_t *out) {
    size_t length = 0, at = 0;
    while (at < count) {
        const size_t code = raw[at++];
        if (code == 0 || at + code - 1 > count) return 0;
        for (size_t i = 1; i < code; i++) out[length++] = raw[at++];
        if (at < count) out[length++] = 0;
    }
    if (length < 4 || crc(out, length - 2) != u16_at(out + length - 2)) return 0;
    return length;
}

static int payload_length(uint8_t type) {
    switch (type) {
    case 0x01: case 0x05: case 0x06: case 0x07: return 0;
    case 0x02: case 0x04: return 4;
    case 0x03: return 8;
    case 0x10: return oracle->board == 1 ? 23 : -1;
    case 0x11: return oracle->board == 1 ? 2 : -1;
    case 0x20: return oracle->board == 2 ? 11 : -1;
    case 0x21: return oracle->board == 2 ? 7 : -1;
    default: return -1;
    }
}

/* The oracle's ears, byte by byte as the board's. */
static void listen(uint8_t byte) {
    uint8_t frame[LONGEST_FRAME];
    if (byte != 0) {
        if (partial_length < LONGEST_FRAME) partial[partial_length] = byte;
        partial_length++;
        return;
    }
    const size_t length = partial_length < LONGEST_FRAME ? unstuff(partial, partial_length, frame) : 0;
    partial_length = 0;
    if (length && (int)length - 4 == payload_length(frame[0])) {
        heard_at = now;
        configured |= frame[0] == 0x03;
        oracle->heard(frame[0], frame + 2, now);
    }
}

static void on_transmit(void *user, const uint8_t *bytes, uint32_t count) {
    (void)user;
    busy_until = ((int32_t)(busy_until - now) > 0 ? busy_until : now) + 40 * count;
    for (uint32_t i = 0; i < count; i++) {
        if (bytes[i] != 0) {
            REQUIRE(answer_growing < LONGEST_FRAME);
            answer[answer_growing++] = bytes[i];
        } else {
            answer_length = answer_growing;
            answer_growing = 0;
        }
    }
}

static uint32_t on_busy(void *user) {
    (void)user;
    return (int32_t)(busy_until - now) > 0 ? busy_until - now : 0;
}

static void on_outputs(void *user, uint32_t changed) {
    (void)user;
    oracle->outputs(changed, now);
    word = changed;
}

static uint32_t on_convert(void *user, uint32_t input) {
    (void)user;
    return oracle->convert(input, now);
}

static uint32_t on_interlock(void *user) {
    (void)user;
    return 1;
}

static void pass(uint32_t ticks) {
    const uint32_t end = now + ticks;
    for (int stuck = 0; now != end; stuck++) {
        REQUIRE(stuck < 1000000);
        const uint32_t next = host_next(host, now), left = end - now;
        now += next < left ? next : left;
        host_run(host, now);
        if (oracle->energised(word)) REQUIRE(now - heard_at <= DEAD_MAN_TICKS);
    }
}

static void say(const uint8_t *bytes, size_t count) {
    for (size_t i = 0; i < count; i++) {
        pass(40); /* a byte at 500 kbaud */
        listen(bytes[i]);
        host_receive(host, bytes + i, 1, now);
    }
}

static size_t frame(uint8_t type, uint8_t number, const uint8_t *payload, size_t count, uint8_t *out) {
    uint8_t body[LONGEST_FRAME];
    body[0] = type;
    body[1] = number;
    for (size_t i = 0; i < count; i++) body[2 + i] = payload[i];
    const uint16_t sum = crc(body, count + 2);
    body[count + 2] = (uint8_t)sum;
    body[count + 3] = (uint8_t)(sum >> 8);
    return stuff(body, count + 4, out);
}

/* A frame with a payload of the program's, its time near and its boot id right more often than chance would have it. */
static size_t invent(struct input *in, uint8_t *out) {
    uint8_t payload[LONGEST_FRAME];
    const uint8_t type = oracle->types[take(in) % oracle->type_count], number = take(in);
    const int length = payload_length(type);
    for (int i = 0; i < length; i++) payload[i] = take(in);
    if (type >= 0x10 && type != 0x11) {
        const uint32_t due = now + (uint32_t)((int32_t)(int16_t)u16_at(payload) * 4) + 4000;
        for (int i = 0; i < 4; i++) payload[i] = (uint8_t)(due >> 8 * i);
    }
    if (type == 0x04 && payload[0] < 240)
        for (int i = 0; i < 4; i++) payload[i] = (uint8_t)(BOOT_ID >> 8 * i);
    return frame(type, number, payload, (size_t)length, out);
}

/* Sends a command with number 0, which no board keeps, and returns the status of its reply. */
static uint8_t ask(uint8_t type, const uint8_t *payload, size_t count) {
    uint8_t wire[LONGEST_FRAME], body[LONGEST_FRAME];
    answer_length = 0;
    say(wire, frame(type, 0, payload, count, wire));
    REQUIRE(unstuff(answer, answer_length, body) != 0);
    if (type == 0x01) {
        REQUIRE(body[0] == 0x81);
        return 0;
    }
    REQUIRE(body[0] == 0x90);
    return body[2];
}

void play(const struct oracle *of, const uint8_t *bytes, size_t size) {
    struct host_memory memory = {.notes = 0};
    static const struct host_calls calls = {on_transmit, on_busy, on_outputs, on_convert, on_interlock};
    struct input in = {bytes, size};
    uint8_t wire[LONGEST_FRAME + 64];
    oracle = of;
    now = heard_at = busy_until = take_u32(&in);
    word = 0;
    configured = false;
    partial_length = answer_length = answer_growing = 0;
    oracle->reset();
    host = host_new(oracle->board, &oracle->settings, BOOT_ID, 0, now, &memory, &calls, NULL);
    REQUIRE(host != NULL);
    while (in.left) {
        const uint8_t op = take(&in), low = op & 63;
        if (op < 0x40) {
            for (uint8_t i = 0; i < low; i++) wire[i] = take(&in);
            say(wire, low);
        } else if (op < 0xC0) {
            say(wire, invent(&in, wire));
            if (op >= 0x80) pass((uint32_t)low * low * 100);
        } else {
            const size_t length = invent(&in, wire);
            wire[take(&in) % length] = take(&in);
            say(wire, length);
        }
    }
    /* Whatever came before: silence makes it safe, and a new host finds a board that works. */
    const uint8_t delimiter = 0, boot_id[4] = {BOOT_ID & 0xFF, BOOT_ID >> 8 & 0xFF, BOOT_ID >> 16 & 0xFF, BOOT_ID >> 24};
    say(&delimiter, 1);
    pass(2 * DEAD_MAN_TICKS);
    REQUIRE(!oracle->energised(word));
    ask(0x01, NULL, 0);
    REQUIRE(ask(0x05, NULL, 0) == 0);
    pass(20 * MS_TICKS);
    REQUIRE(ask(0x04, boot_id, 4) == 0 || configured);
    ask(0x06, NULL, 0);
    REQUIRE(!oracle->energised(word));
    host_free(host);
}
