/* Start-up, main loop, and what of port.h is a line or two. */

#include <avr/interrupt.h>
#include <avr/io.h>
#include <avr/sleep.h>
#include <avr/wdt.h>

#include "../core/board.h"
#include "../core/port.h"
#include "clock.h"
#include "outputs.h"
#include "senses.h"
#include "store.h"
#include "uart.h"
#include "wiring.h"

#define BYTES_AT_A_TIME 64u    /* then the rest of the firmware has its turn */
#define LONGEST_REST 0x7000u   /* ticks */

static uint8_t reset_cause __attribute__((section(".noinit")));

/* Before anything else: after a reset by the watchdog it still runs, at its shortest. */
__attribute__((naked, used, section(".init3"))) void early(void);
void early(void)
{
    reset_cause = MCUSR;
    MCUSR = 0;
    wdt_disable();
}

uint32_t port_now(struct board *b)
{
    (void)b;
    return clock_now();
}

void port_show(struct board *b, uint8_t state, uint16_t faults)
{
    (void)b;
    GPIOR0 = state;
    GPIOR1 = (uint8_t)faults;
    GPIOR2 = (uint8_t)(faults >> 8);
}

/* Sleeps until an interrupt, unless there is something to do already. */
static void rest(struct board *b)
{
    uint32_t idle = board_idle_ticks(b);
    if (idle == 0)
        return;
    cli();
    uint32_t until = clock_now() + (idle < LONGEST_REST ? idle : LONGEST_REST);
    if (clock_wake_at(until) && !uart_waits()) {
        sleep_enable();
        sei(); /* an interrupt that waits comes behind the next instruction, and wakes it */
        sleep_cpu();
        sleep_disable();
    }
    sei();
}

int main(void)
{
    struct board *b = wiring_board();
    outputs_start(b);
    clock_start();
    uart_start();
    senses_start();
    struct settings settings;
    if (reset_cause & (_BV(PORF) | _BV(BORF)))
        store_forget_heat();
    store_settings(&settings);
    board_start(b, &settings, store_boot_id(), reset_cause & _BV(BORF));
    set_sleep_mode(SLEEP_MODE_IDLE);
    wdt_enable(WDTO_120MS);
    sei();
    for (;;) {
        wdt_reset();
        uint8_t byte;
        uint32_t arrived = 0;
        for (uint8_t i = 0; i < BYTES_AT_A_TIME && uart_take(&byte, &arrived); i++)
            board_receive(b, byte, arrived);
        board_poll(b);
        rest(b);
    }
}
