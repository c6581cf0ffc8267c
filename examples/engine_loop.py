"""An engine's loop: OpenXR joints go in pose by pose, and a grasp is felt: a pin taps each finger, brakes hold them.

The tracker here is a recording and time is virtual. In an engine, open your own glove with ``haptics.open("glove.toml")``,
leave out ``advance`` (time passes by itself), and hand in each pose as it comes.
"""

import haptics

tracker = haptics.load_hand("synthetic")
scene = haptics.load_scene("playground").placed_for(tracker)  # its ball lies where this hand will close


def poses():
    """What hand tracking sends: seconds, and each joint's position (m) and orientation (x, y, z, w) by OpenXR's name."""
    for frame in tracker.frames("right"):
        names = (f"XR_HAND_JOINT_{name.upper()}_EXT" for name in haptics.JOINTS)
        yield frame.time_ns / 1e9, dict(zip(names, zip(frame.position_m, frame.orientation_xyzw, strict=True), strict=True))


with haptics.open(clock="virtual") as glove:
    session = haptics.Session(scene, glove)
    glove.arm()  # nothing is energised before this
    session.begin()
    start_ns, held, refused = glove.now_ns(), False, 0
    for seconds, joints in poses():
        glove.advance(max(0.0, seconds - (glove.now_ns() - start_ns) / 1e9))
        why = session.submit(haptics.HandFrame.from_joints(glove.now_ns(), "right", joints))
        refused += why is not None  # a reason in words: a joint that jumped, a clock that differs
        state = glove.state()
        if (state.volts["index"] or 0.0) > 900.0 and not held:
            print(f"{seconds:.2f} s: {state.volts['index']:.0f} V; the index brake holds {state.force_n['index']:.1f} N")
            held = True
    session.end()

for event in session.events:
    print(f"{(event.time_ns - start_ns) / 1e9:.2f} s: {event.kind} {event.subject} {event.object}")
taps = [result for result in session.results if result.kind == "contact"]
print(f"{sum(tap.played for tap in taps)} of {len(taps)} taps played; {refused} poses refused")
