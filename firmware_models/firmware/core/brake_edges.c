#include "brake_edges.h"

#include "brake.h"
#include "port.h"

#define PIEZOS 5 /* bit of the first */

/* A drive begins at or before `due`. */
static bool drive_by(const struct edges *e, uint8_t i, uint32_t due)
{
    return i < e->waiting && !before(due, e->drives[e->order[i]].start);
}

static bool burst_by(const struct edges *e, uint32_t due)
{
    return e->any_burst && !before(due, e->burst_edge);
}

static bool next_edge(const struct edges *e, uint32_t *due)
{
    *due = e->burst_edge;
    uint32_t own;
    bool any = e->any_burst;
    if (wave_next(&e->wave, &own) && (!any || before(own, *due))) {
        *due = own;
        any = true;
    }
    if (e->waiting && (!any || before(e->drives[e->order[0]].start, *due))) {
        *due = e->drives[e->order[0]].start;
        any = true;
    }
    return any;
}

/* The wave's part of the word from tick `due` on. A drive that comes at the very end of another goes on with its
 * wave. */
static uint32_t word_from(const struct edges *e, uint32_t due)
{
    if (!drive_by(e, 0, due))
        return wave_word_from(&e->wave, due);
    struct wave wave = e->wave;
    for (uint8_t i = 0; drive_by(e, i, due); i++)
        wave_take(&wave, &e->drives[e->order[i]]);
    wave_advance(&wave, due);
    return wave_word(&wave);
}

/* Hands the port the next edge there is. What follows an edge must be done in less than the shortest clamp, 50 us. */
static void prepare(struct brake *k)
{
    struct edges *e = &k->edges;
    e->prepared = next_edge(e, &e->due);
    if (!e->prepared) {
        port_prepare_nothing(&k->board);
        return;
    }
    uint16_t piezos = burst_by(e, e->due) ? e->next_piezos : e->piezos;
    port_prepare(&k->board, word_from(e, e->due) | (uint16_t)(piezos << PIEZOS), e->due);
}

/* What was added changes the next edge only if it comes no later. */
static void prepare_for(struct brake *k, uint32_t start)
{
    if (!k->edges.prepared || !before(k->edges.due, start))
        prepare(k);
}

static void apply(struct brake *k, uint32_t word)
{
    port_apply(&k->board, word);
    k->edges.prepared = false;
}

/* The bursts have changed. A finger vibrates while any of its bursts lasts. */
static void plan_bursts(struct edges *e)
{
    e->any_burst = false;
    for (uint8_t i = 0; i < BURST_QUEUE; i++) {
        const struct burst *burst = &e->bursts[i];
        if (burst->channels && (!e->any_burst || before(burst->edge, e->burst_edge))) {
            e->burst_edge = burst->edge;
            e->any_burst = true;
        }
    }
    e->next_piezos = 0;
    for (uint8_t i = 0; i < BURST_QUEUE; i++) {
        const struct burst *burst = &e->bursts[i];
        if (burst->channels && burst->on != (burst->edge == e->burst_edge))
            e->next_piezos |= burst->channels;
    }
}

static void advance_bursts(struct edges *e)
{
    e->piezos = e->next_piezos;
    for (uint8_t i = 0; i < BURST_QUEUE; i++) {
        struct burst *burst = &e->bursts[i];
        if (burst->channels == 0 || burst->edge != e->burst_edge)
            continue;
        if (burst->on)
            burst->channels = 0;
        burst->on = !burst->on;
        burst->edge += burst->duration * TICKS_PER_MS;
    }
    plan_bursts(e);
}

static void take_first(struct edges *e)
{
    uint8_t place = e->order[0];
    wave_take(&e->wave, &e->drives[place]);
    e->taken = (uint8_t)(e->taken & ~(1u << place));
    e->waiting--;
    for (uint8_t i = 0; i < e->waiting; i++)
        e->order[i] = e->order[i + 1];
}

void edges_made(struct board *b, uint32_t due)
{
    struct brake *k = (struct brake *)b;
    struct edges *e = &k->edges;
    while (drive_by(e, 0, due))
        take_first(e);
    wave_advance(&e->wave, due);
    if (burst_by(e, due))
        advance_bursts(e);
    prepare(k);
}

void edges_clear(struct brake *k, uint32_t now)
{
    struct edges *e = &k->edges;
    uint8_t key = port_lock(&k->board);
    apply(k, 0);
    if (e->wave.resting)
        e->wave.since = now;
    wave_stop(&e->wave, now);
    e->wave.resting = false;
    e->waiting = e->taken = 0;
    for (uint8_t i = 0; i < BURST_QUEUE; i++) {
        e->bursts[i].channels = 0;
        e->bursts[i].on = false;
    }
    e->piezos = 0;
    e->any_burst = false;
    port_unlock(&k->board, key);
}

/* Behind those that start at the same tick: the last that came is the one that counts. */
static void insert(struct edges *e, uint8_t place)
{
    uint8_t i = e->waiting++;
    for (; i > 0 && before(e->drives[place].start, e->drives[e->order[i - 1]].start); i--)
        e->order[i] = e->order[i - 1];
    e->order[i] = place;
    e->taken = (uint8_t)(e->taken | 1u << place);
}

uint8_t edges_add_drive(struct brake *k, const struct drive *d, uint16_t *detail)
{
    struct edges *e = &k->edges;
    uint8_t place = 0;
    uint8_t key = port_lock(&k->board);
    uint8_t taken = e->taken;
    port_unlock(&k->board, key);
    while (place < DRIVE_QUEUE && taken >> place & 1)
        place++;
    if (place < DRIVE_QUEUE)
        e->drives[place] = *d; /* a free place is the main loop's */

    key = port_lock(&k->board);
    uint8_t status = board_check_time(&k->board, d->start, detail);
    if (status == STATUS_OK && place == DRIVE_QUEUE)
        status = STATUS_FULL;
    if (status == STATUS_OK) {
        insert(e, place);
        prepare_for(k, d->start);
    }
    port_unlock(&k->board, key);
    return status;
}

/* Until it begins, nothing that is on by then changes. */
static void insert_burst(struct edges *e, const struct burst *burst)
{
    if (!e->any_burst || before(burst->edge, e->burst_edge)) {
        e->burst_edge = burst->edge;
        e->next_piezos = e->piezos | burst->channels;
    } else if (burst->edge == e->burst_edge) {
        e->next_piezos |= burst->channels;
    }
    e->any_burst = true;
}

uint8_t edges_add_burst(struct brake *k, uint32_t start, uint8_t channels, uint16_t duration, uint16_t *detail)
{
    struct edges *e = &k->edges;
    uint8_t key = port_lock(&k->board);
    uint8_t place = 0;
    while (place < BURST_QUEUE && e->bursts[place].channels)
        place++;
    port_unlock(&k->board, key);

    key = port_lock(&k->board);
    uint8_t status = board_check_time(&k->board, start, detail);
    if (status == STATUS_OK && place == BURST_QUEUE)
        status = STATUS_FULL;
    if (status == STATUS_OK) {
        e->bursts[place] = (struct burst){.edge = start, .duration = duration, .channels = channels};
        insert_burst(e, &e->bursts[place]);
        prepare_for(k, start);
    }
    port_unlock(&k->board, key);
    return status;
}

void edges_look(struct brake *k, struct wave *w)
{
    uint8_t key = port_lock(&k->board);
    *w = k->edges.wave;
    port_unlock(&k->board, key);
}

bool edges_rest(struct brake *k)
{
    uint8_t key = port_lock(&k->board);
    bool off = k->edges.wave.phase == WAVE_OFF;
    if (off) {
        wave_rest(&k->edges.wave);
        prepare(k);
    }
    port_unlock(&k->board, key);
    return off;
}

uint8_t edges_queued(struct brake *k)
{
    const struct edges *e = &k->edges;
    uint8_t key = port_lock(&k->board);
    uint8_t queued = e->waiting;
    for (uint8_t i = 0; i < BURST_QUEUE; i++)
        queued = (uint8_t)(queued + (e->bursts[i].channels && !e->bursts[i].on));
    port_unlock(&k->board, key);
    return queued;
}

void edges_test_connect(struct brake *k, uint8_t mask)
{
    struct wave *w = &k->edges.wave;
    uint8_t key = port_lock(&k->board);
    w->mask = mask;
    w->amplitude = SELF_TEST_V;
    w->phase = TEST_HELD;
    apply(k, wave_word(w));
    port_unlock(&k->board, key);
}

void edges_test_pulse(struct brake *k, uint32_t start, uint32_t ticks)
{
    struct wave *w = &k->edges.wave;
    uint8_t key = port_lock(&k->board);
    w->next = start;
    w->end = start + ticks;
    w->phase = TEST_WAITING;
    prepare(k);
    port_unlock(&k->board, key);
}

void edges_test_short(struct brake *k, uint32_t now)
{
    uint8_t key = port_lock(&k->board);
    wave_stop(&k->edges.wave, now);
    apply(k, 0);
    port_unlock(&k->board, key);
}
