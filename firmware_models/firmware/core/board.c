#include <string.h>

#include "board_impl.h"
#include "port.h"

/* From a sync_reply's time stamp to its first bit, where the CPU takes long to build a frame. Rather less than more:
 * what goes out later than it states only makes a host's bound on the clock wider. */
#ifndef ENCODING_TICKS
#define ENCODING_TICKS 0u
#endif

/* How far ahead a command's time must lie for a port to play it exactly then. */
#ifndef MIN_LEAD_TICKS
#define MIN_LEAD_TICKS 0u
#endif

#define NO_SUCH_MESSAGE 0xffu

/* Telemetry ends with these on both boards. */
#define FROM_END_LATE 4u
#define FROM_END_BAD_FRAMES 2u

#if AT_TACTILES_TELEMETRY_STATE != AT_BRAKE_TELEMETRY_STATE || \
    AT_TACTILES_TELEMETRY_FAULTS != AT_BRAKE_TELEMETRY_FAULTS || \
    TACTILES_TELEMETRY_SIZE - AT_TACTILES_TELEMETRY_LATE != FROM_END_LATE || \
    BRAKE_TELEMETRY_SIZE - AT_BRAKE_TELEMETRY_LATE != FROM_END_LATE || \
    TACTILES_TELEMETRY_SIZE - AT_TACTILES_TELEMETRY_BAD_FRAMES != FROM_END_BAD_FRAMES || \
    BRAKE_TELEMETRY_SIZE - AT_BRAKE_TELEMETRY_BAD_FRAMES != FROM_END_BAD_FRAMES || \
    TACTILES_TELEMETRY_SIZE < BRAKE_TELEMETRY_SIZE
#error "the telemetry of both boards is filled in by the same code"
#endif

static const uint8_t common_sizes[] = COMMON_SIZES;

static void send(struct board *b, uint8_t *frame, uint8_t type, uint8_t seq, uint8_t payload_size)
{
    port_transmit(b, frame, frame_finish(frame, type, seq, payload_size));
}

static bool looser(const struct board *b, uint8_t index, uint16_t limit)
{
    bool greater_is_stricter = b->kind->greater_is_stricter >> index & 1;
    return greater_is_stricter ? limit < b->limits[index] : limit > b->limits[index];
}

uint8_t board_rest(const struct board *b)
{
    return b->faults ? STATE_FAULT : STATE_DISARMED;
}

void board_set_state(struct board *b, uint8_t state)
{
    b->state = state;
    port_show(b, state, b->faults);
}

void board_start(struct board *b, const struct settings *settings, uint32_t boot_id, bool brown_out)
{
    b->boot_id = boot_id;
    b->faults = brown_out ? 1u << FAULT_BROWN_OUT : 0;
    for (uint8_t i = 0; i < LIMITS; i++) {
        b->limits[i] = b->kind->limits[i];
        if (!looser(b, i, settings->limits[i]))
            b->limits[i] = settings->limits[i];
    }
    b->kind->start(b, settings);
    board_set_state(b, board_rest(b));
}

/* Nothing energised any more; returns the state to rest in if nothing is latched. */
static uint8_t make_safe(struct board *b)
{
    b->armed = false;
    return b->kind->make_safe(b, port_now(b));
}

static void rest(struct board *b, uint8_t state)
{
    board_set_state(b, b->faults ? STATE_FAULT : state);
}

void board_make_safe(struct board *b)
{
    rest(b, make_safe(b));
}

void board_latch(struct board *b, uint8_t fault, uint8_t channel, uint16_t value)
{
    uint16_t bit = (uint16_t)(1u << fault);
    bool known = b->faults & bit;
    b->faults |= bit;
    board_make_safe(b);
    if (known)
        return;
    uint8_t frame[FRAME_SIZE(FAULT_SIZE)];
    uint8_t *payload = frame + FRAME_PAYLOAD;
    put_u32(payload + AT_FAULT_TIME, port_now(b));
    payload[AT_FAULT_CODE] = fault;
    payload[AT_FAULT_CHANNEL] = channel;
    put_u16(payload + AT_FAULT_VALUE, value);
    send(b, frame, MESSAGE_FAULT, 0, FAULT_SIZE);
}

bool board_ready(const struct board *b, uint16_t *detail)
{
    if (b->armed && b->state != STATE_SELF_TEST)
        return true;
    *detail = b->faults;
    return false;
}

uint8_t board_check_time(struct board *b, uint32_t time, uint16_t *detail)
{
    b->dealt = port_now(b);
    uint32_t soonest = b->dealt + MIN_LEAD_TICKS;
    uint32_t ahead = time - b->dealt;
    if (before(time, soonest)) {
        uint32_t lateness = ticks_until(b->dealt, time) / 32;
        *detail = lateness < UINT16_MAX ? (uint16_t)lateness : UINT16_MAX;
        b->late++;
        return STATUS_LATE;
    }
    return ahead > FAR_TICKS ? STATUS_FAR : STATUS_OK;
}

/* The dead-man, at tick `now`. A frame that comes too late finds the board safe already. */
static void check_dead_man(struct board *b, uint32_t now)
{
    uint32_t silence = now - b->heard;
    if (b->armed && !before(now, b->heard) && silence >= DEAD_MAN_TICKS)
        board_latch(b, FAULT_DEAD_MAN, NO_CHANNEL, (uint16_t)((uint16_t)(silence / 16) / (TICKS_PER_MS / 16)));
}

static uint8_t configure(struct board *b, const uint8_t *limits, uint16_t *detail)
{
    if (b->armed)
        return STATUS_INTERLOCK;
    for (uint8_t i = 0; i < LIMITS; i++) {
        if (looser(b, i, get_u16(limits + 2 * i))) {
            *detail = 0; /* the field */
            return STATUS_BAD_VALUE;
        }
    }
    for (uint8_t i = 0; i < LIMITS; i++)
        b->limits[i] = get_u16(limits + 2 * i);
    return STATUS_OK;
}

static uint8_t arm(struct board *b, uint32_t boot_id, uint16_t *detail)
{
    if (boot_id != b->boot_id) {
        *detail = 0; /* the field */
        return STATUS_BAD_VALUE;
    }
    if (b->armed)
        return STATUS_OK;
    if (b->faults) {
        *detail = b->faults;
        return STATUS_INTERLOCK;
    }
    uint8_t status = b->kind->arm(b, b->dealt, detail);
    b->armed = status == STATUS_OK;
    return status;
}

static uint8_t disarm(struct board *b, uint16_t *detail)
{
    uint8_t state = make_safe(b);
    for (uint8_t fault = 0; fault <= FAULT_BROWN_OUT; fault++) {
        uint16_t bit = (uint16_t)(1u << fault);
        if ((b->faults & bit) && b->kind->cause_gone(b, fault))
            b->faults &= (uint16_t)~bit;
    }
    rest(b, state);
    *detail = b->faults;
    return STATUS_OK;
}

static uint8_t stop(struct board *b, uint16_t *detail)
{
    board_make_safe(b);
    *detail = b->faults;
    return STATUS_OK;
}

static uint8_t carry_out(struct board *b, uint8_t type, const uint8_t *payload, uint16_t *detail)
{
    switch (type) {
    case MESSAGE_CONFIGURE:
        return configure(b, payload + AT_CONFIGURE_LIMITS, detail);
    case MESSAGE_ARM:
        return arm(b, get_u32(payload + AT_ARM_BOOT_ID), detail);
    case MESSAGE_DISARM:
        return disarm(b, detail);
    case MESSAGE_STOP:
        return stop(b, detail);
    default:
        return b->kind->command(b, type, payload, detail);
    }
}

static void identify(struct board *b, uint8_t seq)
{
    memset(b->replies, 0, sizeof b->replies);
    uint8_t frame[FRAME_SIZE(IDENTITY_SIZE)];
    uint8_t *payload = frame + FRAME_PAYLOAD;
    payload[AT_IDENTITY_PROTOCOL] = PROTOCOL_VERSION;
    payload[AT_IDENTITY_BOARD] = b->kind->number;
    payload[AT_IDENTITY_CHANNELS] = b->kind->channels;
    put_u32(payload + AT_IDENTITY_TICK_HZ, TICK_HZ);
    put_u32(payload + AT_IDENTITY_SCHEMA_HASH, SCHEMA_HASH);
    put_u32(payload + AT_IDENTITY_BOOT_ID, b->boot_id);
    memcpy(payload + AT_IDENTITY_BUILD, port_build, sizeof port_build);
    put_u16(payload + AT_IDENTITY_DEAD_MAN, DEAD_MAN_MS);
    for (uint8_t i = 0; i < LIMITS; i++)
        put_u16(payload + AT_IDENTITY_LIMITS + 2 * i, b->limits[i]);
    send(b, frame, MESSAGE_IDENTITY, seq, IDENTITY_SIZE);
    if (!b->identified)
        b->telemetry_due = b->dealt + TELEMETRY_TICKS;
    b->identified = true;
}

static void answer_sync(struct board *b, uint8_t seq, const uint8_t *token, uint32_t received)
{
    uint8_t frame[FRAME_SIZE(SYNC_REPLY_SIZE)];
    uint8_t *payload = frame + FRAME_PAYLOAD;
    memcpy(payload + AT_SYNC_REPLY_TOKEN, token, SYNC_SIZE);
    put_u32(payload + AT_SYNC_REPLY_RECEIVED, received);
    uint32_t free = port_uplink_free(b);
    uint32_t built = port_now(b) + ENCODING_TICKS;
    put_u32(payload + AT_SYNC_REPLY_SENT, before(built, free) ? free : built);
    send(b, frame, MESSAGE_SYNC_REPLY, seq, SYNC_REPLY_SIZE);
}

static void reply(struct board *b, const struct remembered *r)
{
    uint8_t frame[FRAME_SIZE(REPLY_SIZE)];
    uint8_t *payload = frame + FRAME_PAYLOAD;
    payload[AT_REPLY_STATUS] = r->status;
    put_u32(payload + AT_REPLY_TIME, r->time);
    put_u16(payload + AT_REPLY_DETAIL, r->detail);
    send(b, frame, MESSAGE_REPLY, r->seq, REPLY_SIZE);
}

/* The reply that is kept under this number, or none. */
static const struct remembered *kept(const struct board *b, uint8_t seq)
{
    for (uint8_t i = 0; seq && i < REMEMBERED_REPLIES; i++) {
        if (b->replies[i].seq == seq)
            return &b->replies[i];
    }
    return NULL;
}

/* A stop that came again is kept once. */
static void keep(struct board *b, const struct remembered *r)
{
    if (r->seq == 0)
        return;
    for (uint8_t i = 0; i < REMEMBERED_REPLIES; i++) {
        if (b->replies[i].seq == r->seq) {
            b->replies[i] = *r;
            return;
        }
    }
    b->replies[b->next_reply] = *r;
    b->next_reply = (uint8_t)((b->next_reply + 1u) % REMEMBERED_REPLIES);
}

static uint8_t size_of(const struct board *b, uint8_t type)
{
    if (type >= MESSAGE_IDENTIFY && type < sizeof common_sizes)
        return common_sizes[type];
    for (uint8_t i = 0; i < OWN_COMMANDS; i++) {
        if (b->kind->own[i].type == type)
            return b->kind->own[i].size;
    }
    return NO_SUCH_MESSAGE;
}

/* A frame whose checksum held. What is answered by `reply` is kept, refusals of unreadable messages too: they are
 * replies to numbered commands like any other, and a host that repeats one wants to hear the same again. */
static void handle(struct board *b, uint32_t arrived)
{
    const uint8_t *payload = b->deframer.body + 2;
    uint8_t type = b->deframer.body[0];
    uint8_t size = size_of(b, type);
    bool readable = size == deframer_payload_size(&b->deframer);
    struct remembered r = {.seq = b->deframer.body[1]};

    check_dead_man(b, arrived);
    if (readable)
        b->heard = arrived;
    b->dealt = port_now(b);
    if (readable && type == MESSAGE_IDENTIFY) {
        identify(b, r.seq);
        return;
    }
    const struct remembered *earlier = kept(b, r.seq);
    if (earlier && !(readable && type == MESSAGE_STOP)) {
        reply(b, earlier);
        return;
    }
    if (readable && type == MESSAGE_SYNC) {
        answer_sync(b, r.seq, payload + AT_SYNC_TOKEN, arrived);
        return;
    }
    if (readable && type == MESSAGE_KEEPALIVE)
        return;
    if (readable)
        r.status = carry_out(b, type, payload, &r.detail);
    else
        r.status = size == NO_SUCH_MESSAGE ? STATUS_UNKNOWN : STATUS_BAD_LENGTH;
    r.time = b->dealt;
    keep(b, &r);
    reply(b, &r);
}

void board_receive(struct board *b, uint8_t byte, uint32_t arrived)
{
    if (deframer_take(&b->deframer, byte))
        handle(b, arrived);
}

/* A frame begins no sooner than 5/2 of its own time after the one before: 40 % of the uplink. */
static void send_telemetry(struct board *b, uint32_t now)
{
    uint8_t frame[FRAME_SIZE(TACTILES_TELEMETRY_SIZE)];
    uint8_t *payload = frame + FRAME_PAYLOAD;
    put_u32(payload + AT_TACTILES_TELEMETRY_TIME, now);
    payload[AT_TACTILES_TELEMETRY_STATE] = b->state;
    put_u16(payload + AT_TACTILES_TELEMETRY_FAULTS, b->faults);
    put_u16(payload + b->kind->telemetry_size - FROM_END_LATE, b->late);
    put_u16(payload + b->kind->telemetry_size - FROM_END_BAD_FRAMES, b->deframer.bad_frames);
    b->kind->fill_telemetry(b, payload);
    uint32_t begun = port_now(b);
    send(b, frame, b->kind->telemetry, 0, b->kind->telemetry_size);
    uint32_t next = begun + (port_uplink_free(b) - begun) * 5 / 2;
    b->telemetry_due += TELEMETRY_TICKS;
    if (before(b->telemetry_due, next))
        b->telemetry_due = next;
}

void board_poll(struct board *b)
{
    uint32_t now = port_now(b);
    check_dead_man(b, now);
    b->kind->poll(b, now);
    if (!b->identified || before(now, b->telemetry_due))
        return;
    uint32_t free = port_uplink_free(b);
    if (before(now, free))
        b->telemetry_due = free; /* replies go first */
    else
        send_telemetry(b, now);
}

uint32_t board_idle_ticks(struct board *b)
{
    uint32_t now = port_now(b);
    uint32_t idle = b->kind->idle_ticks(b, now);
    if (b->armed) {
        uint32_t left = ticks_until(b->heard + DEAD_MAN_TICKS, now);
        idle = left < idle ? left : idle;
    }
    if (b->identified) {
        uint32_t left = ticks_until(b->telemetry_due, now);
        idle = left < idle ? left : idle;
    }
    return idle;
}

void board_edge(struct board *b, uint32_t due)
{
    b->kind->edge(b, due);
}
