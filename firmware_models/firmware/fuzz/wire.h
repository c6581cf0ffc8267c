/* The wire once more: checksum and stuffing from the protocol page, unlike the board's. */
#ifndef WIRE_H
#define WIRE_H

#include <stddef.h>
#include <stdint.h>

enum { LONGEST_FRAME = 70 };

uint16_t u16_at(const uint8_t *p);
uint32_t u32_at(const uint8_t *p);

/* A whole frame, delimiter included, into `out`; returns its length. */
size_t frame(uint8_t type, uint8_t number, const uint8_t *payload, size_t count, uint8_t *out);

/* Type, number, payload and checksum of a frame without its delimiter; 0 where it is none. */
size_t unstuff(const uint8_t *raw, size_t count, uint8_t *out);

#endif
