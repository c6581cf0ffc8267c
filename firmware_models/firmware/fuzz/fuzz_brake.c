/* Brake controller: volts beyond the self test's only while a valid drive frame says so, on its outputs, up to its
 * amplitude. */
#include <string.h>

#include "fuzz.h"

enum { OUTPUTS = 5, KEPT = 256, TEST_V = 40, OUTPUT_MASK = 0x1F, HV = 1 << 10, POSITIVE = 1 << 11, NEGATIVE = 1 << 12 };

struct permit {
    uint32_t start, end, mask, volts;
};

static struct permit drives[KEPT], bursts[KEPT];
static unsigned drive_count, burst_count;
static uint32_t word, since;
static double volts[OUTPUTS]; /* magnitudes with the bridge's sign in `sign` */
static int sign;
static bool may_arm;

static void reset(void) {
    drive_count = burst_count = 0;
    memset(volts, 0, sizeof volts);
    word = 0;
    sign = 1;
    may_arm = false;
}

static void heard(uint8_t type, const uint8_t *payload, uint32_t now) {
    if (type == 0x04 && u32_at(payload) == BOOT_ID) may_arm = true;
    const uint32_t start = u32_at(payload);
    (void)now;
    if (type == 0x20)
        drives[drive_count++ % KEPT] =
            (struct permit){start, start + u16_at(payload + 9) * MS_TICKS, payload[4], u16_at(payload + 5)};
    if (type == 0x21)
        bursts[burst_count++ % KEPT] = (struct permit){start, start + u16_at(payload + 5) * MS_TICKS, payload[4], 0};
}

static bool permitted(const struct permit *permits, unsigned count, uint32_t mask, uint32_t volts_wanted, uint32_t now) {
    for (unsigned i = 0; i < count && i < KEPT; i++) {
        const struct permit *p = &permits[i];
        const bool in_time = (int32_t)(now - p->start) >= 0 && (int32_t)(p->end - now) > 0;
        if (in_time && (mask & ~p->mask) == 0 && volts_wanted <= p->volts) return true;
    }
    return mask == 0;
}

/* Constant current into what hangs on the bridge, up to the setpoint; everything else empties at once. */
static void settle(uint32_t now) {
    const double seconds = (now - since) / 2e6, setpoint = word >> 16;
    const uint32_t mask = word & OUTPUT_MASK;
    const bool charging = word & HV && word & (POSITIVE | NEGATIVE);
    const double farads = 0.2e-9 + 2.55e-9 * __builtin_popcount(mask);
    if (charging) sign = word & POSITIVE ? 1 : -1;
    for (int k = 0; k < OUTPUTS; k++) {
        if (!(mask >> k & 1) || !charging) volts[k] = 0;
        else volts[k] = volts[k] + 500e-6 * seconds / farads < setpoint ? volts[k] + 500e-6 * seconds / farads : setpoint;
    }
    since = now;
}

static void outputs(uint32_t changed, uint32_t now) {
    const uint32_t mask = changed & OUTPUT_MASK, piezos = changed >> 5 & OUTPUT_MASK, setpoint = changed >> 16;
    settle(now);
    REQUIRE((changed & (POSITIVE | NEGATIVE)) != (POSITIVE | NEGATIVE));
    if (changed & HV && mask && changed & (POSITIVE | NEGATIVE)) {
        REQUIRE(may_arm);
        if (setpoint > TEST_V) {
            REQUIRE(setpoint <= 1500);
            REQUIRE(permitted(drives, drive_count, mask, setpoint, now));
        }
    }
    /* A burst that is renewed may be the union of two. */
    for (int k = 0; k < OUTPUTS; k++) REQUIRE(permitted(bursts, burst_count, piezos & 1u << k, 0, now));
    word = changed;
    settle(now);
}

static uint32_t counts(double value) { return value < 0 ? 0 : value > 1023 ? 1023 : (uint32_t)(value + 0.5); }

static uint32_t convert(uint32_t input, uint32_t now) {
    double on_bridge = 0, highest = 0;
    settle(now);
    for (int k = 0; k < OUTPUTS; k++) {
        if (word >> k & 1) on_bridge = volts[k];
        if (volts[k] > highest) highest = volts[k];
    }
    if (input < OUTPUTS) return counts(volts[input] / 2);
    switch (input) {
    case 5: return counts(512 + sign * on_bridge / 4);
    case 6: return counts(on_bridge * 16);
    case 7: return counts(highest / 2);
    case 8: return on_bridge > 0 && on_bridge < (word >> 16) ? 500 : 0;
    default: return counts((word & HV ? word >> 16 : 0) / 2.0);
    }
}

static bool energised(uint32_t w) { return (w & (HV | OUTPUT_MASK << 5)) != 0; }

int LLVMFuzzerTestOneInput(const uint8_t *bytes, size_t size);
int LLVMFuzzerTestOneInput(const uint8_t *bytes, size_t size) {
    static const uint8_t types[] = {0x01, 0x02, 0x03, 0x04, 0x04, 0x05, 0x06, 0x07, 0x20, 0x20, 0x20, 0x20, 0x21, 0x21};
    static const struct oracle brake = {
        2, {{1500, 500, 10000, 2000}, 2547}, types, sizeof types, reset, heard, outputs, convert, energised};
    play(&brake, bytes, size);
    return 0;
}
