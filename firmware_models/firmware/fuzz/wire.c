#include "wire.h"

uint16_t u16_at(const uint8_t *p) { return (uint16_t)(p[0] | p[1] << 8); }

uint32_t u32_at(const uint8_t *p) { return (uint32_t)u16_at(p) | (uint32_t)u16_at(p + 2) << 16; }

/* Bit by bit. */
static uint16_t crc(const uint8_t *bytes, size_t count) {
    unsigned sum = 0xFFFF;
    while (count--) {
        sum ^= *bytes++;
        for (int bit = 0; bit < 8; bit++) sum = sum & 1 ? sum >> 1 ^ 0x8408 : sum >> 1;
    }
    return (uint16_t)(sum ^ 0xFFFF);
}

/* COBS, delimiter included; returns the length. */
static size_t stuff(const uint8_t *body, size_t count, uint8_t *out) {
    size_t code = 0, at = 1;
    for (size_t i = 0; i < count; i++) {
        if (body[i] == 0) {
            out[code] = (uint8_t)(at - code);
            code = at++;
        } else {
            out[at++] = body[i];
        }
    }
    out[code] = (uint8_t)(at - code);
    out[at++] = 0;
    return at;
}

size_t unstuff(const uint8_t *raw, size_t count, uint8_t *out) {
    size_t length = 0, at = 0;
    while (at < count) {
        const size_t code = raw[at++];
        if (code == 0 || at + code - 1 > count) return 0;
        for (size_t i = 1; i < code; i++) out[length++] = raw[at++];
        if (at < count) out[length++] = 0;
    }
    if (length < 4 || crc(out, length - 2) != u16_at(out + length - 2)) return 0;
    return length;
}

size_t frame(uint8_t type, uint8_t number, const uint8_t *payload, size_t count, uint8_t *out) {
    uint8_t body[LONGEST_FRAME];
    body[0] = type;
    body[1] = number;
    for (size_t i = 0; i < count; i++) body[2 + i] = payload[i];
    const uint16_t sum = crc(body, count + 2);
    body[count + 2] = (uint8_t)sum;
    body[count + 3] = (uint8_t)(sum >> 8);
    return stuff(body, count + 4, out);
}
