"""Before wearing anything: how warm does a rhythm make a coil, and what does a brake hold at which volts?"""

from haptics.physics import predict_brake, predict_thermal, predict_volts, switch

print("heat of one actuator, limit 20 K above the room")
for rate_per_min in (49, 96, 120, 240):
    heat = predict_thermal(rate_per_min, limit_k=20.0, minutes=6.0)
    denied = "none denied" if heat.first_denied_s is None else f"first denied after {heat.first_denied_s:.0f} s"
    print(f"  {rate_per_min:3d} switches a minute: {heat.admitted} of {heat.asked} in 6 min, {denied}")

back = switch(0.010, direction="on-off")
assert back.arrival_s is not None
print(f"a 10 ms pulse brings the pin back in {back.arrival_s * 1e3:.1f} ms for {back.energy_j * 1e3:.0f} mJ")

print("index brake at 10 Hz")
for volts in (200.0, 400.0, 800.0, 1500.0, 4000.0):
    brake = predict_brake(volts, "index")
    why = "" if brake.valid else f"  ({'; '.join(brake.reasons)})"
    print(f"  {volts:6.0f} V: {brake.force_n:5.2f} ± {brake.force_sd_n:.2f} N, {brake.t90_ms:.1f} ms to 90 %{why}")
print(f"  4 N take {predict_volts(4.0, 'index').volts:.0f} V")
