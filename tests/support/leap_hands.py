"""Frames of a Leap Motion controller, made up: what the tests of readers write into files."""

from __future__ import annotations


def a_hand(hand_id: int = 7, side: str = "right", shift_mm: float = 0.0) -> tuple[dict, list[dict]]:
    """A flat hand, palm down, fingers toward -Z, thumb on the inner side."""
    outward = 1.0 if side == "right" else -1.0
    hand = {
        "id": hand_id,
        "type": side,
        "palmPosition": [shift_mm, 200, 0],
        "palmNormal": [0, -1, 0],
        "direction": [0, 0, -1],
    }
    pointables = []
    for finger in range(5):
        x = shift_mm + outward * (20.0 * finger - 40.0)
        near = 50.0 if finger == 0 else -20.0
        points = {
            f"{part}Position": [x, 200, near - length] for part, length in (("mcp", 0), ("pip", 40), ("dip", 65), ("tip", 85))
        }
        pointables.append({"handId": hand_id, "type": finger, "tool": False, "width": 18.0, **points})
    return hand, pointables


def a_recording(times_us, hands=None) -> dict:
    """One frame a time; ``hands(index)`` gives the frame's hands, by default one that stands still."""
    frames = []
    for index, time_us in enumerate(times_us):
        pairs = [a_hand()] if hands is None else hands(index)
        frames.append(
            {
                "timestamp": time_us,
                "hands": [hand for hand, _ in pairs],
                "pointables": [pointable for _, own in pairs for pointable in own],
            }
        )
    return {"metadata": {"protocolVersion": 6}, "frames": frames}


def a_tap(count: int = 12, hands=None) -> dict:
    """A hand that sinks by 1 mm a frame, so that no two frames are alike; ``count`` frames at 100 Hz from 5 s on."""
    content = a_recording(range(5_000_000, 5_000_000 + 10_000 * count, 10_000), hands)
    for index, frame in enumerate(content["frames"]):
        for owner in (*frame["hands"], *frame["pointables"]):
            for key in owner:
                if key.endswith("Position"):
                    owner[key] = [owner[key][0], owner[key][1] - index, owner[key][2]]
    return content
