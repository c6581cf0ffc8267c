"""A glove on simulated boards in virtual time: touch, pulses, a brake, and what became of each.

Leave ``clock`` out and name real ports instead, and the same calls move real pins; then time passes by itself.
"""

import haptics

with haptics.open(tactiles="sim://tactiles", brake="sim://brake", clock="virtual") as glove:
    glove.arm()  # nothing is energised before this

    glove.contact("index_tip")  # the pin comes out and stays, without power
    glove.pulse("palm_index", count=10, rate_hz=50)
    volts = glove.brake("index", force_n=4.0, ttl_s=0.2)
    glove.advance(0.1)

    state = glove.state()
    print(f"pins out: {', '.join(state.pins_out)}")
    print(f"brake: asked for {volts:.0f} V, the board says {state.volts['index']} V")

    glove.release("index_tip")
    glove.advance(0.4)

    state = glove.state()
    print(f"later: pins out: {', '.join(state.pins_out) or 'none'}; brake at {state.volts['index']} V, its time to live is over")
    print(f"palm_index is {state.rise_k['palm_index']:.2f} K warmer, with {state.headroom_k['palm_index']:.2f} K to go")

    for result in glove.results():
        print(f"{result.site:11} {result.kind:8} {'played' if result.played else f'denied: {result.reason}'}")
