"""Models of the devices: one phenomenon a file, pure functions over frozen parameters, no clock, no input or output."""

from haptics.physics.brake.bank import BrakeBank
from haptics.physics.brake.charging import DriveParameters, max_frequency_hz, rise_time_s, supply_power_w
from haptics.physics.brake.contact import ContactLag, ContactParameters, lagged
from haptics.physics.brake.finger import FingerParameters
from haptics.physics.brake.fitted_law import ForceLaw
from haptics.physics.brake.force_laws import ClosingGapLaw, IdealLaw, ThresholdLaw, default_law, force_law
from haptics.physics.brake.levels import brake_plant
from haptics.physics.brake.output_stage import OutputStage
from haptics.physics.brake.parameters import BrakeParameters, capacitance_f
from haptics.physics.brake.plant import BrakeEvent, BrakePlant
from haptics.physics.brake.predict import BrakePrediction, predict_brake, predict_volts
from haptics.physics.brake.system import BrakeSystem
from haptics.physics.latch.bank import LatchBank
from haptics.physics.latch.parameters import LatchParameters
from haptics.physics.latch.plant import LatchEvent, LatchPlant
from haptics.physics.latch.pulse import LatchOutcome, latch_plant, min_pulse_s, switch, travel_s
from haptics.physics.latch.recoil import RecoilParameters, predict_recoil
from haptics.physics.parameters import ParameterRow, Parameters, parameter, provenance
from haptics.physics.piezo import PiezoParameters
from haptics.physics.thermal.one_node import ThermalParameters, pulse_rise_k, relax
from haptics.physics.thermal.plant import ThermalPlant, thermal_plant
from haptics.physics.thermal.trains import TrainPrediction, predict_thermal

__all__ = [
    "BrakeBank",
    "BrakeEvent",
    "BrakeParameters",
    "BrakePlant",
    "BrakePrediction",
    "BrakeSystem",
    "ClosingGapLaw",
    "ContactLag",
    "ContactParameters",
    "DriveParameters",
    "FingerParameters",
    "ForceLaw",
    "IdealLaw",
    "LatchBank",
    "LatchEvent",
    "LatchOutcome",
    "LatchParameters",
    "LatchPlant",
    "OutputStage",
    "ParameterRow",
    "Parameters",
    "PiezoParameters",
    "RecoilParameters",
    "ThermalParameters",
    "ThermalPlant",
    "ThresholdLaw",
    "TrainPrediction",
    "brake_plant",
    "capacitance_f",
    "default_law",
    "force_law",
    "lagged",
    "latch_plant",
    "max_frequency_hz",
    "min_pulse_s",
    "parameter",
    "predict_brake",
    "predict_recoil",
    "predict_thermal",
    "predict_volts",
    "provenance",
    "pulse_rise_k",
    "relax",
    "rise_time_s",
    "supply_power_w",
    "switch",
    "thermal_plant",
    "travel_s",
]
