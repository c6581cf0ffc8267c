#include "brake_wave.h"

#include "board_impl.h"

#define ENABLED (1u << 10)
#define POSITIVE (1u << 11)
#define NEGATIVE (1u << 12)
#define SETPOINT 16 /* bit */

#define HALF_PERIOD_TICKS (TICK_HZ * 5u) /* at 0.1 Hz */

void drive_shape(struct drive *d)
{
    d->half = HALF_PERIOD_TICKS / d->frequency;
    d->clamp = d->half < 10 * LONGEST_CLAMP_TICKS ? (uint16_t)(d->half / 10) : (uint16_t)LONGEST_CLAMP_TICKS;
}

static void set_amplitude(struct wave *w, uint16_t amplitude, uint32_t now)
{
    if (amplitude == w->amplitude)
        return;
    if (amplitude > w->amplitude)
        w->charging = now;
    if (w->ceiling < amplitude)
        w->ceiling = amplitude;
    w->amplitude = amplitude;
    w->changes++;
}

/* The first half period has half the length; the rounding of that half is owed. */
static void prepare_wave(struct wave *w, const struct drive *d)
{
    w->next = w->resting ? d->start : d->start + RESTART_TICKS;
    w->since = d->start;
    w->half = d->half;
    w->clamp = d->clamp;
    w->frequency = d->frequency;
    w->remainder = (uint16_t)(HALF_PERIOD_TICKS - d->half * d->frequency);
    w->carry = (uint16_t)(w->remainder + (d->half & 1 ? d->frequency : 0)) / 2;
    w->mask = d->mask;
    w->phase = WAVE_WAITING;
    w->longer = w->negative = w->resting = false;
    w->first = true;
    w->changes++;
}

void wave_take(struct wave *w, const struct drive *d)
{
    if (d->mask == 0 || d->amplitude == 0) {
        wave_stop(w, d->start);
        return;
    }
    if (w->phase == WAVE_OFF || w->mask != d->mask || w->frequency != d->frequency)
        prepare_wave(w, d);
    set_amplitude(w, d->amplitude, d->start);
    w->end = d->start + d->ttl * TICKS_PER_MS;
}

void wave_stop(struct wave *w, uint32_t now)
{
    if (w->phase == WAVE_OFF)
        return;
    w->phase = WAVE_OFF;
    w->since = now;
    w->changes++;
}

void wave_rest(struct wave *w)
{
    w->resting = true;
    w->amplitude = w->ceiling = 0;
}

/* A negative half period and the positive one after it have the same length, to the tick, so that the mean of the wave
 * is zero; what a half period has beyond whole ticks is carried, so that its mean length is exact. */
static void turn(struct wave *w)
{
    w->negative = !w->negative;
    if (w->negative) {
        w->carry += w->remainder;
        w->longer = w->carry >= w->frequency;
        if (w->longer)
            w->carry -= w->frequency;
    }
    w->ceiling = w->amplitude;
    w->first = false;
    w->since = w->charging = w->next;
    w->next += w->half + w->longer - w->clamp;
    w->phase = WAVE_CHARGING;
}

/* A drive ends; a pulse of the test has its end as an edge. */
static bool ends(const struct wave *w)
{
    return w->phase != WAVE_OFF && w->phase < TEST_HELD;
}

static bool over(const struct wave *w, uint32_t due)
{
    return ends(w) && !before(due, w->end);
}

static bool steps(const struct wave *w, uint32_t due)
{
    return w->phase != WAVE_OFF && w->phase != TEST_HELD && !before(due, w->next);
}

void wave_advance(struct wave *w, uint32_t due)
{
    if (over(w, due)) {
        wave_stop(w, w->end);
        return;
    }
    if (!steps(w, due))
        return;
    w->changes++;
    switch (w->phase) {
    case WAVE_WAITING:
        w->since = w->charging = w->next;
        w->next += w->half / 2;
        w->phase = WAVE_CHARGING;
        break;
    case WAVE_CHARGING:
        w->next += w->clamp;
        w->phase = WAVE_CLAMPED;
        break;
    case WAVE_CLAMPED:
        turn(w);
        break;
    case TEST_WAITING:
        w->next = w->end;
        w->phase = TEST_CHARGING;
        break;
    default:
        w->phase = TEST_HELD;
    }
}

bool wave_next(const struct wave *w, uint32_t *due)
{
    if (w->phase == WAVE_OFF || w->phase == TEST_HELD)
        return false;
    *due = ends(w) && before(w->end, w->next) ? w->end : w->next;
    return true;
}

static uint32_t word_in(const struct wave *w, uint8_t phase, bool negative)
{
    uint16_t low = w->mask;
    switch (phase) {
    case WAVE_CHARGING:
        low |= ENABLED | (negative ? NEGATIVE : POSITIVE);
        break;
    case WAVE_CLAMPED:
        low |= ENABLED;
        break;
    case TEST_HELD:
    case TEST_WAITING:
        low |= POSITIVE;
        break;
    case TEST_CHARGING:
        low |= ENABLED | POSITIVE;
        break;
    default:
        return 0;
    }
    return low | (uint32_t)w->amplitude << SETPOINT;
}

uint32_t wave_word(const struct wave *w)
{
    return word_in(w, w->phase, w->negative);
}

uint32_t wave_word_from(const struct wave *w, uint32_t due)
{
    static const uint8_t after[] = {
        [WAVE_OFF] = WAVE_OFF,           [WAVE_WAITING] = WAVE_CHARGING, [WAVE_CHARGING] = WAVE_CLAMPED,
        [WAVE_CLAMPED] = WAVE_CHARGING,  [TEST_HELD] = TEST_HELD,        [TEST_WAITING] = TEST_CHARGING,
        [TEST_CHARGING] = TEST_HELD,
    };
    if (over(w, due))
        return 0;
    if (!steps(w, due))
        return wave_word(w);
    return word_in(w, after[w->phase], w->phase == WAVE_CLAMPED ? !w->negative : w->negative);
}
