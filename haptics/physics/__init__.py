"""Models of the devices: one phenomenon a file, pure functions over frozen parameters, no clock, no input or output."""

from haptics.physics.brake import brake_plant
from haptics.physics.brake_bank import BrakeBank
from haptics.physics.brake_contact import ContactLag, ContactParameters, lagged
from haptics.physics.brake_drive import DriveParameters, greatest_frequency_hz, rise_time_s, supply_power_w
from haptics.physics.brake_finger import FingerParameters
from haptics.physics.brake_force import ClosingGapLaw, ForceLaw, IdealLaw, ThresholdLaw, default_law, force_law
from haptics.physics.brake_output import OutputStage
from haptics.physics.brake_parameters import BrakeParameters, capacitance_f
from haptics.physics.brake_plant import BrakeEvent, BrakePlant
from haptics.physics.brake_predict import BrakePrediction, predict_brake, predict_volts
from haptics.physics.brake_system import BrakeSystem
from haptics.physics.latch import LatchOutcome, latch_plant, least_pulse_s, switch, travel_s
from haptics.physics.latch_bank import LatchBank
from haptics.physics.latch_parameters import LatchParameters
from haptics.physics.latch_plant import LatchEvent, LatchPlant
from haptics.physics.parameters import ParameterRow, Parameters, parameter, provenance
from haptics.physics.piezo import PiezoParameters
from haptics.physics.recoil import RecoilParameters, predict_recoil
from haptics.physics.thermal import ThermalParameters, pulse_rise_k, relax
from haptics.physics.thermal_plant import ThermalPlant, thermal_plant
from haptics.physics.thermal_trains import TrainPrediction, predict_thermal

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
    "greatest_frequency_hz",
    "lagged",
    "latch_plant",
    "least_pulse_s",
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
