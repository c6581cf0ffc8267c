#include "brake.h"

#include <string.h>

#include "port.h"

#define ALL_OUTPUTS ((1u << BRAKE_CHANNELS) - 1u)
#define IDLE_TICKS (5 * TICKS_PER_MS)  /* between looks while armed and at rest */
#define EMPTYING_TICKS 500u            /* between looks at what discharges */

enum { LIMIT_VOLTS, LIMIT_CURRENT, LIMIT_FREQUENCY, LIMIT_TTL, LIMIT_CHARGE };

static struct brake *brake_of(struct board *b)
{
    return (struct brake *)b;
}

static uint8_t bad_value(uint16_t *detail, uint16_t field)
{
    *detail = field;
    return STATUS_BAD_VALUE;
}

static bool all_fitted(const struct brake *k, uint8_t mask)
{
    for (uint8_t output = 0; output < BRAKE_CHANNELS; output++) {
        if (mask >> output & 1 && k->measured[output] == 0)
            return false;
    }
    return !(mask & ~ALL_OUTPUTS);
}

static uint32_t charge_pc(const struct brake *k, const struct drive *d)
{
    uint32_t pf = 0;
    for (uint8_t output = 0; output < BRAKE_CHANNELS; output++) {
        if (d->mask >> output & 1)
            pf += k->measured[output];
    }
    return pf * d->amplitude;
}

/* A wave with volts: STATUS_OK, or which of its fields is wrong. */
static uint8_t check_drive(const struct brake *k, const struct drive *d, uint16_t *detail)
{
    const uint16_t *limits = k->board.limits;
    if (!all_fitted(k, d->mask))
        return bad_value(detail, 1);
    if (d->amplitude > limits[LIMIT_VOLTS])
        return bad_value(detail, 2);
    uint32_t charge = charge_pc(k, d);
    if (charge > UINT32_C(1000) * limits[LIMIT_CHARGE])
        return bad_value(detail, 2);
    /* I / (2 C V), in 0.1 Hz. */
    if (d->frequency < MIN_DHZ || d->frequency > limits[LIMIT_FREQUENCY] ||
        d->frequency > UINT32_C(5000000) * limits[LIMIT_CURRENT] / charge)
        return bad_value(detail, 3);
    if (d->ttl == 0 || d->ttl > limits[LIMIT_TTL])
        return bad_value(detail, 4);
    return STATUS_OK;
}

static uint8_t drive(struct brake *k, const uint8_t *payload, uint16_t *detail)
{
    struct drive d = {
        .start = get_u32(payload + AT_DRIVE_TIME),
        .mask = payload[AT_DRIVE_CHANNELS],
        .amplitude = get_u16(payload + AT_DRIVE_AMPLITUDE),
        .frequency = get_u16(payload + AT_DRIVE_FREQUENCY),
        .ttl = get_u16(payload + AT_DRIVE_TTL),
    };
    if (d.mask && d.amplitude) {
        uint8_t status = check_drive(k, &d, detail);
        if (status != STATUS_OK)
            return status;
        drive_shape(&d);
    }
    return edges_add_drive(k, &d, detail);
}

static uint8_t piezo(struct brake *k, const uint8_t *payload, uint16_t *detail)
{
    uint8_t channels = payload[AT_PIEZO_CHANNELS];
    uint16_t duration = get_u16(payload + AT_PIEZO_DURATION);
    if (channels == 0 || channels & ~ALL_OUTPUTS)
        return bad_value(detail, 1);
    if (duration == 0 || duration > k->board.limits[LIMIT_TTL])
        return bad_value(detail, 2);
    return edges_add_burst(k, get_u32(payload + AT_PIEZO_TIME), channels, duration, detail);
}

static uint8_t command(struct board *b, uint8_t type, const uint8_t *payload, uint16_t *detail)
{
    if (!board_ready(b, detail))
        return STATUS_INTERLOCK;
    if (type == MESSAGE_DRIVE)
        return drive(brake_of(b), payload, detail);
    if (type == MESSAGE_PIEZO)
        return piezo(brake_of(b), payload, detail);
    return STATUS_UNKNOWN;
}

static uint8_t arm(struct board *b, uint32_t now, uint16_t *detail)
{
    (void)detail;
    if (!port_interlock_closed(b) || touchable(brake_of(b)))
        return STATUS_INTERLOCK;
    self_test_start(brake_of(b), now);
    return STATUS_OK;
}

static uint8_t make_safe(struct board *b, uint32_t now)
{
    struct brake *k = brake_of(b);
    uint8_t worst;
    edges_clear(k, now);
    k->due = now + EMPTYING_TICKS;
    if (outputs_empty(k, &worst) && edges_rest(k))
        return STATE_DISARMED;
    return STATE_DISCHARGING;
}

/* What only a self test can find is left to the next one. */
static bool cause_gone(struct board *b, uint8_t fault)
{
    uint8_t worst;
    return (fault != FAULT_OVER_VOLTAGE && fault != FAULT_BRIDGE_STUCK) || outputs_empty(brake_of(b), &worst);
}

static void start(struct board *b, const struct settings *settings)
{
    struct brake *k = brake_of(b);
    k->nominal_pf = settings->nominal_pf;
    k->supply_ua = SUPPLY_CURRENT_UA;
    make_safe(b, port_now(b));
}

/* All shorted: back to rest once empty; a fault if that does not come in time. */
static void empty(struct brake *k, const struct wave *w, uint32_t now)
{
    struct board *b = &k->board;
    uint8_t worst;
    if (b->armed && b->state != STATE_DISCHARGING)
        board_set_state(b, STATE_DISCHARGING);
    else if (before(now, k->due))
        return;
    k->due = now + EMPTYING_TICKS;
    if (outputs_empty(k, &worst)) {
        if (edges_rest(k))
            board_set_state(b, b->armed ? STATE_ARMED : board_rest(b));
    } else if (!before(now, w->since + DISCHARGE_TICKS) && !(b->faults & 1u << FAULT_BRIDGE_STUCK)) {
        board_latch(b, FAULT_BRIDGE_STUCK, worst, output_volts(k, worst));
    }
}

/* Armed, nothing driven: then nothing may be charged. */
static void look_at_rest(struct brake *k, uint32_t now)
{
    uint8_t worst;
    k->due = now + IDLE_TICKS;
    if (!outputs_empty(k, &worst))
        board_latch(&k->board, FAULT_OVER_VOLTAGE, worst, output_volts(k, worst));
}

/* What the wave, which moves on by itself, makes of the state of an armed board. */
static uint8_t state_by(const struct wave *w)
{
    if (w->phase != WAVE_OFF)
        return STATE_DRIVING;
    return w->resting ? STATE_ARMED : STATE_DISCHARGING;
}

static void poll(struct board *b, uint32_t now)
{
    struct brake *k = brake_of(b);
    if (b->armed && !port_interlock_closed(b)) {
        board_make_safe(b);
        return;
    }
    if (b->state == STATE_SELF_TEST) {
        if (!before(now, k->due))
            self_test_poll(k);
        return;
    }
    struct wave w;
    edges_look(k, &w);
    if (w.phase == WAVE_OFF && !w.resting) {
        empty(k, &w, now);
    } else if (b->armed && b->state != state_by(&w)) {
        board_set_state(b, state_by(&w));
        if (w.phase == WAVE_OFF)
            k->due = now + IDLE_TICKS;
        else
            guards_start(k);
    } else if (b->armed && !before(now, k->due)) {
        if (w.phase == WAVE_OFF)
            look_at_rest(k, now);
        else
            guards_poll(k);
    }
}

static uint32_t idle_ticks(struct board *b, uint32_t now)
{
    struct brake *k = brake_of(b);
    struct wave w;
    edges_look(k, &w);
    if (b->armed && b->state != STATE_SELF_TEST && b->state != state_by(&w))
        return 0;
    return b->armed || !w.resting ? ticks_until(k->due, now) : FOREVER;
}

static void fill_telemetry(struct board *b, uint8_t *payload)
{
    struct brake *k = brake_of(b);
    struct wave w;
    edges_look(k, &w);
    for (uint8_t output = 0; output < BRAKE_CHANNELS; output++) {
        uint16_t volts = output_volts(k, output);
        bool on = w.phase != WAVE_OFF && w.mask >> output & 1;
        if (on && volts < k->guards.reached)
            volts = k->guards.reached;
        put_u16(payload + AT_BRAKE_TELEMETRY_OUTPUT + 2 * output, volts);
        put_u16(payload + AT_BRAKE_TELEMETRY_CAPACITANCE + 2 * output, k->sensed[output]);
        put_u16(payload + AT_BRAKE_TELEMETRY_LEAKAGE + 2 * output, k->leakage[output]);
    }
    put_u16(payload + AT_BRAKE_TELEMETRY_BUS, (uint16_t)(port_convert(b, BUS_INPUT) * V_PER_COUNT));
    put_u16(payload + AT_BRAKE_TELEMETRY_SUPPLY_CURRENT, port_convert(b, CURRENT_INPUT));
    put_u16(payload + AT_BRAKE_TELEMETRY_QUEUED, edges_queued(k));
}

static const struct board_kind brake_kind = {
    .number = BOARD_BRAKE,
    .channels = BRAKE_CHANNELS,
    .telemetry = MESSAGE_BRAKE_TELEMETRY,
    .telemetry_size = BRAKE_TELEMETRY_SIZE,
    .greater_is_stricter = 0,
    .limits = {MAX_V, SUPPLY_CURRENT_UA, MAX_DHZ, LONGEST_TTL_MS, STORED_CHARGE_NC},
    .own = BRAKE_COMMANDS,
    .start = start,
    .arm = arm,
    .make_safe = make_safe,
    .cause_gone = cause_gone,
    .command = command,
    .edge = edges_made,
    .poll = poll,
    .idle_ticks = idle_ticks,
    .fill_telemetry = fill_telemetry,
};

void brake_init(struct brake *k)
{
    memset(k, 0, sizeof *k);
    k->board.kind = &brake_kind;
}
