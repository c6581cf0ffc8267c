/* A coil board whose edge interrupt comes wherever it may: time passes whenever the core asks the clock or ends a locked
 * section, and edges that are due then are made there. One board a library. */

#include <stdlib.h>
#include <string.h>

#include "board_impl.h"
#include "port.h"
#include "tactiles.h"

#define MAX_EDGES 100000

static struct tactiles coils;
static struct coil_heat heat[COIL_CHANNELS];
static uint8_t notes;
static uint32_t now, random_state, max_step;
static bool masked, prepared;
static uint32_t prepared_word, prepared_due;
static uint32_t edge_count, edge_due[MAX_EDGES], edge_word[MAX_EDGES];
static uint8_t last_frame[80];

const char port_build[8] = "racing";

static void let_time_pass(void)
{
    random_state = random_state * 1664525u + 1013904223u;
    now += (random_state >> 16) % max_step;
    while (!masked && prepared && !before(now, prepared_due)) {
        masked = true;
        prepared = false;
        edge_due[edge_count] = prepared_due;
        edge_word[edge_count] = prepared_word;
        edge_count += edge_count < MAX_EDGES - 1;
        board_edge(&coils.board, prepared_due);
        masked = false;
    }
}

uint32_t port_now(struct board *b)
{
    (void)b;
    let_time_pass();
    return now;
}

void port_transmit(struct board *b, const uint8_t *bytes, uint8_t count)
{
    (void)b;
    memcpy(last_frame, bytes, count);
}

uint32_t port_uplink_free(struct board *b)
{
    (void)b;
    return now;
}

void port_apply(struct board *b, uint32_t word)
{
    (void)b;
    (void)word;
    prepared = false;
}

void port_prepare(struct board *b, uint32_t word, uint32_t due)
{
    (void)b;
    prepared = true;
    prepared_word = word;
    prepared_due = due;
}

void port_prepare_nothing(struct board *b)
{
    (void)b;
    prepared = false;
}

uint8_t port_lock(struct board *b)
{
    uint8_t key = masked;
    (void)b;
    masked = true;
    return key;
}

void port_unlock(struct board *b, uint8_t key)
{
    (void)b;
    masked = key;
    let_time_pass();
}

uint16_t port_convert(struct board *b, uint8_t input)
{
    (void)b;
    return input == 0 ? 500 : 0;
}

bool port_interlock_closed(struct board *b)
{
    (void)b;
    return true;
}

struct coil_heat *port_heat(struct board *b)
{
    (void)b;
    return heat;
}

uint8_t port_notes(struct board *b)
{
    (void)b;
    return notes;
}

void port_note(struct board *b, uint8_t note, bool holds)
{
    (void)b;
    notes = (uint8_t)(holds ? notes | note : notes & ~note);
}

void port_show(struct board *b, uint8_t state, uint16_t faults)
{
    (void)b;
    (void)state;
    (void)faults;
}

void racing_start(uint32_t seed, uint32_t step)
{
    static const struct settings settings = {{200, 12000, 64, 3000, 2500}, 0};
    now = 0xffff0000u;
    random_state = seed;
    max_step = step;
    masked = prepared = false;
    edge_count = 0;
    memset(heat, 0, sizeof heat);
    notes = 0;
    tactiles_init(&coils);
    board_start(&coils.board, &settings, 1, false);
}

uint32_t racing_now(void)
{
    return now;
}

/* Feeds one frame; the answer. */
const uint8_t *racing_ask(const uint8_t *bytes, uint32_t count)
{
    for (uint32_t i = 0; i < count; i++)
        board_receive(&coils.board, bytes[i], now);
    return last_frame;
}

/* Time in which the main loop does not come round. */
void racing_sleep(uint32_t ticks)
{
    now += ticks;
}

/* Polls until `until`. */
void racing_run(uint32_t until)
{
    while (before(now, until))
        board_poll(&coils.board);
}

uint32_t racing_edges(const uint32_t **due, const uint32_t **word)
{
    *due = edge_due;
    *word = edge_word;
    return edge_count;
}

uint32_t racing_begun(void)
{
    uint32_t sum = 0;
    for (uint8_t channel = 0; channel < COIL_CHANNELS; channel++)
        sum += coils.timeline.played[channel];
    return sum;
}

uint32_t racing_queued(void)
{
    return coils.timeline.waiting;
}
