/* Frames: COBS(type, seq, payload, crc u16 LE) 0x00, CRC-16/X-25. Bytes in, frames out, and back. */
#ifndef FRAMING_H
#define FRAMING_H

#include <stdbool.h>
#include <stdint.h>

#include "protocol.h"

/* Takes bytes one by one; unstuffs and sums up as they come, and keeps only what a host's longest message has. */
struct deframer {
    uint8_t body[2 + LONGEST_HOST_PAYLOAD]; /* type, seq, payload; what is longer is cut off, its length is not */
    uint8_t count;                          /* unstuffed bytes so far, checksum included; stays at 255 */
    uint8_t left;                           /* bytes until the next code byte */
    bool begun;                             /* a byte has come since the last delimiter */
    uint16_t crc;
    uint16_t bad_frames;
};

/* True when `byte` ended a frame with a right checksum: its type, seq and payload are in `body`. */
bool deframer_take(struct deframer *d, uint8_t byte);

/* Payload bytes of that frame; may be more than `body` holds. Until the next byte. */
uint8_t deframer_payload_size(const struct deframer *d);

/* A frame to send is built in place: payload from FRAME_PAYLOAD on, in a buffer of FRAME_SIZE(payload bytes). */
#define FRAME_PAYLOAD 3u
#define FRAME_SIZE(payload) ((payload) + 6u)

/* Adds type, seq and checksum and stuffs. Returns how many bytes to send, delimiter included. */
uint8_t frame_finish(uint8_t *frame, uint8_t type, uint8_t seq, uint8_t payload_size);

static inline uint16_t get_u16(const uint8_t *at)
{
    return (uint16_t)(at[0] | (uint16_t)at[1] << 8);
}

static inline uint32_t get_u32(const uint8_t *at)
{
    return get_u16(at) | (uint32_t)get_u16(at + 2) << 16;
}

static inline void put_u16(uint8_t *at, uint16_t value)
{
    at[0] = (uint8_t)value;
    at[1] = (uint8_t)(value >> 8);
}

static inline void put_u32(uint8_t *at, uint32_t value)
{
    put_u16(at, (uint16_t)value);
    put_u16(at + 2, (uint16_t)(value >> 16));
}

#endif
