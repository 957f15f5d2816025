"""What was found in a scan: a speed of sound, motion."""

from oatkit.focus import Focus
from oatkit.motion import Motion


def focus_text(focus: Focus) -> str:
    """Return a speed of sound by focus as lines: the pick, what the scan says, what the other metrics pick."""
    rows = [
        ("speed of sound", f"{focus.speed_m_s:.1f} m/s by focus ({focus.metric})"),
        ("the scan says", f"{focus.header_m_s:.1f} m/s ({focus.header_source})"),
        ("tried", f"{len(focus.speeds_m_s)} speeds, {focus.speeds_m_s[0]:.0f} .. {focus.speeds_m_s[-1]:.0f} m/s"),
        *((name, f"{pick:.1f} m/s") for name, pick in focus.picks.items() if name != focus.metric),
    ]
    lines = [f"{name:<20}{value}" for name, value in rows]
    return "\n".join([*lines, *(f"note: {note}" for note in focus.notes)])


def motion_text(motion: Motion) -> str:
    """Return what moved as lines: how many pulses, each of them, and what else to know."""
    moved = motion.moved
    head = f"{int(moved.sum())} of {moved.size} pulses out of place, in {len(motion.frames)} of {len(moved)} frames"
    lines = [sentence for frame in motion.frames for sentence in motion.of_frame(frame)]
    return "\n".join([head, *lines, *(f"note: {note}" for note in motion.notes)])
