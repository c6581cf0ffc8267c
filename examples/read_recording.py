"""Read a recording with h5py alone: ``python read_recording.py RUN.h5``. Any HDF5 reader in any language can do the same."""

import sys

import h5py

if len(sys.argv) != 2:
    sys.exit("usage: python read_recording.py RUN.h5")
with h5py.File(sys.argv[1]) as file:
    entry = file["entry"]
    print(f"{entry['title'][()].decode()}; {'complete' if entry.attrs['complete'] else entry.attrs['damage']}")

    ticks = entry["ticks"]  # the devices, every 10 ms
    seconds = (ticks["time_ns"][()] - ticks["time_ns"][0]) / 1e9
    for field in ("volts", "force_n", "rise_k"):
        values = ticks[field][()]  # (time, channel)
        row, channel = divmod(int(abs(values).argmax()), values.shape[1])
        print(
            f"peak {field:8} {abs(values).max():9.3f} {ticks[field].attrs['units']} on channel {channel} at {seconds[row]:.2f} s"
        )

    events = entry["events"]
    for time_ns, kind, subject, thing in zip(
        *(events[name][()] for name in ("time_ns", "kind", "subject", "object")), strict=True
    ):
        if kind in (b"touch", b"release", b"grasp_begin", b"grasp_end"):
            print(f"{(time_ns - ticks['time_ns'][0]) / 1e9:6.3f} s  {kind.decode():12} {subject.decode()} {thing.decode()}")

    wire = entry["wire"]
    for port, name in ((1, "tactor array"), (2, "brake controller")):
        print(f"{wire['length'][wire['port'][()] == port].sum()} bytes on the link of the {name}")
