/* Pulses wait in a list ordered by their start. board_edge, an interrupt, takes them off its head and does nothing
 * that takes longer the more of them wait; the main loop, which alone adds and cancels, finds the place first and
 * then links in a short locked section. Its walk along the list never goes astray, for `start` and `next` of a pulse
 * that has begun or ended stay what they are until the main loop gives its place to another, which it does before it
 * walks. */

#include "tactiles.h"

#include <string.h>

#include "port.h"

#define FEED 0x8000u /* in the output word: coil supply on the drivers */
#define ALL_COILS 0x7fffu
#define TOWARD_SKIN 0x10u /* in pulse.coil */
#define GONE 0x20u /* begun, or cancelled: the place is free */
#define CHANNEL 0x0fu
#define NONE 0xffu
#define CROWDED 0x8000u /* detail: too many coils at a time */

enum { SUPPLY_INPUT = 0, CURRENT_INPUT = 1 };
#define SUPPLY_MV_PER_COUNT 10u
#define CURRENT_MA_PER_COUNT 64u
#define LOOK_TICKS TICKS_PER_MS
#define LONG_DOUBT 16u /* looks: pulses that end just before each of so many are no chance */

/* What a pulse command asks for, and where it goes in the list. */
struct request {
    uint32_t start;
    uint32_t end; /* when its last coil goes off */
    const uint8_t *durations;
    uint16_t channels;
    uint16_t toward_skin;
    uint8_t count;
    uint8_t first, last; /* its pulses' places */
    uint8_t previous;    /* pulse after which they come, or NONE */
};

static struct tactiles *coils_of(struct board *b)
{
    return (struct tactiles *)b;
}

/* A shift by a variable would be a loop on an 8-bit CPU. */
static const uint16_t bits[COIL_CHANNELS] = {0x0001, 0x0002, 0x0004, 0x0008, 0x0010, 0x0020, 0x0040, 0x0080,
                                             0x0100, 0x0200, 0x0400, 0x0800, 0x1000, 0x2000, 0x4000};

static uint16_t coil_of(const struct pulse *p)
{
    return bits[p->coil & CHANNEL];
}

static uint16_t length_of(uint8_t duration)
{
    return (uint16_t)(duration * DURATION_TICKS);
}

/* Hands the port the next edge there is. In a locked section, or from board_edge. */
static void prepare_next(struct tactiles *t)
{
    struct timeline *line = &t->timeline;
    bool any = line->head != NONE;
    uint32_t due = any ? line->pulses[line->head].start : 0;
    uint16_t ending = 0;
    for (uint8_t i = 0; i < line->on_count; i++) {
        const struct running *on = &line->on[i];
        if (!any || before(on->end, due)) {
            due = on->end;
            ending = on->coil;
            any = true;
        } else if (on->end == due) {
            ending |= on->coil;
        }
    }
    line->prepared = any;
    if (!any) {
        port_prepare_nothing(&t->board);
        return;
    }
    uint16_t coils = line->coils & (uint16_t)~ending;
    uint16_t toward_skin = line->toward_skin & (uint16_t)~ending;
    uint8_t beginning = 0;
    for (uint8_t i = line->head; i != NONE; i = line->pulses[i].next) {
        const struct pulse *p = &line->pulses[i];
        if (p->start != due)
            break;
        coils |= coil_of(p);
        if (p->coil & TOWARD_SKIN)
            toward_skin |= coil_of(p);
        beginning++;
    }
    line->due = due;
    line->next_coils = coils;
    line->next_toward_skin = toward_skin;
    line->ending = ending;
    line->beginning = beginning;
    port_prepare(&t->board, coils | (uint32_t)toward_skin << 16, due);
}

static void edge(struct board *b, uint32_t due)
{
    struct tactiles *t = coils_of(b);
    struct timeline *line = &t->timeline;
    uint8_t on_count = line->on_count;
    line->coils = line->next_coils;
    line->toward_skin = line->next_toward_skin;
    for (uint8_t i = on_count; line->ending && i-- > 0;) {
        if (line->on[i].coil & line->ending)
            line->on[i] = line->on[--on_count];
    }
    for (uint8_t n = line->beginning; n > 0; n--) {
        struct pulse *p = &line->pulses[line->head];
        struct running *on = &line->on[on_count++];
        on->end = due + length_of(p->duration);
        on->coil = coil_of(p);
        line->played[p->coil & CHANNEL]++;
        line->to_play[p->coil & CHANNEL] = (uint16_t)(line->to_play[p->coil & CHANNEL] - p->duration);
        p->coil |= GONE;
        line->head = p->next;
        line->waiting--;
    }
    line->on_count = on_count;
    if (on_count > line->max_on)
        line->max_on = on_count;
    prepare_next(t);
}

/* What follows pulse `i` among those that wait: a link that may be changed. In a locked section. If `i` has begun
 * meanwhile, then so has all that starts no later, and what follows is the head. */
static uint8_t *link_after(struct timeline *line, uint8_t i)
{
    return i == NONE || line->pulses[i].coil & GONE ? &line->head : &line->pulses[i].next;
}

/* The next free place, all round the array: there is one, and mostly it is the next. */
static uint8_t free_place(struct tactiles *t)
{
    do
        t->place = t->place + 1u < PULSE_QUEUE ? (uint8_t)(t->place + 1u) : 0;
    while (!(t->timeline.pulses[t->place].coil & GONE));
    return t->place;
}

/* Puts the request's pulses into free places, linked with each other. */
static void fill(struct tactiles *t, struct request *r)
{
    r->first = NONE;
    for (uint8_t channel = COIL_CHANNELS; channel-- > 0;) {
        if (!(r->channels & bits[channel]))
            continue;
        uint8_t place = free_place(t);
        struct pulse *p = &t->timeline.pulses[place];
        p->start = r->start;
        p->duration = r->durations[channel];
        p->coil = r->toward_skin & bits[channel] ? channel | TOWARD_SKIN : channel;
        p->next = r->first;
        if (r->first == NONE)
            r->last = place;
        r->first = place;
    }
}

static void forget(struct timeline *line, const struct request *r)
{
    for (uint8_t i = r->first; i != NONE; i = line->pulses[i].next)
        line->pulses[i].coil |= GONE;
}

/* Finds the request's place in the list, and returns whether it fits in time: STATUS_OK or STATUS_FULL. Walks the
 * pulses that begin before its last coil goes off, once, in order of their start. At most COILS_AT_ONCE are on at
 * any moment, so that their ends are all there is to remember, and their number only ever grows where one begins. */
static uint8_t fit(struct tactiles *t, struct request *r, uint16_t *detail)
{
    const struct timeline *line = &t->timeline;
    struct running on[COILS_AT_ONCE];
    uint32_t ends[COILS_AT_ONCE];
    uint8_t active = 0;
    uint16_t taken = 0;

    uint8_t key = port_lock(&t->board);
    uint8_t on_count = line->on_count;
    memcpy(on, line->on, sizeof on);
    uint8_t i = line->head;
    port_unlock(&t->board, key);

    /* What is on when the request starts: some that are on now, some that begin until then. */
    for (uint8_t k = 0; k < on_count; k++) {
        if (before(r->start, on[k].end)) {
            ends[active++] = on[k].end;
            taken |= on[k].coil;
        }
    }
    r->previous = NONE;
    for (; i != NONE; i = line->pulses[i].next) {
        const struct pulse *p = &line->pulses[i];
        if (before(r->start, p->start))
            break;
        r->previous = i;
        if (r->start - p->start < length_of(p->duration)) {
            ends[active++] = p->start + length_of(p->duration);
            taken |= coil_of(p);
        }
    }
    taken &= r->channels;

    /* The request itself. */
    bool crowded = active + r->count > t->allowed_on;
    for (uint8_t k = r->first; k != NONE && !crowded; k = line->pulses[k].next)
        ends[active++] = r->start + length_of(line->pulses[k].duration);

    /* What begins while it lasts. */
    for (; i != NONE; i = line->pulses[i].next) {
        const struct pulse *p = &line->pulses[i];
        if (!before(p->start, r->end))
            break;
        if ((r->channels & coil_of(p)) && p->start - r->start < length_of(r->durations[p->coil & CHANNEL]))
            taken |= coil_of(p);
        if (crowded)
            continue;
        for (uint8_t k = active; k-- > 0;) {
            if (!before(p->start, ends[k]))
                ends[k] = ends[--active];
        }
        crowded = active == t->allowed_on;
        if (!crowded)
            ends[active++] = p->start + length_of(p->duration);
    }
    *detail = taken ? taken : crowded ? CROWDED : 0;
    return taken || crowded ? STATUS_FULL : STATUS_OK;
}

static void note(struct tactiles *t, uint8_t note, bool holds)
{
    if (holds == ((t->notes & note) != 0))
        return;
    t->notes ^= note;
    port_note(&t->board, note, holds);
}

/* The request's coils whose accounts have no room for it. */
static uint16_t hot(struct tactiles *t, const struct request *r)
{
    const struct coil_heat *heat = port_heat(&t->board);
    uint16_t coils = 0;
    for (uint8_t channel = 0; channel < COIL_CHANNELS; channel++) {
        if ((r->channels & bits[channel]) && heat_exceeds(&heat[channel], r->durations[channel], t->board.limits[4]))
            coils |= bits[channel];
    }
    return coils;
}

static void charge(struct tactiles *t, uint8_t channel, uint16_t durations, uint32_t now)
{
    struct coil_heat *heat = &port_heat(&t->board)[channel];
    if (!t->cooling)
        t->cool_due = now + HEAT_STEP_TICKS;
    t->cooling = true;
    heat_charge(heat, durations);
    note(t, NOTE_USED, true);
    if (heat->on_time > heat_of_ms(WARM_MS))
        note(t, NOTE_WARM, true);
}

static void charge_request(struct tactiles *t, const struct request *r)
{
    for (uint8_t channel = 0; channel < COIL_CHANNELS; channel++) {
        if (r->channels & bits[channel])
            charge(t, channel, r->durations[channel], t->board.dealt);
    }
}

/* Links the request's pulses into the list if they are still in time. */
static uint8_t link_in(struct tactiles *t, const struct request *r, uint16_t *detail)
{
    struct timeline *line = &t->timeline;
    uint8_t key = port_lock(&t->board);
    uint8_t status = board_check_time(&t->board, r->start, detail);
    if (status == STATUS_OK) {
        uint8_t *link = link_after(line, r->previous);
        line->pulses[r->last].next = *link;
        *link = r->first;
        line->waiting = (uint8_t)(line->waiting + r->count);
        for (uint8_t i = r->first, n = r->count; n > 0; n--, i = line->pulses[i].next) {
            uint16_t *to_play = &line->to_play[line->pulses[i].coil & CHANNEL];
            *to_play = (uint16_t)(*to_play + line->pulses[i].duration);
        }
        if (!line->prepared || !before(line->due, r->start))
            prepare_next(t);
    }
    port_unlock(&t->board, key);
    return status;
}

static uint8_t pulse(struct tactiles *t, const uint8_t *payload, uint16_t *detail)
{
    struct board *b = &t->board;
    struct request r = {
        .start = get_u32(payload + AT_PULSE_TIME),
        .durations = payload + AT_PULSE_DURATION,
        .channels = get_u16(payload + AT_PULSE_CHANNELS),
        .toward_skin = get_u16(payload + AT_PULSE_TOWARD_SKIN),
    };
    if (!board_ready(b, detail))
        return STATUS_INTERLOCK;
    if (r.channels == 0 || r.channels & (uint16_t)~ALL_COILS) {
        *detail = 1;
        return STATUS_BAD_VALUE;
    }
    uint8_t longest = 0;
    for (uint8_t channel = 0; channel < COIL_CHANNELS; channel++) {
        if (!(r.channels & bits[channel]))
            continue;
        uint8_t duration = r.durations[channel];
        if (duration == 0 || duration > b->limits[0]) {
            *detail = 3;
            return STATUS_BAD_VALUE;
        }
        longest = duration > longest ? duration : longest;
        r.count++;
    }
    r.end = r.start + length_of(longest);
    uint8_t status = board_check_time(b, r.start, detail);
    if (status != STATUS_OK)
        return status;
    if (t->timeline.waiting + r.count > b->limits[2])
        return STATUS_FULL;
    fill(t, &r);
    status = fit(t, &r, detail);
    if (status == STATUS_OK && (*detail = hot(t, &r)) != 0)
        status = STATUS_HOT;
    if (status == STATUS_OK)
        status = link_in(t, &r, detail);
    if (status == STATUS_OK)
        charge_request(t, &r);
    else
        forget(&t->timeline, &r);
    return status;
}

static uint8_t cancel(struct tactiles *t, uint16_t channels, uint16_t *detail)
{
    struct timeline *line = &t->timeline;
    uint8_t previous = NONE, i;
    do {
        uint8_t key = port_lock(&t->board);
        uint8_t *link = link_after(line, previous);
        i = *link;
        if (i != NONE && channels & coil_of(&line->pulses[i])) {
            struct pulse *p = &line->pulses[i];
            *link = p->next;
            p->coil |= GONE;
            line->waiting--;
            (*detail)++;
            line->to_play[p->coil & CHANNEL] = (uint16_t)(line->to_play[p->coil & CHANNEL] - p->duration);
            heat_refund(&port_heat(&t->board)[p->coil & CHANNEL], p->duration);
            if (p->start == line->due)
                prepare_next(t);
        } else {
            previous = i;
        }
        port_unlock(&t->board, key);
    } while (i != NONE);
    return STATUS_OK;
}

static uint8_t command(struct board *b, uint8_t type, const uint8_t *payload, uint16_t *detail)
{
    if (type == MESSAGE_PULSE)
        return pulse(coils_of(b), payload, detail);
    if (type == MESSAGE_CANCEL)
        return cancel(coils_of(b), get_u16(payload + AT_CANCEL_CHANNELS), detail);
    return STATUS_UNKNOWN;
}

/* Nothing waits any more: what was charged for it is given back. */
static void refund_all(struct tactiles *t)
{
    uint16_t *to_play = t->timeline.to_play;
    for (uint8_t channel = 0; channel < COIL_CHANNELS; channel++) {
        if (to_play[channel])
            heat_refund(&port_heat(&t->board)[channel], to_play[channel]);
        to_play[channel] = 0;
    }
}

static uint8_t make_safe(struct board *b, uint32_t now)
{
    struct timeline *line = &coils_of(b)->timeline;
    (void)now;
    uint8_t key = port_lock(b);
    port_apply(b, 0);
    line->coils = line->toward_skin = 0;
    line->prepared = false;
    line->on_count = 0;
    line->head = NONE;
    line->waiting = 0;
    port_unlock(b, key);
    coils_of(b)->ahead = 0; /* it may have flowed: it stays charged */
    for (uint8_t i = 0; i < PULSE_QUEUE; i++)
        line->pulses[i].coil = GONE;
    refund_all(coils_of(b));
    return STATE_DISARMED;
}

static void start(struct board *b, const struct settings *settings)
{
    struct tactiles *t = coils_of(b);
    (void)settings;
    t->notes = port_notes(b);
    heat_start(port_heat(b), t->notes, b->limits[4]);
    t->cool_due = port_now(b) + HEAT_STEP_TICKS;
    t->cooling = true;
    make_safe(b, 0);
}

static uint16_t supply_mv(struct board *b)
{
    return port_convert(b, SUPPLY_INPUT) * SUPPLY_MV_PER_COUNT;
}

static uint16_t current_ma(struct board *b)
{
    return port_convert(b, CURRENT_INPUT) * CURRENT_MA_PER_COUNT;
}

/* Unasked current may be any coil's: all are charged with the time until the next look and a little beyond, so that
 * whatever cuts an armed stretch short finds charged what may have flowed. `flowed`: it has for sure, until now. */
static void charge_ahead(struct tactiles *t, bool flowed, uint32_t now)
{
    if (!t->ahead)
        t->paid = t->looked;
    if (before(t->paid, now + LOOK_TICKS)) {
        uint32_t short_ticks = now + 2u * LOOK_TICKS - t->paid;
        uint16_t more = (uint16_t)(short_ticks < DEAD_MAN_TICKS ? short_ticks / DURATION_TICKS : DEAD_MAN_TICKS / DURATION_TICKS);
        for (uint8_t channel = 0; channel < COIL_CHANNELS; channel++)
            charge(t, channel, more, now);
        t->ahead = (uint16_t)(t->ahead + more);
        t->paid += (uint32_t)more * DURATION_TICKS;
    }
    uint32_t left = ticks_until(t->paid, now) / DURATION_TICKS;
    if (flowed && left < t->ahead)
        t->ahead = (uint16_t)left;
}

static uint8_t arm(struct board *b, uint32_t now, uint16_t *detail)
{
    struct tactiles *t = coils_of(b);
    if (supply_mv(b) < b->limits[3]) {
        *detail = 1u << FAULT_SUPPLY;
        return STATUS_INTERLOCK;
    }
    for (uint8_t channel = 0; channel < COIL_CHANNELS; channel++) {
        if (port_heat(b)[channel].on_time > heat_of_ms(ON_TIME_MS))
            *detail |= bits[channel];
    }
    if (*detail)
        return STATUS_HOT;
    t->allowed_on = (uint8_t)(b->limits[1] / WORST_COIL_MA);
    t->excess = t->unasked = t->spared = false;
    t->doubts = 0;
    t->timeline.max_on = 0;
    t->looked = now;
    t->look_due = now + LOOK_TICKS;
    t->paid = now + LOOK_TICKS;
    t->ahead = LOOK_TICKS / DURATION_TICKS;
    if (!t->cooling)
        t->cool_due = now + HEAT_STEP_TICKS;
    t->cooling = true;
    for (uint8_t channel = 0; channel < COIL_CHANNELS; channel++)
        heat_charge(&port_heat(b)[channel], t->ahead); /* without a note: no coil was asked for yet */
    t->timeline.coils = FEED;
    port_apply(b, FEED);
    board_set_state(b, STATE_ARMED);
    return STATUS_OK;
}

static bool cause_gone(struct board *b, uint8_t fault)
{
    return fault != FAULT_SUPPLY || supply_mv(b) >= b->limits[3];
}

/* Something that held at the last look or not (`*held`), since `*since`: true once it has held for `min` ticks. */
static bool lasts(bool holds, bool *held, uint32_t *since, uint32_t now, uint32_t min)
{
    if (!holds || !*held)
        *since = now;
    *held = holds;
    return holds && now - *since >= min;
}

/* Nothing has flowed that was not asked for. */
static void refund_ahead(struct tactiles *t)
{
    for (uint8_t channel = 0; channel < COIL_CHANNELS; channel++)
        heat_refund(&port_heat(&t->board)[channel], t->ahead);
    t->ahead = 0;
}

/* What so many coils may draw at this supply: a quarter more than the worst ones do, 1.28 ohm each. */
static uint16_t drawable_ma(uint8_t coils, uint16_t supply)
{
    return (uint16_t)(coils * (supply - (supply * 3u >> 7)) + NO_CURRENT_MA);
}

/* Supply and current against what they may be. A coil that has just gone off may still be in the reading, hence
 * `max_on`. Where only that explains it, the next look comes out of step with such pulses; so one soon sees what is. */
static void look(struct tactiles *t, uint32_t now)
{
    struct board *b = &t->board;
    uint16_t current = current_ma(b);
    /* Nothing flows between pulses: every other look leaves the supply, which does not sag then, alone. */
    t->spared = current <= NO_CURRENT_MA && t->timeline.waiting && !t->spared;
    uint16_t supply = t->spared ? UINT16_MAX : supply_mv(b);
    uint8_t key = port_lock(b);
    uint8_t max_on = t->timeline.max_on;
    uint8_t on = t->timeline.max_on = t->timeline.on_count;
    port_unlock(b, key);

    bool flows = current > NO_CURRENT_MA;
    bool doubtful = flows && current > drawable_ma(on, supply);
    bool excess = doubtful && max_on && current > drawable_ma(max_on, supply); /* with none on it has a fault of its own */
    t->doubts = doubtful ? (uint8_t)(t->doubts + (t->doubts < UINT8_MAX)) : 0;
    bool unexplained = excess || (doubtful && (!max_on || t->doubts > LONG_DOUBT));

    t->unasked = t->unasked && flows;
    if (unexplained)
        t->unasked_ticks = t->unasked ? t->unasked_ticks + (now - t->looked) : 0;
    t->unasked = t->unasked || unexplained;
    if (t->unasked || (doubtful && t->ahead)) {
        charge_ahead(t, t->unasked, now);
    } else if (t->ahead && !doubtful) {
        refund_ahead(t);
    }
    t->looked = now;
    t->look_due = now + (t->doubts & 1u && !t->unasked ? LOOK_TICKS * 5u / 8u : LOOK_TICKS);
    if (t->unasked && before(b->telemetry_due, t->look_due + LOOK_TICKS))
        b->telemetry_due = t->look_due + LOOK_TICKS; /* a frame takes an 8-bit CPU long: finding out goes first */

    if (supply < b->limits[3])
        board_latch(b, FAULT_SUPPLY, NO_CHANNEL, supply);
    else if (lasts(excess || current > b->limits[1], &t->excess, &t->excess_since, now, COIL_CURRENT_TICKS))
        board_latch(b, FAULT_COIL_CURRENT, NO_CHANNEL, current);
    else if (unexplained && t->unasked_ticks >= b->limits[0] * DURATION_TICKS + COIL_CURRENT_TICKS)
        board_latch(b, FAULT_COIL_ON_TIME, NO_CHANNEL, current);
}

/* One step of the accounts' decay. The note of warmth is taken back well below where it is made: an EEPROM's cell
 * stands 100,000 changes. */
static void cool(struct tactiles *t)
{
    uint16_t waiting[COIL_CHANNELS];
    uint8_t key = port_lock(&t->board);
    memcpy(waiting, t->timeline.to_play, sizeof waiting);
    port_unlock(&t->board, key);
    for (uint8_t channel = 0; t->ahead && channel < COIL_CHANNELS; channel++)
        waiting[channel] = (uint16_t)(waiting[channel] + t->ahead);
    uint32_t max = heat_decay(port_heat(&t->board), waiting);
    t->cooling = max != 0;
    t->cool_due += HEAT_STEP_TICKS;
    if (max < heat_of_ms(COOLED_MS))
        note(t, NOTE_WARM, false);
}

static void poll(struct board *b, uint32_t now)
{
    struct tactiles *t = coils_of(b);
    while (t->cooling && !before(now, t->cool_due))
        cool(t);
    if (!b->armed || before(now, t->look_due))
        return;
    look(t, now);
}

static uint32_t idle_ticks(struct board *b, uint32_t now)
{
    const struct tactiles *t = coils_of(b);
    uint32_t idle = b->armed ? ticks_until(t->look_due, now) : FOREVER;
    uint32_t left = t->cooling ? ticks_until(t->cool_due, now) : FOREVER;
    return left < idle ? left : idle;
}

static void fill_telemetry(struct board *b, uint8_t *payload)
{
    const struct timeline *line = &coils_of(b)->timeline;
    for (uint8_t channel = 0; channel < COIL_CHANNELS; channel++) {
        uint8_t key = port_lock(b);
        uint16_t played = line->played[channel];
        port_unlock(b, key);
        put_u16(payload + AT_TACTILES_TELEMETRY_PLAYED + 2 * channel, played);
        payload[AT_TACTILES_TELEMETRY_HEAT + channel] = heat_units(&port_heat(b)[channel], coils_of(b)->ahead);
    }
    put_u16(payload + AT_TACTILES_TELEMETRY_SUPPLY, supply_mv(b));
    put_u16(payload + AT_TACTILES_TELEMETRY_CURRENT, current_ma(b));
    put_u16(payload + AT_TACTILES_TELEMETRY_QUEUED, line->waiting);
}

static const struct board_kind tactiles_kind = {
    .number = BOARD_TACTILES,
    .channels = COIL_CHANNELS,
    .telemetry = MESSAGE_TACTILES_TELEMETRY,
    .telemetry_size = TACTILES_TELEMETRY_SIZE,
    .greater_is_stricter = 1u << 3,
    .limits = {LONGEST_PULSE, COIL_CURRENT_MA, PULSE_QUEUE, MIN_SUPPLY_MV, ON_TIME_MS},
    .own = TACTILES_COMMANDS,
    .start = start,
    .arm = arm,
    .make_safe = make_safe,
    .cause_gone = cause_gone,
    .command = command,
    .edge = edge,
    .poll = poll,
    .idle_ticks = idle_ticks,
    .fill_telemetry = fill_telemetry,
};

void tactiles_init(struct tactiles *t)
{
    memset(t, 0, sizeof *t);
    t->board.kind = &tactiles_kind;
}
