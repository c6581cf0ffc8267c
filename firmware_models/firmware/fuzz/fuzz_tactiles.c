/* Coil board: a coil is on only from the tick a pulse that was taken names, in its direction, for its duration, once, not after
 * it was taken back, and for no longer, with what it was on before and has not cooled, than its account holds. A supply or a
 * current that is wrong must be noticed. */
#include <math.h>
#include <string.h>

#include "fuzz.h"
#include "permission.h"

enum { COILS = 15, KEPT = 64, WORST_MA = 3907, FEED = 1 << 15, ALL = 0x7FFF };
enum { LONGEST, COIL_CURRENT, QUEUE, MIN_SUPPLY, ON_TIME }; /* limits */
enum { SUPPLY_MV = 10, CURRENT_MA = 64, COIL_MA = 3600, NO_CURRENT_MA = 200 };
#define UNIT_TICKS 100u
#define LOOK_TICKS (3 * MS_TICKS)    /* a guard looks each millisecond */
#define EXCESS_TICKS (2 * MS_TICKS)
#define TAU_TICKS (102.0 * 2e6)

struct permit {
    uint32_t start, end;
    bool toward, waits;
    uint16_t account_ms; /* the limit under which it was taken */
};

static struct permit permits[COILS][KEPT]; /* the last ones for each coil, in a ring */
static unsigned count[COILS];
static uint32_t off_by[COILS];
static double on_time[COILS]; /* ticks, at its last change */
static uint32_t changed_at[COILS];
static uint16_t account_ms[COILS]; /* of the pulse that is on, or was last */
static uint32_t supply, extra; /* counts: of the supply, and of current that no coil draws */
static uint32_t low_since, excess_since, stray_since;

static void mend(void) {
    supply = 500;
    extra = 0;
}

static void revoked(void) { memset(permits, 0, sizeof permits); }

/* An account so small that a program can fill it. */
static void reset(struct input *in, struct settings *settings) {
    settings->limits[ON_TIME] = (uint16_t)(12 + take(in) % 40);
    revoked();
    for (int coil = 0; coil < COILS; coil++) {
        on_time[coil] = 0;
        changed_at[coil] = now;
    }
    memset(count, 0, sizeof count);
    low_since = excess_since = stray_since = now;
    mend();
}

/* One or two coils, often the same ones, and durations that are mostly allowed. */
static void shape(uint8_t type, uint8_t *payload, struct input *in) {
    const uint8_t how = take(in);
    (void)type;
    if (how < 16) return;
    const uint16_t channels = (uint16_t)(1u << (how & 64 ? how % 2 : how % COILS) | 1u << (how & 128 ? how % 2 : payload[4] % COILS));
    payload[4] = (uint8_t)channels, payload[5] = (uint8_t)(channels >> 8);
    if (how & 7) for (int coil = 0; coil < COILS; coil++) payload[8 + coil] = (uint8_t)(1 + payload[8 + coil] % 200);
}

static void granted(uint8_t type, const uint8_t *payload) {
    const uint32_t start = u32_at(payload);
    for (int coil = 0; coil < COILS; coil++) {
        if (type == 0x11) { /* what has begun goes on */
            for (int i = 0; u16_at(payload) >> coil & 1 && i < KEPT; i++) permits[coil][i].waits = false;
        } else if (u16_at(payload + 4) >> coil & 1) {
            const uint8_t duration = payload[8 + coil];
            REQUIRE(duration > 0 && duration <= allowed.limits[LONGEST]);
            REQUIRE(!earlier(start, now));
            permits[coil][count[coil]++ % KEPT] =
                (struct permit){start, start + duration * UNIT_TICKS, u16_at(payload + 6) >> coil & 1, true,
                                allowed.limits[ON_TIME]};
        }
    }
}

static struct permit *permit_for(int coil, bool toward) {
    for (int i = 0; i < KEPT; i++) {
        struct permit *p = &permits[coil][i];
        if (p->waits && p->start == now && p->toward == toward) return p;
    }
    return NULL;
}

/* A coil was on, or not, since its last change. */
static void carry(int coil, bool on) {
    const uint32_t passed = now - changed_at[coil];
    on_time[coil] = on_time[coil] * exp(passed / -TAU_TICKS) + (on ? passed : 0);
    changed_at[coil] = now;
    REQUIRE(!on || on_time[coil] <= account_ms[coil] * (MS_TICKS * 1.001));
}

static void outputs(uint32_t changed) {
    for (int coil = 0; coil < COILS; coil++) {
        const bool was = word >> coil & 1, is = changed >> coil & 1, toward = changed >> (16 + coil) & 1;
        if (is != was || now == off_by[coil]) carry(coil, was);
        if (is && (!was || now == off_by[coil])) {
            struct permit *p = permit_for(coil, toward);
            REQUIRE(p != NULL);
            p->waits = false;
            off_by[coil] = p->end;
            account_ms[coil] = p->account_ms;
        } else if (is) {
            REQUIRE(toward == (word >> (16 + coil) & 1));
        }
    }
    REQUIRE((changed & ALL) == 0 || changed & FEED);
}

static uint32_t current(uint32_t w) { return (uint32_t)__builtin_popcount(w & ALL) * COIL_MA / CURRENT_MA + (w & FEED ? extra : 0); }

static void check(uint32_t w) {
    for (int coil = 0; coil < COILS; coil++)
        if (w >> coil & 1) REQUIRE(earlier(now, off_by[coil]));
    REQUIRE(__builtin_popcount(w & ALL) * WORST_MA <= allowed.limits[COIL_CURRENT]);

    const uint32_t ma = current(w) * CURRENT_MA;
    if (!(w & FEED) || supply * SUPPLY_MV >= allowed.limits[MIN_SUPPLY]) low_since = now;
    if (!(w & FEED) || ma <= allowed.limits[COIL_CURRENT]) excess_since = now;
    if (!(w & FEED) || w & ALL || ma <= NO_CURRENT_MA) stray_since = now;
    REQUIRE(now - low_since < LOOK_TICKS);
    REQUIRE(now - excess_since < EXCESS_TICKS + LOOK_TICKS);
    REQUIRE(now - stray_since < allowed.limits[LONGEST] * UNIT_TICKS + EXCESS_TICKS + 2 * LOOK_TICKS);
}

static void disturb(struct input *in) {
    static const uint16_t supplies[] = {500, 500, 500, 450, 310, 299, 100, 0};
    static const uint8_t extras[] = {0, 0, 0, 2, 4, 30, 100, 220};
    const uint8_t what = take(in);
    supply = supplies[what & 7];
    extra = extras[what >> 3 & 7];
}

static uint32_t convert(uint32_t input) { return input == 0 ? supply : current(word); }

static bool fit(void) { return supply * SUPPLY_MV >= allowed.limits[MIN_SUPPLY]; }

static bool energised(uint32_t w) { return (w & (ALL | FEED)) != 0; }

int LLVMFuzzerTestOneInput(const uint8_t *bytes, size_t size);
int LLVMFuzzerTestOneInput(const uint8_t *bytes, size_t size) {
    static const uint8_t types[] = {0x01, 0x02, 0x03, 0x04, 0x04, 0x05, 0x06, 0x07, 0x10, 0x10, 0x10, 0x10, 0x10, 0x11};
    static const struct oracle tactiles = {
        .board = 1, .built = {200, 12000, 64, 3000, 2500}, .greater_is_stricter = 1 << MIN_SUPPLY,
        .types = types, .type_count = sizeof types,
        .reset = reset, .shape = shape, .disturb = disturb, .mend = mend, .fit = fit, .granted = granted, .revoked = revoked,
        .outputs = outputs, .check = check, .convert = convert, .energised = energised};
    play(&tactiles, bytes, size);
    return 0;
}
