/* host.h for a controller whose CPU takes its time, as a chip's does: the clock goes on whenever the core asks for it,
 * converts, or sends; edges come in between, wherever they are not locked out; the main loop is late now and then. */

#include <stdlib.h>

#include "../host/host.h"

#include "board_impl.h"
#include "brake.h"
#include "port.h"

enum { ASK = 3, SAMPLE = 6, CONVERSION = 46, BYTE = 4, EDGE = 30, LATE = 400, VERY_LATE = 3000 }; /* ticks */

struct host {
    struct brake brake; /* first */
    struct host_calls calls;
    void *user;
    uint32_t now;
    uint32_t random;
    uint32_t word;
    bool masked;
    bool prepared;
    uint32_t prepared_word;
    uint32_t prepared_due;
};

const char port_build[8] = "slow";

static struct host *host_of(struct board *b)
{
    return (struct host *)b;
}

static void put_out(struct host *h, uint32_t word)
{
    h->prepared = false;
    if (word == h->word)
        return;
    h->word = word;
    h->calls.outputs(h->user, word);
}

static void make_edges(struct host *h)
{
    while (!h->masked && h->prepared && !before(h->now, h->prepared_due)) {
        uint32_t due = h->prepared_due;
        h->masked = true;
        put_out(h, h->prepared_word);
        board_edge(&h->brake.board, due);
        h->now += EDGE;
        h->masked = false;
    }
}

/* An edge that falls into the time that passes is made at its tick, and takes time of its own. */
static void pass(struct host *h, uint32_t ticks)
{
    uint32_t until = h->now + ticks;
    while (!h->masked && h->prepared && !before(until, h->prepared_due)) {
        uint32_t edge_at = before(h->now, h->prepared_due) ? h->prepared_due : h->now;
        until += EDGE;
        h->now = edge_at;
        make_edges(h);
    }
    h->now = until;
}

uint32_t port_now(struct board *b)
{
    pass(host_of(b), ASK);
    return host_of(b)->now;
}

void port_transmit(struct board *b, const uint8_t *bytes, uint8_t count)
{
    struct host *h = host_of(b);
    pass(h, (uint32_t)BYTE * count);
    h->calls.transmit(h->user, bytes, count);
}

uint32_t port_uplink_free(struct board *b)
{
    return host_of(b)->now + host_of(b)->calls.uplink_busy(host_of(b)->user);
}

void port_apply(struct board *b, uint32_t word)
{
    put_out(host_of(b), word);
}

void port_prepare(struct board *b, uint32_t word, uint32_t due)
{
    struct host *h = host_of(b);
    h->prepared = true;
    h->prepared_word = word;
    h->prepared_due = due;
}

void port_prepare_nothing(struct board *b)
{
    host_of(b)->prepared = false;
}

uint8_t port_lock(struct board *b)
{
    uint8_t key = host_of(b)->masked;
    host_of(b)->masked = true;
    return key;
}

void port_unlock(struct board *b, uint8_t key)
{
    host_of(b)->masked = key;
    make_edges(host_of(b));
}

uint16_t port_convert(struct board *b, uint8_t input)
{
    struct host *h = host_of(b);
    pass(h, SAMPLE);
    uint16_t counts = (uint16_t)h->calls.convert(h->user, input);
    pass(h, CONVERSION);
    return counts;
}

bool port_interlock_closed(struct board *b)
{
    return host_of(b)->calls.interlock_closed(host_of(b)->user) != 0;
}

void port_show(struct board *b, uint8_t state, uint16_t faults)
{
    (void)b;
    (void)state;
    (void)faults;
}

void *host_new(uint32_t board, const struct settings *settings, uint32_t boot_id, uint32_t brown_out, uint32_t now,
               struct host_memory *memory, const struct host_calls *calls, void *user)
{
    struct host *h = board == BOARD_BRAKE ? calloc(1, sizeof *h) : NULL;
    if (!h)
        return NULL;
    (void)memory;
    h->calls = *calls;
    h->user = user;
    h->now = now;
    h->random = now;
    brake_init(&h->brake);
    board_start(&h->brake.board, settings, boot_id, brown_out != 0);
    return h;
}

void host_free(void *host)
{
    free(host);
}

/* The main loop sleeps until there is something to do, wakes a little late, and once in a while is held up. */
void host_run(void *host, uint32_t now)
{
    struct host *h = host;
    while (before(h->now, now)) {
        uint32_t idle = board_idle_ticks(&h->brake.board);
        uint32_t left = ticks_until(now, h->now);
        if (idle > left) {
            pass(h, left);
            return;
        }
        h->random = h->random * 1664525u + 1013904223u;
        pass(h, idle + (h->random >> 16) % (h->random >> 28 == 0 ? VERY_LATE : LATE));
        board_poll(&h->brake.board);
    }
}

void host_receive(void *host, const uint8_t *bytes, uint32_t count, uint32_t now)
{
    struct host *h = host;
    host_run(h, now);
    for (uint32_t i = 0; i < count; i++)
        board_receive(&h->brake.board, bytes[i], h->now);
}

uint32_t host_next(void *host, uint32_t now)
{
    (void)host;
    (void)now;
    return TICKS_PER_MS; /* it minds its time itself */
}

uint32_t host_state(void *host)
{
    return ((struct host *)host)->brake.board.state;
}

uint32_t host_faults(void *host)
{
    return ((struct host *)host)->brake.board.faults;
}

/* The tick it is for the core, during a call too. */
uint32_t host_clock(void *host)
{
    return ((struct host *)host)->now;
}
