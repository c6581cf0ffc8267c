#include "host.h"

#include <stdlib.h>

#include "../core/board_impl.h"
#include "../core/brake.h"
#include "../core/port.h"
#include "../core/tactiles.h"

struct host {
    union {
        struct board board;
        struct tactiles tactiles;
        struct brake brake;
    } device; /* first: the core hands us its board, and this is where it lies */
    struct host_memory *memory;
    struct host_calls calls;
    void *user;
    uint32_t now;
    uint32_t word;
    bool prepared;
    uint32_t prepared_word;
    uint32_t prepared_due;
};

const char port_build[8] = "host-c";

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

uint32_t port_now(struct board *b)
{
    return host_of(b)->now;
}

void port_transmit(struct board *b, const uint8_t *bytes, uint8_t count)
{
    struct host *h = host_of(b);
    h->calls.transmit(h->user, bytes, count);
}

uint32_t port_uplink_free(struct board *b)
{
    struct host *h = host_of(b);
    return h->now + h->calls.uplink_busy(h->user);
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

/* Nothing interrupts here: edges are made between the core's functions. */
uint8_t port_lock(struct board *b)
{
    (void)b;
    return 0;
}

void port_unlock(struct board *b, uint8_t key)
{
    (void)b;
    (void)key;
}

uint16_t port_convert(struct board *b, uint8_t input)
{
    struct host *h = host_of(b);
    return (uint16_t)h->calls.convert(h->user, input);
}

bool port_interlock_closed(struct board *b)
{
    struct host *h = host_of(b);
    return h->calls.interlock_closed(h->user) != 0;
}

struct coil_heat *port_heat(struct board *b)
{
    return host_of(b)->memory->heat;
}

uint8_t port_notes(struct board *b)
{
    return host_of(b)->memory->notes;
}

void port_note(struct board *b, uint8_t note, bool holds)
{
    struct host_memory *memory = host_of(b)->memory;
    memory->notes = (uint8_t)(holds ? memory->notes | note : memory->notes & ~note);
}

/* A debugger sees the board as it is. */
void port_show(struct board *b, uint8_t state, uint16_t faults)
{
    (void)b;
    (void)state;
    (void)faults;
}

static void make_edges(struct host *h)
{
    while (h->prepared && !before(h->now, h->prepared_due)) {
        uint32_t due = h->prepared_due;
        put_out(h, h->prepared_word);
        board_edge(&h->device.board, due);
    }
}

/* What is due at this very tick, edges first. */
static void act(struct host *h)
{
    make_edges(h);
    if (board_idle_ticks(&h->device.board) == 0) {
        board_poll(&h->device.board);
        make_edges(h);
    }
}

/* Ticks until `act` is needed again; 1 if the core is not content with having been polled. */
static uint32_t until_next(struct host *h)
{
    uint32_t next = board_idle_ticks(&h->device.board);
    if (h->prepared && ticks_until(h->prepared_due, h->now) < next)
        next = ticks_until(h->prepared_due, h->now);
    return next ? next : 1;
}

void *host_new(uint32_t board, const struct settings *settings, uint32_t boot_id, uint32_t brown_out, uint32_t now,
               struct host_memory *memory, const struct host_calls *calls, void *user)
{
    if (board != BOARD_TACTILES && board != BOARD_BRAKE)
        return NULL;
    struct host *h = calloc(1, sizeof *h);
    if (!h)
        return NULL;
    h->memory = memory;
    h->calls = *calls;
    h->user = user;
    h->now = now;
    if (board == BOARD_TACTILES)
        tactiles_init(&h->device.tactiles);
    else
        brake_init(&h->device.brake);
    board_start(&h->device.board, settings, boot_id, brown_out != 0);
    return h;
}

void host_free(void *host)
{
    free(host);
}

void host_run(void *host, uint32_t now)
{
    struct host *h = host;
    act(h);
    while (h->now != now) {
        uint32_t left = now - h->now; /* time never goes back */
        uint32_t next = until_next(h);
        h->now += next < left ? next : left;
        act(h);
    }
}

void host_receive(void *host, const uint8_t *bytes, uint32_t count, uint32_t now)
{
    struct host *h = host;
    host_run(h, now);
    for (uint32_t i = 0; i < count; i++) {
        board_receive(&h->device.board, bytes[i], now);
        if (bytes[i] == 0)
            act(h);
    }
}

uint32_t host_next(void *host, uint32_t now)
{
    struct host *h = host;
    uint32_t next = until_next(h);
    uint32_t passed = now - h->now;
    return passed < next ? next - passed : 0;
}

uint32_t host_state(void *host)
{
    return ((struct host *)host)->device.board.state;
}

uint32_t host_faults(void *host)
{
    return ((struct host *)host)->device.board.faults;
}
