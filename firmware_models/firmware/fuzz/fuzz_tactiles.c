/* Coil board: a coil is on only from the tick a valid pulse frame named, in its direction, for its duration, once; and
 * for no longer, with what it was on before and has not cooled, than its account holds. */
#include <math.h>
#include <string.h>

#include "fuzz.h"

enum { COILS = 15, KEPT = 64, WORST_MA = 3907, LIMIT_MA = 12000, FEED = 1 << 15, ACCOUNT_MS = 60 };

#define TAU_TICKS (102.0 * 2e6)
#define MOST_TICKS (ACCOUNT_MS * 2e3 * 1.001)

struct permit {
    uint32_t start, end;
    bool toward, played;
};

static struct permit permits[COILS][KEPT]; /* the last ones for each coil, in a ring */
static unsigned count[COILS];
static uint32_t word, off_by[COILS];
static double on_time[COILS]; /* ticks, at its last change */
static uint32_t changed_at[COILS];
static bool may_arm;

static void reset(void) {
    memset(permits, 0, sizeof permits);
    memset(count, 0, sizeof count);
    memset(on_time, 0, sizeof on_time);
    word = 0;
    may_arm = false;
}

static void heard(uint8_t type, const uint8_t *payload, uint32_t now) {
    (void)now;
    if (type == 0x04 && u32_at(payload) == BOOT_ID) may_arm = true;
    if (type != 0x10) return;
    const uint32_t start = u32_at(payload);
    for (int coil = 0; coil < COILS; coil++) {
        if (!(u16_at(payload + 4) >> coil & 1)) continue;
        const bool toward = u16_at(payload + 6) >> coil & 1;
        permits[coil][count[coil]++ % KEPT] = (struct permit){start, start + payload[8 + coil] * 100u, toward, false};
    }
}

static struct permit *permit_for(int coil, uint32_t now, bool toward) {
    for (int i = 0; i < KEPT; i++) {
        struct permit *p = &permits[coil][i];
        if (p->start == now && p->end != p->start && p->toward == toward && !p->played) return p;
    }
    return NULL;
}

/* A coil was on, or not, since its last change. */
static void carry(int coil, bool on, uint32_t now) {
    const uint32_t passed = now - changed_at[coil];
    on_time[coil] = on_time[coil] * exp(-passed / TAU_TICKS) + (on ? passed : 0);
    changed_at[coil] = now;
    REQUIRE(on_time[coil] <= MOST_TICKS);
}

static void outputs(uint32_t changed, uint32_t now) {
    int on = 0;
    for (int coil = 0; coil < COILS; coil++) {
        const bool was = word >> coil & 1, is = changed >> coil & 1, toward = changed >> (16 + coil) & 1;
        on += is;
        if (is != was || now == off_by[coil]) carry(coil, was, now);
        if (is && (!was || now == off_by[coil])) {
            struct permit *p = permit_for(coil, now, toward);
            REQUIRE(p != NULL);
            p->played = true;
            off_by[coil] = p->end;
        } else if (is) {
            REQUIRE((int32_t)(off_by[coil] - now) > 0);
            REQUIRE(toward == (word >> (16 + coil) & 1));
        }
    }
    REQUIRE(on * WORST_MA <= LIMIT_MA);
    REQUIRE(on == 0 || changed & FEED);
    REQUIRE(!(changed & FEED) || may_arm);
    word = changed;
}

static uint32_t convert(uint32_t input, uint32_t now) {
    (void)now;
    return input == 0 ? 500u : (uint32_t)__builtin_popcount(word & 0x7FFF) * 3600u / 64u;
}

static bool energised(uint32_t w) { return (w & 0xFFFF) != 0; }

int LLVMFuzzerTestOneInput(const uint8_t *bytes, size_t size);
int LLVMFuzzerTestOneInput(const uint8_t *bytes, size_t size) {
    static const uint8_t types[] = {0x01, 0x02, 0x03, 0x04, 0x04, 0x05, 0x06, 0x07, 0x10, 0x10, 0x10, 0x10, 0x10, 0x11};
    static const struct oracle tactiles = {
        1, {{200, LIMIT_MA, 64, 3000, ACCOUNT_MS}, 0}, types, sizeof types, reset, heard, outputs, convert, energised};
    play(&tactiles, bytes, size);
    return 0;
}
