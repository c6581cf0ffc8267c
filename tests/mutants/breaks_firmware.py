"""Breaks of the C core, compiled anew for each: the same promises as the Python boards', kept by other code."""

from __future__ import annotations

from mutant import in_file

_CORE = "firmware_models/firmware/core"
_C_CORE = "tests/firmware_models/cores/test_c_core.py -k 'not minutes_or_hours'"
_C_COILS = "tests/firmware_models/cores/test_c_tactiles.py -k 'not counters_wrap'"
_C_BRAKE = (
    "tests/firmware_models/cores/test_c_brake_commands.py tests/firmware_models/cores/test_c_brake.py -k 'not exact_for_ever'"
)
_C_GUARDS = "tests/firmware_models/cores/test_c_brake_guards.py -k 'not trip_nothing and not trips_nothing and not slow'"
_C_SELF_TEST = "tests/firmware_models/cores/test_c_brake_self_test.py"

_ACCOUNT = "tests/firmware_models/boards/test_on_time_account.py -k 'not py] and not avr] and not avr-'"

FIRMWARE = [
    *in_file(
        f"{_CORE}/board.c",
        _C_CORE,
        (
            "C: arms with any boot id",
            "a host arms a board that rebooted behind its back",
            "if (boot_id != b->boot_id) {",
            "if (boot_id == 0) {",
        ),
        (
            "C: arms over a latched fault",
            "a short or a stuck driver is fed again",
            "    if (b->faults) {\n        *detail = b->faults;",
            "    if (b->faults == 0xffffu) {\n        *detail = b->faults;",
        ),
        (
            "C: waits for ever in silence",
            "volts stay after the host died",
            "silence >= DEAD_MAN_TICKS",
            "silence >= 5 * DEAD_MAN_TICKS",
        ),
        (
            "C: frames of a wrong length feed the dead-man",
            "a babbling line keeps a dead host alive",
            "    if (readable)\n        b->heard = arrived;",
            "    b->heard = arrived;",
        ),
        (
            "C: a late frame revives a board whose dead-man was due",
            "a host that was dead drives on as if nothing had been",
            "    check_dead_man(b, arrived);\n    if (readable)",
            "    if (readable)",
            "tests/firmware_models/cores/test_c_races.py -k main_loop",
        ),
        (
            "C: a latched fault does not make safe",
            "the fault is reported and the current flows on",
            "    b->faults |= bit;\n    board_make_safe(b);",
            "    b->faults |= bit;\n    rest(b, b->state);",
            f"{_C_CORE} {_C_COILS}",
        ),
        (
            "C: takes looser limits",
            "a host talks the board out of what it was built with",
            "return greater_is_stricter ? limit < b->limits[index] : limit > b->limits[index];",
            "return greater_is_stricter && limit == b->limits[index] + 1 && b->armed;",
        ),
        (
            "C: plays what came too late",
            "a touch is felt long after it was meant",
            "if (before(time, soonest)) {",
            "if (before(time, soonest - FAR_TICKS)) {",
            _C_COILS,
        ),
        (
            "C: takes times that lie far ahead",
            "a forgotten command plays minutes later",
            "return ahead > FAR_TICKS ? STATUS_FAR : STATUS_OK;",
            "return ahead > 100 * FAR_TICKS ? STATUS_FAR : STATUS_OK;",
            _C_COILS,
        ),
        (
            "C: carries out a repetition",
            "one lost reply, and the pulse is felt twice",
            "if (earlier && !(readable && type == MESSAGE_STOP)) {",
            "if (earlier && !readable) {",
        ),
        (
            "C: takes timed commands in the self test",
            "untested brakes are driven",
            "if (b->armed && b->state != STATE_SELF_TEST)",
            "if (b->armed)",
            _C_BRAKE,
        ),
        (
            "C: hides a brown-out",
            "a supply that breaks down looks like a sound one",
            "b->faults = brown_out ? 1u << FAULT_BROWN_OUT : 0;",
            "b->faults = brown_out ? 0u : 0;",
        ),
        (
            "C: disarm forgets faults whose cause is still there",
            "a board without its supply is armed again",
            "if ((b->faults & bit) && b->kind->cause_gone(b, fault))",
            "if (b->faults & bit)",
            _C_COILS,
        ),
    ),
    *in_file(
        f"{_CORE}/framing.c",
        _C_CORE,
        (
            "C: believes any checksum",
            "noise on the line becomes a command",
            "d->crc == CRC_OF_WHOLE",
            "(d->crc == CRC_OF_WHOLE || d->crc != 0)",
        ),
    ),
    *in_file(
        f"{_CORE}/tactiles.c",
        _C_COILS,
        (
            "C: lets one coil more than the current allows",
            "the supply sags and pins stay where they should not",
            "bool crowded = active + r->count > t->allowed_on;",
            "bool crowded = active + r->count > t->allowed_on + 1;",
        ),
        (
            "C: takes pulses of any length",
            "a coil burns through its wire",
            "if (duration == 0 || duration > b->limits[0]) {",
            "if (duration == 0) {",
        ),
        (
            "C: lets pulses of one coil overlap",
            "ten milliseconds become twenty",
            "taken &= r->channels;",
            "taken = 0;",
        ),
        (
            "C: keeps its queue when made safe",
            "pulses of before the stop play after it",
            "    line->head = NONE;\n    line->waiting = 0;",
            "    if (line->waiting) {\n        port_unlock(b, key);\n        return STATE_DISARMED;\n    }\n"
            "    line->head = NONE;\n    line->waiting = 0;",
        ),
        (
            "C: leaves its coils on when made safe",
            "a stop that leaves a coil on",
            "    port_apply(b, 0);\n    line->coils = line->toward_skin = 0;",
            "    line->coils = line->toward_skin = 0;",
        ),
        (
            "C: cancel forgets nothing",
            "what was taken back plays",
            "if (i != NONE && channels & coil_of(&line->pulses[i])) {",
            "if (i != NONE && channels & coil_of(&line->pulses[i]) && !line->prepared) {",
        ),
        (
            "C: arms without a coil supply",
            "the host believes in pins that cannot move",
            "    if (supply_mv(b) < b->limits[3]) {\n        *detail",
            "    if (supply_mv(b) == 0) {\n        *detail",
        ),
        (
            "C: does not watch the coils' supply",
            "pins half move, and nobody learns of it",
            "    if (supply < b->limits[3])",
            "    if (supply == 0)",
        ),
        (
            "C: does not watch the coils' current",
            "a shorted coil is fed on",
            "lasts(excess || current > b->limits[1],",
            "lasts(excess && current > b->limits[1],",
        ),
        (
            "C: does not find a driver that sticks",
            "one coil on for ever: 60 K a minute",
            "t->unasked_ticks >= b->limits[0] * DURATION_TICKS",
            "t->unasked_ticks / 1000 >= b->limits[0] * DURATION_TICKS",
        ),
    ),
    *in_file(
        f"{_CORE}/coil_heat.c",
        _ACCOUNT,
        (
            "C: takes pulses of a coil that was on for too long",
            "ten milliseconds every ten: 319 K in half a minute",
            "return heat->on_time + ((uint32_t)duration << 16) > heat_of_ms(limit_ms);",
            "return heat->on_time + ((uint32_t)duration << 16) > 2 * heat_of_ms(limit_ms);",
        ),
        (
            "C: accounts cool twice as fast as coils",
            "after a minute a coil is 40 K warm, and its account says 25",
            ">> HEAT_SHIFT;\n        set(",
            ">> (HEAT_SHIFT - 1u);\n        set(",
        ),
        (
            "C: gives back twice what did not play",
            "who asks and cancels may burn a coil",
            "set(heat, heat->on_time - ((uint32_t)durations << 16));",
            "set(heat, heat->on_time < (uint32_t)durations << 17 ? 0 : heat->on_time - ((uint32_t)durations << 17));",
        ),
        (
            "C: a loss of power hides a warm coil",
            "who pulls the plug may burn a coil again",
            "notes & NOTE_WARM ? limit_ms : ",
            "notes & NOTE_WARM ? (limit_ms ? WARM_MS : 0) : ",
        ),
        (
            "C: believes memory that lost its power",
            "a coil starts at whatever was left there",
            "if (heat[channel].check != check_of(heat[channel].on_time))",
            "if (heat[channel].on_time > heat_of_ms(limit_ms))",
        ),
    ),
    *in_file(
        f"{_CORE}/tactiles.c",
        _ACCOUNT,
        (
            "C: charges nothing for a driver that was stuck",
            "each arming warms the stuck coil anew",
            "        charge_ahead(t, t->unasked, now);",
            "        if (now == 0)\n            charge_ahead(t, t->unasked, now);",
        ),
        (
            "C: arms beyond its account",
            "a stuck driver is fed as often as it is armed",
            "    if (*detail)\n        return STATUS_HOT;\n    t->allowed_on",
            "    *detail = 0;\n    t->allowed_on",
        ),
        (
            "C: gives back what is playing when made safe",
            "who stops at the right moment may burn a coil",
            "        line->to_play[p->coil & CHANNEL] = (uint16_t)(line->to_play[p->coil & CHANNEL] - p->duration);\n"
            "        p->coil |= GONE;",
            "        p->coil |= GONE;",
        ),
    ),
    *in_file(
        f"{_CORE}/brake.c",
        _C_BRAKE,
        (
            "C: has no limit of its charge",
            "more than 45 uC stand behind a fingertip",
            "if (charge > UINT32_C(1000) * limits[LIMIT_CHARGE])",
            "if (charge == 0)",
        ),
        (
            "C: has no limit of its amplitude",
            "1501 V and more",
            "if (d->amplitude > limits[LIMIT_VOLTS])",
            "if (d->amplitude > 2 * limits[LIMIT_VOLTS])",
        ),
        (
            "C: reverses faster than its supply can charge",
            "the brake holds less than was asked, and nobody learns of it",
            "d->frequency > UINT32_C(5000000) * limits[LIMIT_CURRENT] / charge)",
            "d->frequency > UINT32_C(50000000) * limits[LIMIT_CURRENT] / charge)",
        ),
        (
            "C: drives for as long as it is asked to",
            "volts outlive a host that said 'for ever'",
            "if (d->ttl == 0 || d->ttl > limits[LIMIT_TTL])",
            "if (d->ttl == 0)",
        ),
        (
            "C: vibrates for as long as it is asked to",
            "a fingertip buzzes for a minute",
            "if (duration == 0 || duration > k->board.limits[LIMIT_TTL])",
            "if (duration == 0)",
        ),
        (
            "C: drives outputs without a brake",
            "volts on a bare connector",
            "if (mask >> output & 1 && k->measured[output] == 0)",
            "if (mask >> output & 1 && k->nominal_pf == 0)",
        ),
        (
            "C: arms with its lid open",
            "volts under a hand that is in the box",
            "if (!port_interlock_closed(b) || touchable(brake_of(b)))",
            "if (touchable(brake_of(b)))",
            _C_SELF_TEST,
        ),
        (
            "C: arms with volts left on it",
            "what has not discharged is driven again",
            "if (!port_interlock_closed(b) || touchable(brake_of(b)))",
            "if (!port_interlock_closed(b))",
            _C_SELF_TEST,
        ),
        (
            "C: an open lid does not disarm",
            "volts under a hand that is in the box",
            "if (b->armed && !port_interlock_closed(b)) {",
            "if (b->armed && !port_interlock_closed(b) && b->faults) {",
            _C_SELF_TEST,
        ),
        (
            "C: a lid that opens while nothing is driven leaves it armed",
            "the next command drives into an open box",
            "if (b->armed && !port_interlock_closed(b)) {",
            "if (b->state == STATE_DRIVING && !port_interlock_closed(b)) {",
            _C_SELF_TEST,
        ),
        (
            "C: does not notice that its outputs do not discharge",
            "volts stay where the host sees none",
            "board_latch(b, FAULT_BRIDGE_STUCK, worst, output_volts(k, worst));",
            "(void)output_volts(k, worst);",
        ),
        (
            "C: does not look at what is charged at rest",
            "an output charges though nobody drives it",
            "board_latch(&k->board, FAULT_OVER_VOLTAGE, worst, output_volts(k, worst));",
            "(void)output_volts(k, worst);",
        ),
    ),
    *in_file(
        f"{_CORE}/brake_edges.c",
        _C_BRAKE,
        (
            "C: leaves the bridge as it is when made safe",
            "a stop that leaves volts on",
            "    apply(k, 0);\n    if (e->wave.resting)",
            "    if (e->wave.resting)",
        ),
        (
            "C: keeps its drives when made safe",
            "volts come back after a stop",
            "    e->waiting = e->taken = 0;",
            "    e->taken = 0;",
        ),
        (
            "C: keeps its bursts when made safe",
            "a fingertip buzzes after a stop",
            "        e->bursts[i].channels = 0;\n        e->bursts[i].on = false;\n    }\n    e->piezos = 0;\n"
            "    e->any_burst = false;",
            "        e->bursts[i].on = false;\n    }\n    e->piezos = 0;",
        ),
    ),
    *in_file(
        f"{_CORE}/brake_wave.c",
        _C_BRAKE,
        (
            "C: a drive does not end with its time",
            "volts stay when the host has lost interest",
            "w->end = d->start + d->ttl * TICKS_PER_MS;",
            "w->end = d->start + (d->ttl + 20u) * TICKS_PER_MS;",
        ),
        (
            "C: a shorter drive does not shorten the one it replaces",
            "volts stay as long as the older command said",
            "    w->end = d->start + d->ttl * TICKS_PER_MS;",
            "    if (w->phase == WAVE_WAITING || before(w->end, d->start + d->ttl * TICKS_PER_MS))\n"
            "        w->end = d->start + d->ttl * TICKS_PER_MS;",
        ),
        (
            "C: begins another wave without shorting first",
            "an output that was let go of keeps its charge",
            "w->next = w->resting ? d->start : d->start + RESTART_TICKS;",
            "w->next = d->start;",
        ),
    ),
    *in_file(
        f"{_CORE}/brake_guards.c",
        _C_GUARDS,
        (
            "C: does not watch for too many volts",
            "the dielectric breaks",
            "return surely * UINT32_C(100) > w->ceiling * (UINT32_C(100) + OVER_VOLTAGE_PERCENT);",
            "return surely > w->ceiling * (UINT32_C(100) + OVER_VOLTAGE_PERCENT);",
        ),
        (
            "C: does not watch the supply's current",
            "a short is fed on",
            "bool excess = l->current > OVER_CURRENT_UA;",
            "bool excess = l->current > 2 * OVER_CURRENT_UA;",
        ),
        (
            "C: does not notice a bridge that stands still",
            "one polarity for ever charges the dielectric, and the brake never lets go",
            "l->volts <= -WRONG_SIGN_V;",
            "l->volts <= -100 * WRONG_SIGN_V;",
        ),
        (
            "C: does not watch for leaks",
            "current through skin",
            "return dropped || leakage_dua > 10 * LEAK_UA + 5;",
            "return dropped;",
        ),
        (
            "C: does not watch for sudden drops",
            "a spark is taken for a sound brake",
            "return dropped || leakage_dua > 10 * LEAK_UA + 5;",
            "return leakage_dua > 10 * LEAK_UA + (dropped ? 5 : 6);",
        ),
        (
            "C: does not notice that a brake is gone",
            "the hand is not held, and volts stand on an open wire",
            "    } else if (open_output(k, w, l, &load)) {",
            "    } else if (open_output(k, w, l, &load) && load.pf == 0) {",
        ),
    ),
    *in_file(
        f"{_CORE}/brake_self_test.c",
        _C_SELF_TEST,
        (
            "C: takes a torn brake for a sound one",
            "a brake that cannot hold is armed",
            "    if (pf && pf * UINT32_C(2) < k->nominal_pf)",
            "    if (pf && pf * UINT32_C(8) < k->nominal_pf)",
        ),
        (
            "C: takes an output that does not rise for a sound one",
            "a short is armed",
            "board_latch(&k->board, FAULT_SHORT, t->output, 0); /* it has not risen */",
            "next_output(k);",
        ),
    ),
]
