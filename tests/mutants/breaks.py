"""Every break there is, room by room. A break that survives asks for a better test; none is ever taken out for surviving."""

from __future__ import annotations

from breaks_boards import BOARDS
from breaks_devices import DEVICES
from breaks_firmware import FIRMWARE
from breaks_link import LINK
from breaks_recording import RECORDING
from breaks_rendering import RENDERING
from breaks_scheduling import SCHEDULING
from breaks_session import SESSION

BREAKS = [*BOARDS, *FIRMWARE, *LINK, *SCHEDULING, *DEVICES, *SESSION, *RENDERING, *RECORDING]
