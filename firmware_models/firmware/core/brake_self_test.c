#include "brake_self_test.h"

#include "brake.h"
#include "port.h"

enum { SHORTED, FIRST_PULSE, SECOND_PULSE_CURRENT, SECOND_PULSE };

#define SHORT_TICKS TICKS_PER_MS /* empties what hangs there: 18 time constants of a nominal brake */
#define LEAD_TICKS 600u          /* from the decision to pulse until it begins: time to have both its edges ready */
#define AGAIN_TICKS 20u          /* until the pulse's end is looked for again */
#define FIRST_V 20u              /* what the first pulse makes of the minimum that counts as a brake */
#define TARGET (24u * LOW_COUNTS_PER_V)
#define GOOD (12u * LOW_COUNTS_PER_V)  /* enough for a quarter of a per cent: no second pulse */
#define LEFT (4u * LOW_COUNTS_PER_V)   /* a shorted output has no more */
#define CURRENT_MIN_TICKS 200u       /* a pulse that a conversion of the current fits in */
#define CURRENT_MIN_UA 100u          /* less is a broken sense */

static void start_output(struct brake *k, uint8_t output, uint32_t now)
{
    k->test.output = output;
    k->test.step = SHORTED;
    k->due = now + SHORT_TICKS;
}

void self_test_start(struct brake *k, uint32_t now)
{
    for (uint8_t output = 0; output < BRAKE_CHANNELS; output++)
        k->measured[output] = k->sensed[output] = k->leakage[output] = 0;
    start_output(k, 0, now);
    board_set_state(&k->board, STATE_SELF_TEST);
}

static void pulse(struct brake *k, uint8_t step, uint32_t ticks)
{
    uint32_t start = port_now(&k->board) + LEAD_TICKS;
    edges_test_pulse(k, start, ticks);
    k->test.step = step;
    k->test.ticks = (uint16_t)ticks;
    k->test.over = start + ticks;
    k->due = step == SECOND_PULSE_CURRENT ? start + ticks / 2 : k->test.over;
}

static uint16_t low(struct brake *k)
{
    return port_convert(&k->board, LOW_INPUT);
}

/* What the supply really gives, for C is in proportion to it. If the main loop comes too late, what is known stays. */
static void measure_current(struct brake *k)
{
    struct wave w;
    uint16_t current = port_convert(&k->board, CURRENT_INPUT);
    edges_look(k, &w);
    if (w.phase == TEST_CHARGING && current >= CURRENT_MIN_UA)
        k->supply_ua = current;
}

static void connect(struct brake *k)
{
    struct self_test *t = &k->test;
    edges_test_connect(k, (uint8_t)(1u << t->output));
    t->before = low(k);
    if (t->before > LEFT) {
        board_latch(&k->board, FAULT_SELF_TEST, t->output, t->before / LOW_COUNTS_PER_V);
        return;
    }
    uint32_t min_pf = k->nominal_pf / 10u + STRAY_PF;
    pulse(k, FIRST_PULSE, min_pf * (2 * FIRST_V) / SUPPLY_CURRENT_UA);
}

static void finish(struct brake *k)
{
    for (uint8_t output = 0; output < BRAKE_CHANNELS; output++) {
        if (k->measured[output]) {
            edges_rest(k);
            board_set_state(&k->board, STATE_ARMED);
            k->due = port_now(&k->board);
            return;
        }
    }
    board_latch(&k->board, FAULT_SELF_TEST, NO_CHANNEL, 0);
}

static void next_output(struct brake *k)
{
    uint32_t now = port_now(&k->board);
    edges_test_short(k, now);
    if (k->test.output + 1u < BRAKE_CHANNELS)
        start_output(k, (uint8_t)(k->test.output + 1u), now);
    else
        finish(k);
}

/* `counts` is what the pulse has lifted it by. */
static void judge(struct brake *k, uint16_t counts)
{
    struct self_test *t = &k->test;
    uint32_t charge = (uint32_t)k->supply_ua * t->ticks * (LOW_COUNTS_PER_V / 2); /* in pC, times counts a volt */
    uint32_t total_pf = counts ? charge / counts : UINT32_MAX;
    if (total_pf > UINT16_MAX) {
        board_latch(&k->board, FAULT_SHORT, t->output, 0); /* it has not risen */
        return;
    }
    uint16_t pf = total_pf > STRAY_PF ? (uint16_t)(total_pf - STRAY_PF) : 0;
    if (pf * UINT32_C(10) < k->nominal_pf)
        pf = 0;
    k->measured[t->output] = k->sensed[t->output] = pf;
    if (pf && pf * UINT32_C(2) < k->nominal_pf)
        board_latch(&k->board, FAULT_OPEN, t->output, pf);
    else if (pf * UINT32_C(2) > k->nominal_pf * UINT32_C(3))
        board_latch(&k->board, FAULT_SHORT, t->output, pf);
    else
        next_output(k);
}

static uint16_t lifted(const struct brake *k, uint16_t now)
{
    return now > k->test.before ? (uint16_t)(now - k->test.before) : 0;
}

static void after_first(struct brake *k)
{
    struct self_test *t = &k->test;
    uint16_t now = low(k);
    uint16_t counts = lifted(k, now);
    if (counts >= GOOD) {
        judge(k, counts);
        return;
    }
    uint32_t ticks = counts ? (uint32_t)t->ticks * (TARGET - now) / counts : NO_RISE_TICKS;
    if (ticks > NO_RISE_TICKS)
        ticks = NO_RISE_TICKS;
    t->before = now;
    pulse(k, ticks < CURRENT_MIN_TICKS ? SECOND_PULSE : SECOND_PULSE_CURRENT, ticks);
}

static bool pulse_over(struct brake *k)
{
    struct wave w;
    edges_look(k, &w);
    if (w.phase != TEST_HELD)
        k->due = port_now(&k->board) + AGAIN_TICKS;
    return w.phase == TEST_HELD;
}

void self_test_poll(struct brake *k)
{
    struct self_test *t = &k->test;
    switch (t->step) {
    case SHORTED:
        connect(k);
        break;
    case SECOND_PULSE_CURRENT:
        measure_current(k);
        t->step = SECOND_PULSE;
        k->due = t->over;
        break;
    case FIRST_PULSE:
        if (pulse_over(k))
            after_first(k);
        break;
    default:
        if (pulse_over(k))
            judge(k, lifted(k, low(k)));
    }
}
