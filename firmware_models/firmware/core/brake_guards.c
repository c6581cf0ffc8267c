#include "brake_guards.h"

#include "brake.h"
#include "port.h"

#define LEAD_TICKS 600u /* before the clamp: four conversions, and how far ahead an edge is reported on an ATmega; */
#define LEAD_SHARE 3u   /* but of a short half period no more than a third, so that its middle is looked at too */
#define LOOK_TICKS TICKS_PER_MS
#define ROUNDING_V 4    /* of a difference of two readings of the bridge */
#define WRONG_SIGN_V 20 /* see brake_guards.h */
#define SENSED_V 200    /* the smallest ramp that gives C: to 2 % */
#define MAX_SANE_V 2000

/* What the senses read. Times are before and after the conversion of the bridge. */
struct look {
    uint32_t begun;
    uint32_t ended;
    int16_t volts; /* on the bridge, in its present polarity: negative until the load is turned round */
    uint16_t current;
    uint16_t highest;
    bool last; /* shortly before the clamp */
};

/* What to expect of the outputs that are on. */
struct load {
    uint32_t pf;
    uint32_t ramp; /* ticks from 0 V to the amplitude */
    uint32_t hold; /* ticks after which all is charged, and the current has died away */
};

/* The hold phase begins late enough for what a clamp left with the wrong sign, for 5 % more capacitance, and
 * for ten time constants of the output's resistance. */
static struct load load_of(const struct brake *k, const struct wave *w)
{
    struct load load = {.pf = STRAY_PF};
    for (uint8_t output = 0; output < BRAKE_CHANNELS; output++) {
        if (w->mask >> output & 1)
            load.pf += k->measured[output];
    }
    load.ramp = 2 * load.pf * w->amplitude / k->supply_ua;
    load.hold = load.ramp + load.ramp / 2 + load.pf * (OUTPUT_OHM / 1000u) / 50u;
    return load;
}

/* The first of those that are on; `*others`: there are more. */
static uint8_t first_output(const struct wave *w, bool *others)
{
    uint8_t output = 0;
    while (!(w->mask >> output & 1))
        output++;
    *others = w->mask >> output != 1;
    return output;
}

static void latch(struct brake *k, const struct wave *w, uint8_t fault, uint16_t value)
{
    bool others;
    uint8_t output = first_output(w, &others);
    board_latch(&k->board, fault, others ? NO_CHANNEL : output, value);
}

static uint32_t last_look(const struct wave *w)
{
    uint32_t max = w->half / LEAD_SHARE;
    return w->next - (max < LEAD_TICKS ? max : LEAD_TICKS);
}

/* This half period is one of those looked at. */
static bool chosen(const struct guards *g, const struct wave *w)
{
    if (w->since == g->half_begun || w->half >= LOOK_TICKS)
        return true;
    return w->negative != g->negative && w->since - g->half_begun >= LOOK_TICKS;
}

/* False: an edge fell into it, or one that is still to come was reported. */
static bool take_look(struct brake *k, const struct wave *w, struct look *l)
{
    struct board *b = &k->board;
    struct wave after;
    l->begun = port_now(b);
    int16_t bridge = (int16_t)(((int16_t)port_convert(b, BRIDGE_INPUT) - BRIDGE_ZERO) * BRIDGE_V_PER_COUNT);
    l->ended = port_now(b);
    l->volts = w->negative ? (int16_t)-bridge : bridge;
    l->current = port_convert(b, CURRENT_INPUT);
    l->highest = port_convert(b, HIGHEST_INPUT);
    l->last = !before(l->begun, last_look(w));
    bool others;
    uint16_t reached = l->last ? output_volts(k, first_output(w, &others)) : k->guards.reached;
    edges_look(k, &after);
    if (after.changes != w->changes || before(l->begun, w->since) || before(l->begun, w->charging))
        return false;
    k->guards.reached = reached;
    return true;
}

/* What a short clamp has left of a higher amplitude has the wrong sign, and is none of the supply's making. */
static bool over_voltage(const struct wave *w, const struct look *l)
{
    if (l->volts < 0)
        return false;
    uint16_t surely = l->highest ? (uint16_t)(l->highest * V_PER_COUNT - V_PER_COUNT / 2) : 0;
    return surely * UINT32_C(100) > w->ceiling * (UINT32_C(100) + OVER_VOLTAGE_PERCENT);
}

static bool over_current(struct guards *g, const struct look *l)
{
    bool excess = l->current > OVER_CURRENT_UA;
    if (!excess || !g->excess)
        g->excess_since = l->begun;
    g->excess = excess;
    return excess && l->begun - g->excess_since >= OVER_CURRENT_TICKS;
}

/* The last change of sign was a half period before this one began: by its middle that makes one and a half. */
static bool bridge_stuck(const struct wave *w, const struct look *l)
{
    return !w->first && l->begun - w->since >= w->half / 2 && l->volts <= -WRONG_SIGN_V;
}

/* It begins at 0 V or with the wrong sign, so that in time t less than half the capacitance gets more than 2 I t / C.
 * So does a bridge that is stuck, in the half periods of its polarity: where not all are looked at, it takes one of
 * each. */
static bool open_output(struct brake *k, const struct wave *w, const struct look *l, const struct load *load)
{
    struct guards *g = &k->guards;
    if (w->first || l->volts <= ROUNDING_V)
        return false;
    uint32_t given = k->supply_ua * (l->ended - w->since);
    if ((uint16_t)(l->volts - ROUNDING_V) * load->pf <= given)
        return false;
    bool both = g->open && g->open_negative != w->negative;
    g->open = true;
    g->open_negative = w->negative;
    return both || w->half >= LOOK_TICKS;
}

/* By a ramp of `rise` volts; `sum` of those at its ends gives what the bleeder took. Of several outputs only the sum is
 * known. */
static void sense_capacitance(struct brake *k, const struct wave *w, uint32_t ticks, uint16_t rise, int16_t sum)
{
    bool others;
    uint8_t output = first_output(w, &others);
    if (others)
        return;
    uint32_t bled = sum > 0 ? ticks * (uint16_t)sum / (4 * BLEEDER_MOHM) : 0;
    uint32_t pf = (k->supply_ua * (ticks / 2) - bled) / rise;
    k->sensed[output] = pf > STRAY_PF ? (uint16_t)(pf - STRAY_PF) : 0;
}

/* Full current from the first look at this ramp until now, and a rise as of more than one and a half times the
 * capacitance. Meanwhile the capacitance is measured, where an output is on alone. */
static bool shorted(struct brake *k, const struct wave *w, const struct look *l, const struct load *load)
{
    struct guards *g = &k->guards;
    if (l->current * 10u < k->supply_ua * 9u) {
        g->ramp = false;
        return false;
    }
    if (!g->ramp) {
        g->ramp = true;
        g->ramp_begun = l->begun;
        g->ramp_v = l->volts;
        return false;
    }
    uint32_t ticks = l->begun - g->ramp_begun;
    int16_t rise = (int16_t)(l->volts - g->ramp_v);
    if (rise > MAX_SANE_V)
        return false;
    uint32_t rise_at_most = rise > 0 ? (uint32_t)rise + ROUNDING_V : ROUNDING_V;
    uint32_t conversion = l->ended - l->begun; /* either look may be of its beginning or of its end */
    if (ticks > conversion && 3 * rise_at_most * load->pf < k->supply_ua * (ticks - conversion))
        return true;
    if (rise >= SENSED_V && (uint16_t)rise >= w->amplitude / 2)
        sense_capacitance(k, w, ticks, (uint16_t)rise, (int16_t)(l->volts + g->ramp_v));
    return false;
}

/* Tenths of a microampere beyond the bleeder. */
static uint16_t leakage(const struct wave *w, const struct look *l)
{
    uint16_t bleeds = w->amplitude / (BLEEDER_MOHM / 10u);
    uint16_t given = (uint16_t)(l->current * 10u);
    return given > bleeds ? (uint16_t)(given - bleeds) : 0;
}

/* In the hold phase. A count of the current is rounded by half a microampere. */
static bool leaks(struct brake *k, const struct wave *w, const struct look *l, uint16_t leakage_dua)
{
    struct guards *g = &k->guards;
    bool dropped = g->held && g->held_v - l->volts > (int16_t)DROP_V + ROUNDING_V;
    g->held = true;
    g->held_v = l->volts;

    uint8_t on = 0;
    for (uint8_t output = 0; output < BRAKE_CHANNELS; output++)
        on = (uint8_t)(on + (w->mask >> output & 1));
    for (uint8_t output = 0; output < BRAKE_CHANNELS; output++) {
        if (w->mask >> output & 1)
            k->leakage[output] = leakage_dua / on;
    }
    return dropped || leakage_dua > 10 * LEAK_UA + 5;
}

static void judge(struct brake *k, const struct wave *w, const struct look *l)
{
    struct guards *g = &k->guards;
    struct load load = load_of(k, w);
    uint16_t volts = (uint16_t)(l->volts < 0 ? -l->volts : l->volts);
    if (g->changes != w->changes)
        g->ramp = g->held = false;
    g->changes = w->changes;
    g->half_begun = w->since;
    g->negative = w->negative;

    if (over_voltage(w, l)) {
        latch(k, w, FAULT_OVER_VOLTAGE, l->highest * V_PER_COUNT);
    } else if (over_current(g, l)) {
        latch(k, w, FAULT_OVER_CURRENT, l->current);
    } else if (bridge_stuck(w, l)) {
        latch(k, w, FAULT_BRIDGE_STUCK, volts);
    } else if (open_output(k, w, l, &load)) {
        latch(k, w, FAULT_OPEN, volts);
    } else if (shorted(k, w, l, &load)) {
        latch(k, w, FAULT_SHORT, volts);
    } else if (l->begun - w->charging >= load.hold) {
        uint16_t leakage_dua = leakage(w, l);
        if (leaks(k, w, l, leakage_dua))
            latch(k, w, FAULT_LEAK, leakage_dua);
    }
}

static void sooner(uint32_t tick, uint32_t now, uint32_t *due)
{
    if (before(now, tick) && before(tick, *due))
        *due = tick;
}

/* When to look next. */
static uint32_t plan(const struct brake *k, const struct wave *w, uint32_t now)
{
    uint32_t quarter = load_of(k, w).ramp / 4;
    if (quarter > w->half / 4)
        quarter = w->half / 4;
    if (w->phase != WAVE_CHARGING)
        return w->next + quarter;
    uint32_t last = last_look(w);
    if (!before(now, last) || !chosen(&k->guards, w))
        return w->next + w->clamp + quarter;
    uint32_t due = last;
    sooner(now + LOOK_TICKS, now, &due);
    sooner(w->since + quarter, now, &due);
    sooner(w->since + w->half / 2, now, &due);
    return due;
}

void guards_start(struct brake *k)
{
    struct wave w;
    edges_look(k, &w);
    k->guards.reached = 0;
    k->guards.ramp = k->guards.held = k->guards.excess = k->guards.open = false;
    k->guards.negative = true; /* a wave begins positive */
    k->due = plan(k, &w, port_now(&k->board));
}

void guards_poll(struct brake *k)
{
    struct wave w;
    struct look l;
    edges_look(k, &w);
    if (w.phase == WAVE_CHARGING && chosen(&k->guards, &w) && take_look(k, &w, &l)) {
        judge(k, &w, &l);
        if (!k->board.armed)
            return;
    }
    edges_look(k, &w);
    if (w.phase != WAVE_OFF)
        k->due = plan(k, &w, port_now(&k->board));
}
