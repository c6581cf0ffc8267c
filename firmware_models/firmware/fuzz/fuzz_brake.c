/* Brake controller: volts beyond the self test's only while the drive in force asks for them: on its outputs, up to its amplitude, as
 * far as its charge may go, turned round in time; vibration only while a burst asks for it. Hardware that breaks must be noticed. */
#include <string.h>

#include "fuzz.h"
#include "permission.h"

enum { OUTPUTS = 5, KEPT = 64, TEST_V = 40, OUTPUT_MASK = 0x1F, HV = 1 << 10, POSITIVE = 1 << 11, NEGATIVE = 1 << 12 };
enum { VOLTS, CURRENT, FREQUENCY, TTL, CHARGE }; /* limits */
enum { STRAY_PF = 200, MIN_DHZ = 5, SOUND_UA = 500 };
#define TEST_TICKS (30 * MS_TICKS)  /* five outputs, each shorted for 1 ms and charged twice */

struct drive {
    uint32_t start, end;
    uint16_t volts, dhz;
    uint8_t mask;
    bool may; /* volts at all */
};

struct burst {
    uint32_t start, end;
    uint8_t mask;
};

static struct drive drives[KEPT];
static struct burst bursts[KEPT];
static unsigned drive_count, burst_count;
static struct drive force;  /* the drive that was in force when last looked at */
static bool any_force;
static uint32_t ceiling;    /* V: what a lowered amplitude may still be until the next reversal */
static uint32_t turned_at, turned_from; /* when the polarity last changed, and which it has been since */
static uint32_t volts_since; /* since when high voltage is enabled without a break */

/* The circuit. Magnitudes, with the bridge's sign in `sign`. */
static double volts[OUTPUTS];
static int sign;
static uint32_t settled_at;
static uint16_t nominal_pf, pf[OUTPUTS], tested_pf[OUTPUTS];
static uint8_t wave_mask; /* of the drive last made up */
static uint16_t wave_dhz;
static int bare; /* the output without a brake; 5 or more: none */

/* What is broken about it. */
static double gain;        /* of the supply's volts */
static uint32_t excess_ua; /* more than it should give */
static bool stuck;         /* the bridge does not turn */
static uint32_t excess_since, high_since;

static void mend(void) {
    gain = 1;
    excess_ua = 0;
    stuck = false;
    for (int k = 0; k < OUTPUTS; k++) pf[k] = k == bare ? 0 : nominal_pf;
}

static void revoked(void) { drive_count = burst_count = any_force = 0; }

static void reset(struct input *in, struct settings *settings) {
    static const uint16_t nominals[] = {2547, 2547, 6000, 12000};
    const uint8_t circuit = take(in);
    nominal_pf = settings->nominal_pf = nominals[circuit & 3];
    bare = circuit >> 2 & 15;
    mend();
    revoked();
    memset(volts, 0, sizeof volts);
    sign = 1;
    settled_at = turned_at = volts_since = excess_since = high_since = now;
    ceiling = turned_from = 0;
    force = (struct drive){.may = false};
    wave_mask = 1, wave_dhz = 100;
}

static void shape(uint8_t type, uint8_t *payload, struct input *in) {
    const uint8_t how = take(in);
    if (how < 8) return;
    payload[4] &= OUTPUT_MASK;
    if (type == 0x21) {
        payload[6] &= 1; /* ms: at most 511 */
        return;
    }
    const uint16_t amplitude = u16_at(payload + 5) % (how & 4 ? 1600 : 700);
    if (how & 16) payload[4] = wave_mask; /* goes on with the wave of the one before */
    const uint16_t dhz = how & 16 ? wave_dhz : (uint16_t)(u16_at(payload + 7) % (how & 1 ? 40 : 250));
    wave_mask = payload[4], wave_dhz = dhz;
    const uint16_t ttl = u16_at(payload + 9) % (how & 2 ? 60 : 2100);
    payload[5] = (uint8_t)amplitude, payload[6] = (uint8_t)(amplitude >> 8);
    payload[7] = (uint8_t)dhz, payload[8] = (uint8_t)(dhz >> 8);
    payload[9] = (uint8_t)ttl, payload[10] = (uint8_t)(ttl >> 8);
}

static bool testing(void) { return allowed.armed && now - allowed.armed_at < TEST_TICKS; }

/* pC in the chosen outputs at `amplitude`, by what the self test found in them. */
static double charge_pc(uint8_t mask, double amplitude) {
    double total = 0;
    for (int k = 0; k < OUTPUTS; k++)
        if (mask >> k & 1) total += tested_pf[k];
    return total * amplitude;
}

/* As far as the oracle knows a drive may have volts; to 5 %, for the self test measures. */
static bool within_limits(const struct drive *d, uint16_t ttl) {
    const double charge = charge_pc(d->mask, d->volts);
    if (d->volts == 0 || d->mask == 0 || d->mask & ~OUTPUT_MASK) return false;
    for (int k = 0; k < OUTPUTS; k++)
        if (d->mask >> k & 1 && tested_pf[k] == 0) return false;
    return d->volts <= allowed.limits[VOLTS] && ttl > 0 && ttl <= allowed.limits[TTL] && d->dhz >= MIN_DHZ &&
           d->dhz <= allowed.limits[FREQUENCY] && charge <= 1050.0 * allowed.limits[CHARGE] &&
           d->dhz <= 1.05 * 5e6 * allowed.limits[CURRENT] / charge;
}

static void granted(uint8_t type, const uint8_t *payload) {
    const uint32_t start = u32_at(payload);
    REQUIRE(now - allowed.armed_at >= OUTPUTS * MS_TICKS); /* the self test shorts each output for 1 ms */
    REQUIRE(!earlier(start, now));
    if (type == 0x21) {
        REQUIRE(u16_at(payload + 5) <= allowed.limits[TTL]);
        bursts[burst_count++ % KEPT] = (struct burst){start, start + u16_at(payload + 5) * MS_TICKS, payload[4]};
        return;
    }
    const uint16_t ttl = u16_at(payload + 9);
    struct drive d = {start, start + ttl * MS_TICKS, u16_at(payload + 5), u16_at(payload + 7), payload[4], false};
    d.may = within_limits(&d, ttl);
    REQUIRE(d.may || d.volts == 0 || d.mask == 0);
    drives[drive_count++ % KEPT] = d;
}

/* Which drive is in force: of those whose tick has come the latest, and of equals the one that came last. */
static void follow(void) {
    const struct drive *latest = NULL;
    for (unsigned i = drive_count < KEPT ? 0 : drive_count - KEPT; i < drive_count; i++) {
        const struct drive *d = &drives[i % KEPT];
        if (!earlier(now, d->start) && (latest == NULL || !earlier(d->start, latest->start))) latest = d;
    }
    if (latest == NULL) return;
    const bool same_wave = any_force && latest->mask == force.mask && latest->dhz == force.dhz && word & HV;
    if (!same_wave || ceiling < latest->volts) ceiling = latest->volts;
    force = *latest;
    any_force = true;
}

/* Constant current into what hangs on the bridge, up to the setpoint; what hangs there without supply keeps its volts, all else
 * empties at once. */
static void settle(void) {
    const double seconds = (now - settled_at) / 2e6, setpoint = (word >> 16) * ((word >> 16) > TEST_V ? gain : 1);
    const uint32_t mask = word & OUTPUT_MASK;
    const bool connected = word & (POSITIVE | NEGATIVE), charging = connected && word & HV;
    double farads = STRAY_PF * 1e-12;
    for (int k = 0; k < OUTPUTS; k++) farads += mask >> k & 1 ? pf[k] * 1e-12 : 0;
    if (charging && !(stuck && (word >> 16) > TEST_V)) sign = word & POSITIVE ? 1 : -1;
    for (int k = 0; k < OUTPUTS; k++) {
        const double raised = volts[k] + SOUND_UA * 1e-6 * seconds / farads;
        if (!(mask >> k & 1) || !connected) volts[k] = 0;
        else if (charging) volts[k] = raised < setpoint ? raised : setpoint;
    }
    settled_at = now;
}

static void outputs(uint32_t changed) {
    const uint32_t polarity = changed & (POSITIVE | NEGATIVE);
    settle();
    REQUIRE(polarity != (POSITIVE | NEGATIVE));
    if (changed & HV && !(word & HV)) {
        volts_since = now;
        turned_from = 0;
    }
    if (polarity && polarity != turned_from) {
        follow();
        turned_from = polarity;
        turned_at = now;
        ceiling = force.volts;
    }
    word = changed;
    settle();
}

static void check_volts(uint32_t w) {
    const uint32_t mask = w & OUTPUT_MASK, setpoint = w >> 16;
    if (testing() && setpoint <= TEST_V && (mask & (mask - 1)) == 0) {
        for (int k = 0; k < OUTPUTS; k++) tested_pf[k] = pf[k];
        return;
    }
    REQUIRE(any_force && force.may);
    REQUIRE(earlier(now, force.end));
    REQUIRE(mask == force.mask);
    REQUIRE(setpoint <= ceiling);
    REQUIRE(now - turned_at <= 10000000u / force.dhz + 2);
}

/* How long a guard may take: it looks each 1.5 ms, but not in clamps nor in the first quarter of a ramp, and wants two looks. */
static uint32_t guard_ticks(void) {
    const double ramp = 2 * (charge_pc(force.mask, ceiling) + STRAY_PF * (double)ceiling) / SOUND_UA;
    const double half = 1e7 / (force.dhz ? force.dhz : 1);
    return (uint32_t)((ramp < half ? ramp : half) / 2) + 8 * MS_TICKS;
}

/* Hardware that stays broken for as long as a guard needs must be off. */
static void check_guards(uint32_t w) {
    const uint32_t patience = guard_ticks();
    double highest = 0;
    settle();
    for (int k = 0; k < OUTPUTS; k++) highest = volts[k] > highest ? volts[k] : highest;
    if (!(w & HV && w >> 16 > TEST_V && excess_ua)) excess_since = now;
    if (!(w & HV && highest > 1.1 * ceiling + 10)) high_since = now;
    REQUIRE(now - excess_since < patience || now - volts_since < patience);
    REQUIRE(now - high_since < patience);
}

static void check(uint32_t w) {
    follow();
    if (w & HV) check_volts(w);
    check_guards(w);
    for (int k = 0; k < OUTPUTS; k++) {
        bool wanted = false;
        if (!(w >> (5 + k) & 1)) continue;
        for (unsigned i = burst_count < KEPT ? 0 : burst_count - KEPT; i < burst_count; i++) {
            const struct burst *b = &bursts[i % KEPT];
            wanted |= b->mask >> k & 1 && !earlier(now, b->start) && earlier(now, b->end);
        }
        REQUIRE(wanted);
    }
}

/* Not while it is tested: what the test finds is what limits the charge. */
static void disturb(struct input *in) {
    const uint8_t what = take(in), value = take(in);
    settle();
    if (testing()) return;
    switch (what & 3) {
    case 0:
        pf[value % OUTPUTS] = (uint16_t)(pf[value % OUTPUTS] ? nominal_pf * (value & 0x80 ? 1u + (value & 0x7F) : 64u + (value & 0x3F)) / 80u : 0);
        break;
    case 1: gain = value & 3 ? 1.3 : 1; break;
    case 2: excess_ua = value & 3 ? 200 + value : 0; break;
    default: stuck = value & 1; break;
    }
}

static uint32_t counts(double value) { return value < 0 ? 0 : value > 1023 ? 1023 : (uint32_t)(value + 0.5); }

static uint32_t convert(uint32_t input) {
    double on_bridge = 0, highest = 0;
    settle();
    for (int k = 0; k < OUTPUTS; k++) {
        if (word >> k & 1) on_bridge = volts[k];
        if (volts[k] > highest) highest = volts[k];
    }
    if (input < OUTPUTS) return counts(volts[input] / 2);
    switch (input) {
    case 5: return counts(512 + sign * on_bridge / 4);
    case 6: return counts(on_bridge * 16);
    case 7: return counts(highest / 2);
    case 8: return word & HV && (word >> 16) > TEST_V && excess_ua ? counts(SOUND_UA + excess_ua)
                   : on_bridge > 0 && on_bridge < (word >> 16) ? SOUND_UA : 0;
    default: return counts((word & HV ? word >> 16 : 0) / 2.0);
    }
}

static bool fit(void) { return true; }

static bool energised(uint32_t w) { return (w & (HV | OUTPUT_MASK << 5)) != 0; }

int LLVMFuzzerTestOneInput(const uint8_t *bytes, size_t size);
int LLVMFuzzerTestOneInput(const uint8_t *bytes, size_t size) {
    static const uint8_t types[] = {0x01, 0x02, 0x03, 0x04, 0x04, 0x05, 0x06, 0x07, 0x20, 0x20, 0x20, 0x20, 0x20, 0x21, 0x21};
    static const struct oracle brake = {
        .board = 2, .built = {1500, 500, 10000, 2000, 45000}, .greater_is_stricter = 0, .has_lid = true,
        .types = types, .type_count = sizeof types,
        .reset = reset, .shape = shape, .disturb = disturb, .mend = mend, .fit = fit, .granted = granted, .revoked = revoked,
        .outputs = outputs, .check = check, .convert = convert, .energised = energised};
    play(&brake, bytes, size);
    return 0;
}
