#include "lockstep.h"

#include <stdbool.h>
#include <stdlib.h>
#include <string.h>

#include <simavr/avr_adc.h>
#include <simavr/avr_eeprom.h>
#include <simavr/avr_ioport.h>
#include <simavr/avr_spi.h>
#include <simavr/avr_uart.h>
#include <simavr/sim_avr.h>
#include <simavr/sim_core.h>
#include <simavr/sim_cycle_timers.h>
#include <simavr/sim_hex.h>

#define HZ 16000000u
#define SUPPLY_MV 5000u
#define FULL_SCALE 1023u
#define BITS_PER_BYTE 10u
#define MIN_BYTE_CYCLES 320u /* 500 000 baud */
#define UNREAD_BYTES 2u        /* what the UART's receive buffer holds */
#define LONGEST_BATCH 1000000u /* cycles that simavr may run without a look at its timers */

/* Registers, in data space */
#define DDRB 0x24
#define PORTB 0x25
#define DDRD 0x2a
#define PORTD 0x2b
#define GPIOR0 0x3e
#define GPIOR1 0x4a
#define GPIOR2 0x4b
#define MCUSR 0x54
#define SPCR 0x4c
#define SPSR 0x4d
#define SPDR 0x4e
#define EICRA 0x69
#define TCCR1B 0x81
#define UCSR0A 0xc0
#define UBRR0L 0xc4
#define UBRR0H 0xc5
#define RAM 0x100
#define U2X0 1

/* Pins */
#define B_OFF 0x01
#define B_LATCH 0x02
#define B_SELECT 0x04
#define B_LID 0x10
#define B_PULLED_UP (B_OFF | B_LID | B_LATCH | B_SELECT)
#define D_POSITIVE 0x04
#define D_NEGATIVE 0x08
#define D_FEED 0x10
#define D_INPUT_SHIFT 5

enum { TACTILES = 1 };

struct arrival {
    uint64_t cycle;
    uint8_t byte;
};

struct lockstep {
    avr_t *avr;
    avr_uart_t *uart;
    avr_irq_t *uart_in, *adc_in, *port_b;
    struct lockstep_calls calls;
    void *user;
    uint32_t board;
    uint32_t word;       /* as last reported */
    uint32_t chain;      /* in the shift registers, bit 0 the last one shifted in */
    uint32_t latched;    /* at their outputs */
    uint16_t converter;  /* bits shifted in since its select fell */
    uint8_t bits;        /* how many, 16 at most */
    uint16_t given;      /* counts, in the converter's input register */
    uint16_t setpoint;   /* counts, at its output */
    uint8_t pins_b;      /* levels, for their edges */
    uint64_t line_free;  /* when what was transmitted is out */
    uint64_t clock_begun;
    uint32_t lost;
    struct arrival *arrivals; /* a queue: `first` to `last` - 1 */
    size_t first, last, room;
};

/* Outputs: pins and what hangs on them. */

static uint8_t pins(const struct lockstep *s, unsigned port, unsigned ddr, uint8_t pulled_up)
{
    uint8_t driven = s->avr->data[ddr];
    return (uint8_t)((s->avr->data[port] & driven) | (pulled_up & ~driven));
}

static uint32_t output_word(const struct lockstep *s)
{
    uint8_t d = pins(s, PORTD, DDRD, 0);
    uint32_t registers = s->pins_b & B_OFF ? 0 : s->latched;
    if (s->board == TACTILES)
        return (registers & ~(UINT32_C(1) << 15)) | (d & D_FEED ? UINT32_C(1) << 15 : 0);
    return (registers & 0x3ff) | (d & D_FEED ? 1u << 10 : 0) | (d & D_POSITIVE ? 1u << 11 : 0) |
           (d & D_NEGATIVE ? 1u << 12 : 0) | (uint32_t)(s->setpoint / 2) << 16;
}

/* MCP4921: bit 15 writes, 13 is gain 1, 12 is on. */
static uint16_t converted(uint16_t command)
{
    uint16_t counts = command & 0x0fff;
    if (!(command & 0x1000))
        return 0;
    if (command & 0x2000)
        return counts;
    return counts < 0x0800 ? (uint16_t)(2 * counts) : 0x0fff;
}

static void pins_moved(struct lockstep *s)
{
    uint8_t b = pins(s, PORTB, DDRB, B_PULLED_UP);
    uint8_t rose = (uint8_t)(b & ~s->pins_b), fell = (uint8_t)(s->pins_b & ~b);
    s->pins_b = b;
    if (rose & B_LATCH)
        s->latched = s->chain;
    if (fell & B_SELECT)
        s->bits = 0;
    if ((rose & B_SELECT) && s->bits == 16 && !(s->converter & 0x8000))
        s->given = converted(s->converter);
    if (!(b & B_LATCH)) {
        s->setpoint = s->given;
        return; /* reported as one with what the rising edge takes over */
    }
    uint32_t word = output_word(s);
    if (word != s->word) {
        s->word = word;
        s->calls.outputs(s->user, word, s->avr->cycle);
    }
}

static void on_pins(struct avr_irq_t *irq, uint32_t value, void *param)
{
    (void)irq, (void)value;
    pins_moved(param);
}

static void on_spi(struct avr_irq_t *irq, uint32_t value, void *param)
{
    struct lockstep *s = param;
    (void)irq;
    s->chain = s->chain << 8 | (value & 0xff);
    if (!(s->pins_b & B_SELECT) && s->bits < 16) {
        s->converter = (uint16_t)(s->converter << 8 | (value & 0xff));
        s->bits = (uint8_t)(s->bits + 8);
    }
}

/* simavr 1.6 lets every byte take 100 us; its own timer is set as the registers are. */
static void on_spi_begun(struct avr_t *avr, avr_io_addr_t addr, uint8_t value, void *param)
{
    static const uint8_t divider_bits[] = {2, 4, 6, 7};
    (void)addr, (void)value;
    unsigned bits = divider_bits[avr->data[SPCR] & 3u] - (avr->data[SPSR] & 1u);
    const avr_cycle_timer_slot_t *timer = avr->cycle_timers.timer;
    while (timer && timer->param != param)
        timer = timer->next;
    if (timer)
        avr_cycle_timer_register(avr, 8u << bits, timer->timer, param);
}

/* Senses. simavr wants millivolts, and makes of them counts, rounded down. */

static void on_conversion(struct avr_irq_t *irq, uint32_t value, void *param)
{
    struct lockstep *s = param;
    union {
        uint32_t value;
        avr_adc_mux_t mux;
    } trigger = {.value = value};
    (void)irq;
    uint32_t channel = trigger.mux.src, input = channel;
    if (s->board != TACTILES)
        input = channel ? channel + 4 : (uint32_t)s->avr->data[PORTD] >> D_INPUT_SHIFT;
    uint32_t count = s->calls.convert(s->user, input, s->avr->cycle);
    avr_raise_irq(s->adc_in + channel, (count * SUPPLY_MV + FULL_SCALE - 1) / FULL_SCALE);
}

static void on_clock(struct avr_t *avr, avr_io_addr_t addr, uint8_t value, void *param)
{
    struct lockstep *s = param;
    (void)addr, (void)value;
    s->clock_begun = avr->cycle;
}

/* The line. simavr counts a parity bit that is not there, and reports a byte as it is written; so its own bytes'
 * length is put right here, and when a byte is out is worked out here: the UART holds one byte besides the one on
 * the line. */

static uint32_t byte_cycles(const struct lockstep *s)
{
    const uint8_t *data = s->avr->data;
    uint32_t divisor = data[UBRR0L] + ((data[UBRR0H] & 0x0fu) << 8) + 1u;
    return divisor * (data[UCSR0A] >> U2X0 & 1 ? 8 : 16) * BITS_PER_BYTE;
}

static avr_cycle_count_t on_transmit_begun(struct avr_t *avr, avr_cycle_count_t when, void *param)
{
    struct lockstep *s = param;
    (void)avr, (void)when;
    s->uart->cycles_per_byte = byte_cycles(s);
    return 0;
}

static void on_transmit(struct avr_irq_t *irq, uint32_t value, void *param)
{
    struct lockstep *s = param;
    (void)irq;
    uint64_t now = s->avr->cycle, cycles = byte_cycles(s);
    s->uart->cycles_per_byte = cycles;
    if (s->line_free <= now) {
        s->line_free = now;
        /* this one goes on the line at once, and the UART can take the next */
        s->uart->cycles_per_byte = 2;
        avr_cycle_timer_register(s->avr, 1, on_transmit_begun, s);
    }
    s->line_free += cycles;
    s->calls.transmit(s->user, value & 0xff, s->line_free);
}

static avr_cycle_count_t on_arrival(struct avr_t *avr, avr_cycle_count_t when, void *param)
{
    struct lockstep *s = param;
    (void)avr, (void)when;
    const struct arrival *a = &s->arrivals[s->first++];
    avr_cycle_count_t usual = s->uart->cycles_per_byte;
    unsigned unread = (s->uart->input.write - s->uart->input.read) % 64u;
    if (unread >= UNREAD_BYTES) {
        s->lost++;
    } else {
        s->uart->cycles_per_byte = 1; /* it has been on the line already */
        avr_raise_irq(s->uart_in, a->byte);
        s->uart->cycles_per_byte = usual;
    }
    if (s->first < s->last)
        return s->arrivals[s->first].cycle;
    s->first = s->last = 0;
    return 0;
}

static void expect_arrival(struct lockstep *s)
{
    if (s->first < s->last)
        avr_cycle_timer_register(s->avr, s->arrivals[s->first].cycle - s->avr->cycle, on_arrival, s);
}

int lockstep_feed(void *sim, const uint8_t *bytes, const uint64_t *ends, uint32_t count)
{
    struct lockstep *s = sim;
    bool idle = s->first == s->last;
    if (s->last + count > s->room) {
        size_t room = 2 * (s->last + count);
        struct arrival *grown = realloc(s->arrivals, room * sizeof *grown);
        if (!grown)
            return 0;
        s->arrivals = grown;
        s->room = room;
    }
    for (uint32_t i = 0; i < count; i++)
        s->arrivals[s->last++] = (struct arrival){ends[i], bytes[i]};
    if (idle)
        expect_arrival(s);
    return 1;
}

/* The chip. */

static void quiet(avr_t *avr, const int level, const char *format, va_list arguments)
{
    (void)avr, (void)level, (void)format, (void)arguments;
}

/* After simavr's own reset, which takes all timers away. */
static void begin(struct lockstep *s, uint8_t cause)
{
    s->avr->data[MCUSR] = cause;
    s->avr->data[EICRA] = 0x0a; /* falling edges: for levels simavr looks at PD2 and PD3 in every cycle, asked or not */
    s->avr->run_cycle_limit = LONGEST_BATCH;
    expect_arrival(s);
    pins_moved(s);
}

void lockstep_reset(void *sim, uint32_t cause)
{
    struct lockstep *s = sim;
    avr_reset(s->avr);
    if (cause != LOCKSTEP_EXTERNAL) {
        s->chain = s->latched = 0;
        s->given = s->setpoint = 0;
    }
    s->line_free = s->avr->cycle;
    begin(s, (uint8_t)cause);
}

static void watchdog_fires(struct lockstep *s)
{
    s->calls.watchdog(s->user, s->avr->cycle);
    s->avr->run(s->avr); /* resets it */
    begin(s, s->avr->data[MCUSR]);
}

static avr_io_t *module(avr_t *avr, const char *kind)
{
    avr_io_t *io = avr->io_port;
    while (io && strcmp(io->kind, kind) != 0)
        io = io->next;
    return io;
}

/* Every write is reported, not only those that change something since the last reset but one. */
static void watch(struct lockstep *s, uint32_t port, int index)
{
    avr_irq_t *irq = avr_io_getirq(s->avr, port, index);
    irq->flags &= (uint8_t)~IRQ_FLAG_FILTERED;
    avr_irq_register_notify(irq, on_pins, s);
}

static bool wire(struct lockstep *s)
{
    static const uint32_t ports[] = {AVR_IOCTL_IOPORT_GETIRQ('B'), AVR_IOCTL_IOPORT_GETIRQ('D')};
    avr_t *avr = s->avr;
    uint32_t flags = 0; /* nothing of the line on the terminal, and no sleep in real time */
    s->uart = (avr_uart_t *)module(avr, "uart");
    avr_io_t *spi = module(avr, "spi");
    if (!s->uart || !spi)
        return false;
    avr_ioctl(avr, AVR_IOCTL_UART_SET_FLAGS('0'), &flags);
    s->uart_in = avr_io_getirq(avr, AVR_IOCTL_UART_GETIRQ('0'), UART_IRQ_INPUT);
    s->adc_in = avr_io_getirq(avr, AVR_IOCTL_ADC_GETIRQ, ADC_IRQ_ADC0);
    s->port_b = avr_io_getirq(avr, AVR_IOCTL_IOPORT_GETIRQ('B'), IOPORT_IRQ_PIN0);
    avr_irq_register_notify(avr_io_getirq(avr, AVR_IOCTL_UART_GETIRQ('0'), UART_IRQ_OUTPUT), on_transmit, s);
    avr_irq_register_notify(avr_io_getirq(avr, AVR_IOCTL_SPI_GETIRQ(0), SPI_IRQ_OUTPUT), on_spi, s);
    avr_irq_register_notify(avr_io_getirq(avr, AVR_IOCTL_ADC_GETIRQ, ADC_IRQ_OUT_TRIGGER), on_conversion, s);
    avr_register_io_write(avr, TCCR1B, on_clock, s);
    avr_register_io_write(avr, SPDR, on_spi_begun, spi);
    for (unsigned i = 0; i < 2; i++) {
        watch(s, ports[i], IOPORT_IRQ_REG_PORT);
        watch(s, ports[i], IOPORT_IRQ_DIRECTION_ALL);
    }
    return true;
}

static bool load(avr_t *avr, const char *hex)
{
    uint32_t size = 0, start = 0;
    uint8_t *code = read_ihex_file(hex, &size, &start);
    if (!code)
        return false;
    avr_loadcode(avr, code, size, start);
    free(code);
    return true;
}

void *lockstep_new(uint32_t board, const char *hex, const struct lockstep_calls *calls, void *user)
{
    avr_global_logger_set(quiet);
    struct lockstep *s = calloc(1, sizeof *s);
    if (!s)
        return NULL;
    s->board = board;
    s->calls = *calls;
    s->user = user;
    s->pins_b = B_PULLED_UP;
    s->avr = avr_make_mcu_by_name("atmega328p");
    if (!s->avr) {
        free(s);
        return NULL;
    }
    avr_init(s->avr);
    s->avr->frequency = HZ;
    s->avr->vcc = s->avr->avcc = SUPPLY_MV; /* AREF is not connected */
    if (!wire(s) || !load(s->avr, hex)) {
        lockstep_free(s);
        return NULL;
    }
    lockstep_lid(s, 1);
    return s;
}

void lockstep_free(void *sim)
{
    struct lockstep *s = sim;
    avr_terminate(s->avr);
    free(s->avr);
    free(s->arrivals);
    free(s);
}

void lockstep_lid(void *sim, int closed)
{
    struct lockstep *s = sim;
    avr_ioport_external_t contact = {.name = 'B', .mask = B_LID, .value = closed ? 0 : B_LID};
    avr_ioctl(s->avr, AVR_IOCTL_IOPORT_SET_EXTERNAL('B'), &contact);
    avr_raise_irq(s->port_b + 4, !closed);
}

static avr_cycle_count_t on_stop(struct avr_t *avr, avr_cycle_count_t when, void *param)
{
    (void)avr, (void)when, (void)param;
    return 0;
}

/* Instructions up to the next timer, or sleep up to it. */
static void step(avr_t *avr, uint64_t until)
{
    avr_flashaddr_t pc = avr->pc;
    if (avr->state == cpu_Running)
        pc = avr_run_one(avr);
    avr_cycle_count_t idle = avr_cycle_timer_process(avr);
    avr->pc = pc;
    if (avr->state == cpu_Sleeping && avr->cycle < until)
        avr->cycle += idle < until - avr->cycle ? idle : until - avr->cycle;
    if (avr->interrupt_state)
        avr_service_interrupts(avr);
}

int lockstep_run(void *sim, uint64_t until)
{
    struct lockstep *s = sim;
    avr_t *avr = s->avr;
    bool alive = true, stops = false;
    while (alive && avr->cycle < until) {
        if (!stops) /* a timer, for what simavr runs at a time ends at the next timer and nowhere else */
            avr_cycle_timer_register(avr, until - avr->cycle, on_stop, s);
        step(avr, until);
        stops = avr->run == avr_callback_run_raw;
        if (!stops)
            watchdog_fires(s);
        alive = avr->state == cpu_Running || avr->state == cpu_Sleeping;
    }
    avr_cycle_timer_cancel(avr, on_stop, s);
    return alive;
}

uint64_t lockstep_cycle(void *sim)
{
    struct lockstep *s = sim;
    return s->avr->cycle;
}

uint64_t lockstep_next(void *sim)
{
    struct lockstep *s = sim;
    const avr_cycle_timer_slot_t *timer = s->avr->cycle_timers.timer;
    if (s->avr->state == cpu_Sleeping && !s->avr->interrupt_state && timer)
        return timer->when;
    return s->avr->cycle + MIN_BYTE_CYCLES;
}

uint64_t lockstep_clock_begun(void *sim)
{
    struct lockstep *s = sim;
    return s->clock_begun;
}

uint32_t lockstep_state(void *sim)
{
    struct lockstep *s = sim;
    return s->avr->data[GPIOR0];
}

uint32_t lockstep_faults(void *sim)
{
    struct lockstep *s = sim;
    return s->avr->data[GPIOR1] | (uint32_t)s->avr->data[GPIOR2] << 8;
}

uint32_t lockstep_lost(void *sim)
{
    struct lockstep *s = sim;
    return s->lost;
}

uint8_t *lockstep_eeprom(void *sim)
{
    struct lockstep *s = sim;
    avr_eeprom_t *eeprom = (avr_eeprom_t *)module(s->avr, "eeprom");
    return eeprom ? eeprom->eeprom : NULL;
}

uint8_t *lockstep_flash(void *sim)
{
    struct lockstep *s = sim;
    return s->avr->flash;
}

uint8_t *lockstep_ram(void *sim)
{
    struct lockstep *s = sim;
    return s->avr->data + RAM;
}

uint32_t lockstep_pc(void *sim)
{
    struct lockstep *s = sim;
    return s->avr->pc;
}
