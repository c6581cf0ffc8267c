#include "fuzz.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "permission.h"

enum { BYTE_TICKS = 40 };       /* at 500 kbaud */
#define LID_TICKS (30 * MS_TICKS) /* the core looks at its lid with its guards: at the slowest ramp each 24 ms */

static const uint8_t delimiter = 0;
static const struct oracle *oracle;
static void *host;
static uint32_t busy_until;
static uint8_t answer[LONGEST_FRAME]; /* the last frame from the board, without its delimiter */
static size_t answer_length, answer_growing;

uint32_t now, word;
bool lid_open;

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

static void on_transmit(void *user, const uint8_t *bytes, uint32_t count) {
    (void)user;
    busy_until = (earlier(now, busy_until) ? busy_until : now) + BYTE_TICKS * count;
    for (uint32_t i = 0; i < count; i++) {
        if (bytes[i] != 0) {
            REQUIRE(answer_growing < LONGEST_FRAME);
            answer[answer_growing++] = bytes[i];
        } else {
            answer_length = answer_growing;
            answer_growing = 0;
            permission_answer(answer, answer_length);
        }
    }
}

static uint32_t on_busy(void *user) {
    (void)user;
    return earlier(now, busy_until) ? busy_until - now : 0;
}

static void on_outputs(void *user, uint32_t changed) {
    (void)user;
    oracle->outputs(changed);
    word = changed;
}

static uint32_t on_convert(void *user, uint32_t input) {
    (void)user;
    return oracle->convert(input);
}

static uint32_t on_interlock(void *user) {
    (void)user;
    return !lid_open;
}

static void pass(uint32_t ticks) {
    const uint32_t end = now + ticks;
    for (int stuck = 0; now != end; stuck++) {
        REQUIRE(stuck < 1000000);
        const uint32_t next = host_next(host, now), left = end - now;
        now += next < left ? next : left;
        host_run(host, now);
        permission_check();
    }
}

static void send(const uint8_t *bytes, size_t count) {
    for (size_t i = 0; i < count; i++) {
        pass(BYTE_TICKS);
        permission_listen(bytes[i]);
        host_receive(host, bytes + i, 1, now);
        permission_check();
    }
}

/* A frame with a payload of the program's, its time near and its boot id right more often than chance would have it. */
static size_t invent(struct input *in, uint8_t *out) {
    uint8_t payload[LONGEST_FRAME];
    const uint8_t type = oracle->types[take(in) % oracle->type_count], number = take(in);
    const int length = payload_length(oracle, type);
    for (int i = 0; i < length; i++) payload[i] = take(in);
    if (type >= 0x10 && type != 0x11) {
        const int32_t ahead = (int16_t)u16_at(payload);
        const uint32_t due = now + 2000 + 4 * (uint32_t)(payload[2] & 7 ? abs(ahead) : ahead);
        oracle->shape(type, payload, in);
        for (int i = 0; i < 4; i++) payload[i] = (uint8_t)(due >> 8 * i);
    }
    if (type == 0x03 && payload[0] < 240)
        for (unsigned i = 0; i < LIMITS; i++) {
            const bool upward = (payload[2 * i + 1] & 15) == 0; /* else it stays, or goes down */
            const uint32_t share = upward ? 256u + payload[2 * i] / 8 : payload[2 * i + 1] & 1 ? 256u : 256u - payload[2 * i] / 8;
            const uint32_t limit = allowed.limits[i] * share / 256;
            payload[2 * i] = (uint8_t)limit;
            payload[2 * i + 1] = (uint8_t)(limit >> 8);
        }
    if (type == 0x04 && payload[0] < 240)
        for (int i = 0; i < 4; i++) payload[i] = (uint8_t)(BOOT_ID >> 8 * i);
    return frame(type, number, payload, (size_t)length, out);
}

/* Sends a command with number 0, which no board keeps, and returns the status of its reply. */
static uint8_t ask(uint8_t type, const uint8_t *payload, size_t count) {
    uint8_t wire[LONGEST_FRAME], body[LONGEST_FRAME];
    answer_length = 0;
    send(wire, frame(type, 0, payload, count, wire));
    REQUIRE(unstuff(answer, answer_length, body) != 0);
    if (type == 0x01) {
        REQUIRE(body[0] == 0x81);
        return 0;
    }
    REQUIRE(body[0] == 0x90);
    return body[2];
}

static void keep_alive(uint32_t ticks) {
    uint8_t wire[LONGEST_FRAME];
    send(wire, frame(0x07, 0, NULL, 0, wire));
    pass(ticks);
}

static uint8_t arm(void) {
    const uint8_t boot_id[4] = {BOOT_ID & 0xFF, BOOT_ID >> 8 & 0xFF, BOOT_ID >> 16 & 0xFF, BOOT_ID >> 24};
    return ask(0x04, boot_id, 4);
}

/* It opens for long enough to be noticed, and is closed by another call. */
static void move_lid(void) {
    if (!oracle->has_lid) return;
    lid_open = !lid_open;
    if (!lid_open) return;
    pass(LID_TICKS);
    permission_end();
    permission_check();
}

/* As a person does who has looked. */
static void arm_again(void) {
    send(&delimiter, 1); /* ends what was begun */
    ask(0x05, NULL, 0);
    pass(10 * MS_TICKS);
    arm();
    keep_alive(25 * MS_TICKS);
}

static void step(uint8_t op, struct input *in) {
    uint8_t wire[LONGEST_FRAME + 64];
    const uint8_t low = op & 31;
    if (op < 0x20) {
        for (uint8_t i = 0; i < low; i++) wire[i] = take(in);
        send(wire, low);
    } else if (op < 0x24) {
        move_lid();
    } else if (op < 0x28) {
        arm_again();
    } else if (op < 0x30) {
        oracle->disturb(in);
    } else if (op < 0x40) {
        for (int i = 0; i <= (op & 7); i++) keep_alive(20 * MS_TICKS);
    } else if (op < 0xE0) {
        send(wire, invent(in, wire));
        if (op >= 0x80) pass((uint32_t)low * low * 200);
    } else {
        const size_t length = invent(in, wire);
        wire[take(in) % length] = take(in);
        send(wire, length);
    }
}

void play(const struct oracle *of, const uint8_t *bytes, size_t size) {
    static const struct host_calls calls = {on_transmit, on_busy, on_outputs, on_convert, on_interlock};
    struct input in = {bytes, size};
    struct settings settings = {.nominal_pf = 0};
    struct host_memory memory = {.notes = 0};
    oracle = of;
    now = busy_until = take_u32(&in);
    word = 0;
    lid_open = false;
    answer_length = answer_growing = 0;
    memcpy(settings.limits, of->built, sizeof settings.limits);
    oracle->reset(&in, &settings);
    permission_reset(of, &settings);
    host = host_new(oracle->board, &settings, BOOT_ID, 0, now, &memory, &calls, NULL);
    REQUIRE(host != NULL);
    if (take(&in) & 3) { /* most programs are about a board that is armed already */
        ask(0x01, NULL, 0);
        arm();
        keep_alive(25 * MS_TICKS);
    }
    while (in.left) {
        const uint8_t op = take(&in);
        step(op, &in);
    }
    /* Whatever came before: silence makes it safe, and a new host finds a board that works. */
    send(&delimiter, 1);
    pass(2 * DEAD_MAN_TICKS);
    REQUIRE(!oracle->energised(word));
    lid_open = false;
    oracle->mend();
    ask(0x01, NULL, 0);
    pass(20 * MS_TICKS);
    REQUIRE(ask(0x05, NULL, 0) == 0);
    pass(20 * MS_TICKS);
    const uint8_t armed = arm();
    REQUIRE(armed == 0 || armed == STATUS_HOT || !oracle->fit());
    ask(0x06, NULL, 0);
    REQUIRE(!oracle->energised(word));
    host_free(host);
}
