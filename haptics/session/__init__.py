"""The composition: ports, clock, drivers, scene, plan and recorder; run, replay and off."""
