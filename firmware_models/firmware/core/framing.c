#include "framing.h"

#define CHECKSUM_SIZE 2u
#define MIN_COUNT (2u + CHECKSUM_SIZE)
#define MAX_COUNT (MIN_COUNT + MAX_PAYLOAD)
#define CRC_START 0xffffu
#define CRC_OF_WHOLE 0xf0b8u /* what is left after a frame and its own checksum */

/* CRC-16/X-25 of one more byte, without its final XOR: the eight steps of the reflected 0x1021 at once. */
static uint16_t crc_add(uint16_t crc, uint8_t byte)
{
    uint8_t x = (uint8_t)(byte ^ crc);
    x = (uint8_t)(x ^ (x << 4));
    return (uint16_t)((crc >> 8) ^ ((uint16_t)x << 8) ^ ((uint16_t)x << 3) ^ (x >> 4));
}

static void unstuffed(struct deframer *d, uint8_t byte)
{
    d->crc = crc_add(d->crc, byte);
    if (d->count < sizeof d->body)
        d->body[d->count] = byte;
    if (d->count < UINT8_MAX)
        d->count++;
}

static bool whole(const struct deframer *d)
{
    return d->left == 0 && d->count >= MIN_COUNT && d->count <= MAX_COUNT && d->crc == CRC_OF_WHOLE;
}

bool deframer_take(struct deframer *d, uint8_t byte)
{
    if (byte == 0) {
        bool idle = !d->begun;
        d->begun = false;
        if (idle)
            return false;
        if (whole(d))
            return true;
        d->bad_frames++;
        return false;
    }
    if (!d->begun) {
        d->begun = true;
        d->count = 0;
        d->crc = CRC_START;
        d->left = (uint8_t)(byte - 1);
    } else if (d->left == 0) {
        unstuffed(d, 0); /* a code byte stands where a zero was */
        d->left = (uint8_t)(byte - 1);
    } else {
        unstuffed(d, byte);
        d->left--;
    }
    return false;
}

uint8_t deframer_payload_size(const struct deframer *d)
{
    return (uint8_t)(d->count - MIN_COUNT);
}

uint8_t frame_finish(uint8_t *frame, uint8_t type, uint8_t seq, uint8_t payload_size)
{
    uint8_t end = (uint8_t)(FRAME_PAYLOAD + payload_size);
    frame[1] = type;
    frame[2] = seq;
    uint16_t crc = CRC_START;
    for (uint8_t at = 1; at < end; at++)
        crc = crc_add(crc, frame[at]);
    put_u16(frame + end, (uint16_t)~crc);
    end = (uint8_t)(end + CHECKSUM_SIZE);

    uint8_t code = 0; /* each zero becomes the distance to the next one, the first distance stands in front */
    for (uint8_t at = 1; at < end; at++) {
        if (frame[at] == 0) {
            frame[code] = (uint8_t)(at - code);
            code = at;
        }
    }
    frame[code] = (uint8_t)(end - code);
    frame[end] = 0;
    return (uint8_t)(end + 1);
}
